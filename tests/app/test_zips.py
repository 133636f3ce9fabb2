"""The zips of `make extension`, light and full; skipped where none is built.

Name their folder in XRDS_ZIPS if it is not dist. Those for this system's Python 3.11 go
into the bpy module as extensions go into Blender, and render there.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
import zipfile
from importlib.util import find_spec
from pathlib import Path

import pytest
from program import HERE

pytestmark = pytest.mark.timeout(1800)
FOLDER = Path(os.environ.get("XRDS_ZIPS", HERE.parents[1] / "dist"))
ZIPS = sorted(FOLDER.glob("xrds-*-cp*.zip"))
NONE = f"no zip in {FOLDER}: make extension builds them"
SIZE_LIMIT, LIGHT_LIMIT = 300_000_000, 80_000_000
TAGS = {"linux": "manylinux", "windows": "win_amd64", "macos": "macosx"}
# What the module itself needs, and no more: PyTorch has to come from the zip.
MODULES = ("bpy", "numpy", "requests", "urllib3", "certifi", "idna", "Cython")
INSTALL = """
import addon_utils, os, sys
module = "bl_ext.user_default.xrds"
addon_utils.extensions_refresh(addon_modules_pending=[module])
assert addon_utils.enable(module), "not enabled"
assert "torch" not in sys.modules
import bpy
assert bpy.ops.xrds.self_test() == {"FINISHED"}
import importlib
for name in sys.argv[1:]:
    print("from=" + importlib.import_module(name).__file__)
import numpy
print("numpy=" + numpy.__file__, flush=True)
os._exit(0)  # a Blender that rendered can hang when its Python ends
"""


@pytest.fixture(params=ZIPS or [None], ids=lambda path: path and path.stem)
def package(request: pytest.FixtureRequest) -> Path:
    if request.param is None:
        pytest.skip(NONE)
    return request.param


def wheels(package: Path) -> list[str]:
    with zipfile.ZipFile(package) as file:
        return [Path(name).name for name in file.namelist() if name.endswith(".whl")]


def test_it_fits_the_platform(package: Path) -> None:
    limit = LIGHT_LIMIT if "-light-" in package.stem else SIZE_LIMIT
    assert package.stat().st_size <= limit


def test_wheels_are_those_of_platform_and_python(package: Path) -> None:
    found = re.search(r"-(linux|windows|macos)_\w+-(cp\d+)$", package.stem)
    assert found, package.stem
    names = wheels(package)
    expected = {"xrds", "openexr", "mitsuba_oidn", "drjit", "nanobind_backend"}
    if "-light-" not in package.stem:
        expected |= {"torch", "safetensors"}
    assert {name.partition("-")[0] for name in names} >= expected
    assert not [name for name in names if name.startswith("numpy-")]
    for name in names:
        python, abi, platform = Path(name).stem.split("-")[-3:]
        if platform == "any":
            continue
        assert TAGS[found[1]] in platform, name
        assert found[2] in (python, abi) or abi == "abi3", name


def test_the_manifest_names_what_lies_there(package: Path) -> None:
    with zipfile.ZipFile(package) as file:
        told = tomllib.loads(file.read("blender_manifest.toml").decode())
        (own,) = [name for name in file.namelist() if "/xrds-" in name]
        with file.open(own) as stream, zipfile.ZipFile(stream) as wheel:
            names = wheel.namelist()
    assert sorted(Path(name).name for name in told["wheels"]) == sorted(wheels(package))
    assert len(told["platforms"]) == 1
    assert "xrds_blender/interface/engine.py" in names
    for folder in ("training", "studio", "bench", "tests"):
        assert not [name for name in names if f"/{folder}/" in f"/{name}"]


@pytest.mark.parametrize("kind", ["light-", ""], ids=["light", "full"])
def test_the_module_renders_with_what_the_zip_holds(tmp_path: Path, kind: str) -> None:
    """As Blender installs it: unpacked, its wheels spread by Blender's own manager."""
    tag = f"linux_x64-cp{sys.version_info[0]}{sys.version_info[1]}"
    found = list(FOLDER.glob(f"xrds-[0-9]*[0-9]-{kind}{tag}.zip"))
    if not found or find_spec("bpy") is None or sys.platform != "linux":
        pytest.skip(f"asks for the bpy module and xrds-VERSION-{kind}{tag}.zip")
    used = ["xrds_blender", "mitsuba_oidn", "OpenEXR"]
    used += [] if kind else ["torch", "safetensors"]
    add_on = tmp_path / "extensions" / "user_default" / "xrds"
    with zipfile.ZipFile(found[0]) as file:
        file.extractall(add_on)
    site = tmp_path / "site"
    site.mkdir()
    for name in MODULES:
        spec = find_spec(name)
        if spec and spec.origin:
            package = Path(spec.origin).parent
            (site / name).symlink_to(package)
            libraries = package.with_name(f"{name}.libs")
            if libraries.exists():
                (site / libraries.name).symlink_to(libraries)
    done = subprocess.run(
        [sys.executable, "-S", "-c", "import bpy\n" + INSTALL, *used],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
        cwd=tmp_path,
        env={
            **os.environ,
            "PYTHONPATH": str(site),
            "BLENDER_USER_RESOURCES": str(tmp_path),
        },
    )
    assert done.returncode == 0, done.stdout
    lines = [line.partition("=") for line in done.stdout.splitlines()]
    origins = [value for key, _, value in lines if key == "from"]
    assert len(origins) == len(used)
    unpacked = str(tmp_path / "extensions" / ".local")
    assert all(path.startswith(unpacked) for path in origins), origins
    (numpy,) = [value for key, _, value in lines if key == "numpy"]
    assert numpy.startswith(str(site))
