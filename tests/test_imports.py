"""Who may import whom, read from the source without running it."""

from __future__ import annotations

import ast
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("xrds_core", "xrds_blender", "xrds_lab")
# Every folder may import those below it, and itself. Imports inside functions and those
# for type checkers count as well.
ORDER = (
    "xrds_lab",
    "xrds_blender",
    "xrds_blender.command",
    "xrds_blender.interface",
    "xrds_blender.rendering",
    "xrds_blender.cycles",
    "xrds_blender.scene",
    "xrds_blender.planning",
    "xrds_blender.internals",
    "xrds_core",
)
VAGUE = {"utils", "util", "helpers", "helper", "common", "misc"}
SOURCES = sorted(path for name in PACKAGES for path in (ROOT / name).rglob("*.py"))


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(path): path for path in SOURCES}


def resolved(node: ast.ImportFrom, path: Path) -> str:
    """The absolute name of the module that `from . import` speaks of."""
    if not node.level:
        return node.module or ""
    package = module_name(path).split(".")
    if path.stem != "__init__":
        package = package[:-1]
    package = package[: len(package) - node.level + 1]
    return ".".join([*package, node.module] if node.module else package)


def imports(path: Path) -> Iterator[str]:
    """Absolute names of all that a file imports: `from a import b` is a.b, if a module.

    `from a import b` of another kind is a.
    """
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = resolved(node, path)
            for alias in node.names:
                name = f"{base}.{alias.name}"
                yield name if name in MODULES else base


def roots(path: Path) -> set[str]:
    return {name.split(".")[0] for name in imports(path)}


def folder(module: str) -> str:
    """The entry of ORDER that a module lies in."""
    return max((name for name in ORDER if inside(module, name)), key=len)


def inside(name: str, package: str) -> bool:
    return name == package or name.startswith(package + ".")


def own_imports(module: str) -> set[str]:
    """The project's modules that one of them imports."""
    return {name for name in imports(MODULES[module]) if name in MODULES} - {module}


def below(package: str) -> list[Path]:
    return [path for name, path in MODULES.items() if inside(name, package)]


def source(name: str) -> Path:
    return MODULES[name]


def test_sources_are_found() -> None:
    assert len(below("xrds_core")) > 20
    assert len(below("xrds_blender")) > 40
    assert len(below("xrds_lab")) > 60


def test_every_folder_has_its_place() -> None:
    folders = {
        f"xrds_blender.{path.name}"
        for path in (ROOT / "xrds_blender").iterdir()
        if (path / "__init__.py").is_file()
    }
    assert folders <= set(ORDER)


@pytest.mark.parametrize("module", MODULES)
def test_arrows_run_down(module: str) -> None:
    place = ORDER.index(folder(module))
    upward = {n for n in own_imports(module) if ORDER.index(folder(n)) < place}
    assert not upward


def test_no_circles() -> None:
    """Modules are taken away when all that they import has gone; none may stay."""
    left = {module: own_imports(module) for module in MODULES}
    while free := [module for module, needed in left.items() if not needed & set(left)]:
        for module in free:
            del left[module]
    assert not left


@pytest.mark.parametrize("path", SOURCES, ids=module_name)
def test_imports_inside_a_package_are_relative(path: Path) -> None:
    own = module_name(path).split(".")[0]
    absolute = [
        node
        for node in ast.walk(ast.parse(path.read_text()))
        if (
            isinstance(node, ast.ImportFrom)
            and not node.level
            and (node.module or "").split(".")[0] == own
        )
        or (
            isinstance(node, ast.Import)
            and any(alias.name.split(".")[0] == own for alias in node.names)
        )
    ]
    assert not absolute


@pytest.mark.parametrize("path", below("xrds_core"), ids=module_name)
def test_core_knows_no_blender(path: Path) -> None:
    assert not roots(path) & {"bpy", "mathutils"}


@pytest.mark.parametrize("path", below("xrds_blender.planning"), ids=module_name)
def test_planning_is_plain_python(path: Path) -> None:
    assert not roots(path) & {"bpy", "torch", "numpy"}


def test_network_is_torch_alone() -> None:
    allowed = {"torch", "__future__", "math", "dataclasses", "typing", "collections"}
    assert roots(source("xrds_core.superres.regression")) <= allowed
    for name in ("network", "kernels"):
        module = f"xrds_core.superres.{name}"
        assert roots(source(module)) <= allowed | {"xrds_core"}
        assert own_imports(module) <= {
            "xrds_core.superres.kernels",
            "xrds_core.superres.regression",
        }


def test_the_wheel_holds_core_and_add_on_alone() -> None:
    """And the laboratory's own metadata name every one of its packages."""
    told = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    assert told["packages"]["find"]["include"] == ["xrds_core*", "xrds_blender*"]
    told = tomllib.loads((ROOT / "xrds_lab" / "pyproject.toml").read_text())
    packages = {module_name(p) for p in below("xrds_lab") if p.stem == "__init__"}
    assert set(told["tool"]["setuptools"]["packages"]) == packages


@pytest.mark.parametrize("path", SOURCES, ids=module_name)
def test_no_vague_names(path: Path) -> None:
    assert not VAGUE & set(path.relative_to(ROOT).with_suffix("").parts)


def test_the_add_on_s_top_is_its_front_alone() -> None:
    files = [path for path in (ROOT / "xrds_blender").iterdir() if path.is_file()]
    assert [path.name for path in files] == ["__init__.py"]


@pytest.mark.parametrize(
    "module", [*PACKAGES, "xrds_lab.cards.report", "xrds_lab.shots.own_seconds"]
)
def test_what_a_bare_machine_runs_loads_no_torch(module: str) -> None:
    code = f"import sys, {module}; sys.exit('torch' in sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_no_child_process_runs_what_lies_in_the_working_folder() -> None:
    """`python -m` and `-c` look there first, unless -P comes before them."""
    folders = [ROOT / name for name in (*PACKAGES, "extension")]
    for path in (path for folder in folders for path in folder.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if not isinstance(node, ast.Call | ast.List):
                continue
            given = node.args if isinstance(node, ast.Call) else node.elts
            words = [x.value for x in given if isinstance(x, ast.Constant)]
            safe = "-P" in words or "run_python" in ast.unparse(node)
            assert safe or not {"-m", "-c"} & set(words), f"{path}:{node.lineno}"
