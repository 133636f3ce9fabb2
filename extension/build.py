"""Build the extension's zip: manifest, a root module and one pure wheel.

Blender's own `extension build` makes and checks the zip; it comes with the bpy module.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
MANIFEST = "blender_manifest.toml"
PROJECT_FILES = ("pyproject.toml", "README.md", "LICENSE")
PACKAGES = ("xrds_core", "xrds_blender")
# They serve the making of XRDS, not rendering with it.
LEFT_OUT = ("training", "studio", "bench", "__pycache__")


def build(out: Path) -> Path:
    """Build the zip into the folder `out` and return its path."""
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        add_on = work / "xrds"
        _wheel(work / "source", add_on / "wheels")
        shutil.copy(ROOT / MANIFEST, add_on)
        shutil.copy(ROOT / "LICENSE", add_on)
        shutil.copy(ROOT / "extension" / "__init__.py", add_on)
        out.mkdir(parents=True, exist_ok=True)
        _blenders_build(add_on, out)
    return max(out.glob("xrds-*.zip"), key=lambda path: path.stat().st_mtime)


def _wheel(source: Path, folder: Path) -> None:
    """Build a wheel of what renders, from a copy without the rest."""
    source.mkdir()
    for name in PROJECT_FILES:
        shutil.copy(ROOT / name, source)
    for name in PACKAGES:
        ignored = shutil.ignore_patterns(*LEFT_OUT)
        shutil.copytree(ROOT / name, source / name, ignore=ignored)
    options = ["--quiet", "--no-deps", "--no-build-isolation", "--wheel-dir"]
    _run("-m", "pip", "wheel", *options, str(folder), str(source))


def _blenders_build(add_on: Path, out: Path) -> None:
    """Let Blender's extension tool check the folder and zip it."""
    import bpy

    scripts = Path(bpy.utils.resource_path("LOCAL")) / "scripts"
    tool = scripts / "addons_core" / "bl_pkg" / "cli" / "blender_ext.py"
    _run(str(tool), "build", "--source-dir", str(add_on), "--output-dir", str(out))


def _run(*words: str) -> None:
    done = subprocess.run(
        [sys.executable, *words], capture_output=True, text=True, check=False
    )
    if done.returncode:
        sys.exit(f"{' '.join(words)} failed:\n{done.stdout}{done.stderr}")


def main() -> None:
    """Build into the folder named on the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "dist")
    print(build(parser.parse_args().out))


if __name__ == "__main__":
    main()
