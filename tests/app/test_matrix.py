"""The feature tests inside the real program, and the matrix that rests on them.

Every module of tests/blender that renders runs with the program's own Python, PyTorch
and Cycles; docs/compatibility.md has to tell what passed, neither more nor less.
"""

from __future__ import annotations

import re
import shutil
import xml.etree.ElementTree as ET
from importlib.metadata import distribution
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from program import HERE, Program

pytestmark = pytest.mark.timeout(2400)
ROOT = HERE.parents[1]
MATRIX = ROOT / "docs" / "compatibility.md"
COPIED = (
    "xrds_core",
    "xrds_blender",
    "xrds_lab",
    "tests/blender",
    "tests/support",
    "tests/conftest.py",
    "pyproject.toml",
)
# Left out: what starts a Python of its own.
MODULES = (
    "cycles/live",
    "cycles/low_camera",
    "cycles/passes",
    "rendering/guide_cache",
    "rendering/guide_changes",
    "rendering/record",
    "interface/engine",
    "interface/panels",
    "interface/translations",
    "internals/borrowed",
    "internals/engine_override",
    "internals/spare_passes",
    "planning/omissions",
    "scene/guide_key",
    "rendering/alpha",
    "rendering/features",
    "rendering/full_size",
    "rendering/shot",
    "rendering/shot_enlarged",
    "rendering/strength",
    "rendering/try_frame",
    "rendering/unchanged",
)
Verdicts = dict[str, str]


@pytest.fixture(scope="module")
def checkout(program: Program) -> Path:
    """A copy of the project that the program sees, with pytest."""
    folder = program.share / "checkout"
    shutil.rmtree(folder, ignore_errors=True)
    for name in COPIED:
        source = ROOT / name
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        if source.is_dir():
            ignored = shutil.ignore_patterns("__pycache__")
            shutil.copytree(source, folder / name, ignore=ignored)
        else:
            shutil.copy(source, folder / name)
    for name in ("pytest", "pytest-timeout"):
        copy_distribution(name, folder / "site")
    shutil.copy(HERE / "run_pytest.py", folder)
    return folder


def copy_distribution(name: str, site: Path) -> None:
    """Copy a package of this Python and all it needs; they hold no binaries."""
    found = distribution(name)
    metadata = f"{found.name}-{found.version}.dist-info"
    if (site / metadata).exists():
        return
    for file in found.files or ():
        if ".." in file.parts or "__pycache__" in file.parts:
            continue
        assert file.suffix != ".so", f"{name} is not pure Python"
        (site / file).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(found.locate_file(file), site / file)
    for text in found.requires or ():
        needed = Requirement(text)
        if needed.marker is None or needed.marker.evaluate({"extra": ""}):
            copy_distribution(needed.name, site)


@pytest.fixture(scope="module")
def verdicts() -> dict[Path, Verdicts]:
    """What became of each test so far, by program and name."""
    return {}


@pytest.mark.parametrize("module", MODULES)
def test_feature_tests_pass(
    program: Program, checkout: Path, verdicts: dict[Path, Verdicts], module: str
) -> None:
    folder, _, name = module.partition("/")
    report = checkout / f"{name}.xml"
    done = program.run(
        *("blender", "-b", "--factory-startup", "--python-exit-code", "3"),
        *("--python", program.seen(checkout / "run_pytest.py"), "--"),
        program.seen(checkout),
        f"tests/blender/{folder}/test_{name}.py",
        *("-rs", "--timeout=900", f"--junit-xml={program.seen(report)}"),
        timeout=2400,
    )
    (program.share / f"{name}.log").write_text(done.stdout)
    told = read(report)
    verdicts.setdefault(program.path, {}).update(told)
    wrong = sorted(name for name, verdict in told.items() if verdict == "failed")
    assert not wrong, done.stdout[-8000:]
    assert "passed" in told.values()
    assert done.returncode == 0, done.stdout[-4000:]


def read(report: Path) -> Verdicts:
    """Name and verdict of every test; of several cases the worst counts."""
    told: Verdicts = {}
    for case in ET.parse(report).iter("testcase"):
        name = case.get("name", "").partition("[")[0]
        kinds = {child.tag for child in case}
        verdict = "failed" if kinds & {"failure", "error"} else "passed"
        if "skipped" in kinds:
            verdict = "skipped"
        order = ("passed", "skipped", "failed")
        told[name] = max(told.get(name, "passed"), verdict, key=order.index)
    return told


def rows() -> list[dict[str, str]]:
    """The matrix: each feature's cells by the head of their column."""
    text = MATRIX.read_text("utf-8").partition("## Features")[2]
    lines = [
        line.strip("|").split("|") for line in text.splitlines() if line[:1] == "|"
    ]
    head, _, *body = [[cell.strip() for cell in line] for line in lines]
    return [dict(zip(head, line, strict=True)) for line in body]


def named_test(row: dict[str, str]) -> str | None:
    found = re.search(r"`(test_\w+)`", row["test"])
    return found and found[1]


def test_the_matrix_has_no_empty_cell() -> None:
    """Each is a kind of run or the number of a reason that is told below."""
    reasons = set(re.findall(r"^(\d+)\. ", MATRIX.read_text("utf-8"), re.MULTILINE))
    files = [path.read_text("utf-8") for path in HERE.parent.rglob("test_*.py")]
    for row in rows():
        for head, cell in list(row.items())[1:-1]:
            known = {"m", "p", *(f"({number})" for number in reasons)}
            assert cell in known, f"{row['feature']}, {head}: {cell!r}"
        if name := named_test(row):
            assert any(f"def {name}(" in text for text in files), name


def test_the_matrix_tells_what_passed(
    program: Program, verdicts: dict[Path, Verdicts]
) -> None:
    told = verdicts.get(program.path)
    if not told:
        pytest.skip("asks for test_feature_tests_pass in the same run")
    version = re.search(
        r"Blender (\d+\.\d+)", program.run("blender", "--version").stdout
    )
    assert version
    heads = [head for head in rows()[0] if head.split()[0] == version[1]]
    if not heads:
        pytest.skip(f"the matrix has no column for Blender {version[1]}")
    wrong = [
        f"{row['feature']}: {row[heads[0]]}, but {told[name]}"
        for row in rows()
        if (name := named_test(row)) in told
        and (row[heads[0]] == "p") != (told[name] == "passed")
    ]
    assert not wrong
