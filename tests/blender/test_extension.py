"""The extension's zip: checked by Blender's own tool, complete, and nothing more."""

from __future__ import annotations

import subprocess
import sys
import tomllib
import zipfile
from importlib.metadata import version
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MANIFEST = tomllib.loads((ROOT / "blender_manifest.toml").read_text("utf-8"))


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("extension")
    script = ROOT / "extension" / "build.py"
    done = subprocess.run(
        [sys.executable, script, "--out", out],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    with zipfile.ZipFile(done.stdout.strip().splitlines()[-1]) as file:
        file.extractall(out / "zip")
    return out / "zip"


def wheel_names(unpacked: Path) -> set[str]:
    with zipfile.ZipFile(unpacked / MANIFEST["wheels"][0]) as wheel:
        return set(wheel.namelist())


def test_one_version_everywhere() -> None:
    told = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    assert MANIFEST["version"] == told["project"]["version"] == version("xrds")
    assert f"xrds-{MANIFEST['version']}-" in MANIFEST["wheels"][0]


def test_zip_holds_manifest_root_module_and_wheel(unpacked: Path) -> None:
    files = {str(p.relative_to(unpacked)) for p in unpacked.rglob("*") if p.is_file()}
    wheel = MANIFEST["wheels"][0].removeprefix("./")
    assert files == {"__init__.py", "LICENSE", "blender_manifest.toml", wheel}


def test_wheel_holds_what_renders(unpacked: Path) -> None:
    names = wheel_names(unpacked)
    assert {"xrds_core/network.py", "xrds_blender/engine.py"} <= names
    weights = {p.name for p in (ROOT / "xrds_core" / "weights").glob("*.safetensors")}
    assert {f"xrds_core/weights/{name}" for name in weights} <= names


@pytest.mark.parametrize("folder", ["training", "studio", "bench", "tests"])
def test_wheel_leaves_out_what_makes_xrds(unpacked: Path, folder: str) -> None:
    assert not [name for name in wheel_names(unpacked) if f"/{folder}/" in f"/{name}"]
