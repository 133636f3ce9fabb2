"""Build the extension's zips: one per platform and Python, and one without torch.

Each holds a manifest, a root module and wheels: the project's own and, but for the one
without torch, those of PyTorch's CPU build, safetensors and OpenEXR. Blender's own
`extension build` makes and checks them; it comes with the bpy module.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

from wheels import PLATFORMS, NoCpuBuild, download, resolve, targets

ROOT = Path(__file__).resolve().parent.parent
MANIFEST = "blender_manifest.toml"
PROJECT_FILES = ("pyproject.toml", "README.md", "LICENSE")
PACKAGES = ("xrds_core", "xrds_blender")
SIZE_LIMIT = 300_000_000  # bytes; what the extension platform means to take
# Python inside Blender, and the Blenders that have it: from, to (not included).
PYTHONS = {"3.11": ("4.2.0", "5.1.0"), "3.13": ("5.1.0", None)}
WITHOUT_TORCH = "without_torch"


def build(
    out: Path, name: str, wheels: list[Path], lines: dict[str, object] | None = None
) -> Path:
    """Build one zip into the folder `out`; `lines` replace those of the manifest."""
    version = tomllib.loads((ROOT / MANIFEST).read_text("utf-8"))["version"]
    with tempfile.TemporaryDirectory() as folder:
        add_on = Path(folder)
        (add_on / "wheels").mkdir()
        for wheel in wheels:
            shutil.copy(wheel, add_on / "wheels")
        named = [f"./wheels/{wheel.name}" for wheel in wheels]
        (add_on / MANIFEST).write_text(_manifest({**(lines or {}), "wheels": named}))
        shutil.copy(ROOT / "LICENSE", add_on)
        shutil.copy(ROOT / "extension" / "__init__.py", add_on)
        out.mkdir(parents=True, exist_ok=True)
        path = out / f"xrds-{version}-{name}.zip"
        _blenders_build(add_on, path)
    return path


def own_wheel(folder: Path) -> Path:
    """Build a wheel of what renders, from a copy without the rest."""
    source = folder / "source"
    source.mkdir()
    for name in PROJECT_FILES:
        shutil.copy(ROOT / name, source)
    for name in PACKAGES:
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / name, source / name, ignore=ignored)
    options = ["--quiet", "--no-deps", "--no-build-isolation", "--wheel-dir"]
    _run("-m", "pip", "wheel", *options, str(folder), str(source))
    (wheel,) = folder.glob("xrds-*.whl")
    return wheel


def _manifest(lines: dict[str, object]) -> str:
    """The manifest with some of its top-level lines replaced or added."""
    head, tables, rest = (ROOT / MANIFEST).read_text("utf-8").partition("\n[")
    kept = [line for line in head.splitlines() if line.partition(" =")[0] not in lines]
    added = [f"{name} = {json.dumps(value)}" for name, value in lines.items()]
    return "\n".join([*kept, *added]) + "\n" + tables + rest


def _blenders_build(add_on: Path, path: Path) -> None:
    """Let Blender's extension tool check the folder and zip it."""
    import bpy

    scripts = Path(bpy.utils.resource_path("LOCAL")) / "scripts"
    tool = scripts / "addons_core" / "bl_pkg" / "cli" / "blender_ext.py"
    places = ["--source-dir", str(add_on), "--output-filepath", str(path)]
    _run(str(tool), "build", *places)


def _run(*words: str) -> None:
    done = subprocess.run(
        [sys.executable, *words], capture_output=True, text=True, check=False
    )
    if done.returncode:
        sys.exit(f"{' '.join(words)} failed:\n{done.stdout}{done.stderr}")


def _with_torch(options: argparse.Namespace, own: Path) -> None:
    """One zip for each platform and Python that the index has a CPU torch for."""
    wanted = [f"torch=={options.torch}", "safetensors", "OpenEXR"]
    for target in targets(options.platform, list(PYTHONS)):
        try:
            pins = resolve(target, wanted)
            wheels = download(target, pins, options.cache / target.name)
        except (NoCpuBuild, LookupError) as error:
            print(f"{target.name}: no zip with torch, {error}")
            continue
        least, end = PYTHONS[target.python]
        lines = {"platforms": [target.platform], "blender_version_min": least}
        if end:
            lines["blender_version_max"] = end
        _print_size(build(options.out, target.name, [own, *wheels], lines))


def _print_size(path: Path) -> None:
    size = path.stat().st_size
    verdict = "" if size <= SIZE_LIMIT else f", above {SIZE_LIMIT / 1e6:.0f} MB"
    print(f"{path}  {size / 1e6:.1f} MB{verdict}", flush=True)


def main() -> None:
    """Build into the folder named on the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    add = parser.add_argument
    add("--out", type=Path, default=ROOT / "dist")
    add(
        "--cache",
        type=Path,
        default=ROOT / "build" / "wheels",
        help="folder for downloaded wheels",
    )
    add("--without-torch", action="store_true", help="build only the small zip")
    add("--torch", default="2.13.0", help="version of PyTorch")
    names = {"nargs": "+", "choices": list(PLATFORMS), "default": list(PLATFORMS)}
    add("--platform", **names)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        own = own_wheel(Path(folder))
        _print_size(build(options.out, WITHOUT_TORCH, [own]))
        if not options.without_torch:
            _with_torch(options, own)


if __name__ == "__main__":
    main()
