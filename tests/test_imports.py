"""Who may import whom, read from the source without running it."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("xrds_core", "xrds_blender")
# What the extension leaves out; nothing that it holds may import these.
OUTSIDE = ("xrds_core.training", "xrds_blender.studio", "xrds_blender.bench")
VAGUE = {"utils", "util", "helpers", "helper", "common", "misc"}
SOURCES = sorted(path for name in PACKAGES for path in (ROOT / name).rglob("*.py"))


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def resolved(node: ast.ImportFrom, path: Path) -> str:
    """The absolute name of the module that `from . import` speaks of."""
    if not node.level:
        return node.module or ""
    package = module_name(path).split(".")
    if path.stem != "__init__":
        package = package[:-1]
    package = package[: len(package) - node.level + 1]
    return ".".join([*package, node.module] if node.module else package)


def imports(path: Path, tree: ast.AST | None = None) -> Iterator[str]:
    """Absolute names of all that a file imports, `from a import b` as a and a.b."""
    for node in ast.walk(tree or ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = resolved(node, path)
            yield base
            yield from (f"{base}.{alias.name}" for alias in node.names)


def roots(path: Path) -> set[str]:
    return {name.split(".")[0] for name in imports(path)}


def inside(name: str, packages: tuple[str, ...]) -> bool:
    return any(name == p or name.startswith(p + ".") for p in packages)


CORE = [path for path in SOURCES if inside(module_name(path), ("xrds_core",))]
COMMAND_LINE = ("xrds_blender.cli", "xrds_blender.cli_training")
# The command line names every command and looks for its work only when asked.
EXTENSION = [
    path for path in SOURCES if not inside(module_name(path), (*OUTSIDE, *COMMAND_LINE))
]


def source(name: str) -> Path:
    path = ROOT / name
    if not path.exists():
        pytest.skip(f"{name} is not written yet")
    return path


def test_sources_are_found() -> None:
    assert len(SOURCES) > 10


@pytest.mark.parametrize("path", CORE, ids=module_name)
def test_core_knows_no_blender(path: Path) -> None:
    assert not roots(path) & {"bpy", "mathutils", "xrds_blender"}


@pytest.mark.parametrize("path", SOURCES, ids=module_name)
def test_imports_inside_a_package_are_relative(path: Path) -> None:
    own = module_name(path).split(".")[0]
    told = [
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
    assert not told


@pytest.mark.parametrize("path", EXTENSION, ids=module_name)
def test_extension_imports_nothing_it_leaves_out(path: Path) -> None:
    assert not [found for found in imports(path) if inside(found, OUTSIDE)]


@pytest.mark.parametrize("name", COMMAND_LINE)
def test_command_line_imports_the_rest_only_when_asked(name: str) -> None:
    path = source(f"{name.replace('.', '/')}.py")
    top = ast.Module(
        body=[n for n in ast.parse(path.read_text()).body if not is_function(n)],
        type_ignores=[],
    )
    assert not [found for found in imports(path, top) if inside(found, OUTSIDE)]


def is_function(node: ast.stmt) -> bool:
    return isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)


def test_network_is_torch_alone() -> None:
    allowed = {"torch", "__future__", "math", "dataclasses", "typing", "collections"}
    assert roots(source("xrds_core/regression.py")) <= allowed
    base = ("xrds_core.kernels", "xrds_core.regression")
    for name in ("network", "kernels"):
        path = source(f"xrds_core/{name}.py")
        assert roots(path) <= allowed | {"xrds_core"}
        own = {each for each in imports(path) if inside(each, ("xrds_core",))}
        assert all(inside(each, base) for each in own)


def test_plan_is_plain_python() -> None:
    path = source("xrds_blender/plan.py")
    assert not roots(path) & {"torch", "bpy"}


@pytest.mark.parametrize("path", SOURCES, ids=module_name)
def test_no_vague_names(path: Path) -> None:
    assert not VAGUE & set(path.relative_to(ROOT).with_suffix("").parts)


@pytest.mark.parametrize("package", PACKAGES)
def test_importing_a_package_loads_no_torch(package: str) -> None:
    code = f"import sys, {package}; sys.exit('torch' in sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("path", SOURCES, ids=module_name)
def test_files_and_functions_stay_small(path: Path) -> None:
    assert len(path.read_text().splitlines()) <= 600
    for node in ast.walk(ast.parse(path.read_text())):
        if is_function(node):
            assert node.end_lineno - node.lineno < 80, node.name
