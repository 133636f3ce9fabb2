"""Build the extension's zips, for each platform and Python of Blender.

Each holds a manifest, a root module and wheels. `light` zips render at full size: they
hold the project's own wheel, Open Image Denoise and OpenEXR. `full` zips hold PyTorch's
CPU build and safetensors beside these, and the large network's weights. The `bare` zip,
one for all, holds the own wheel alone, for pipelines that bring the libraries. That
wheel holds the compiled core of its zip's platform, in the `bare` zip those of all.
Blender's own `extension build`, which comes with the bpy module, makes and checks them.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path

from wheels import PLATFORMS, NoCpuBuild, Target, download, resolve, targets

from xrds_core.native.compile import chosen, compile_libraries

ROOT = Path(__file__).resolve().parent.parent
MANIFEST = "blender_manifest.toml"
PROJECT_FILES = ("pyproject.toml", "setup.py", MANIFEST, "README.md", "LICENSE")
PACKAGES = ("xrds_core", "xrds_blender")
SIZE_LIMIT = 300_000_000  # bytes; what the extension platform means to take
# Python inside Blender, and the Blenders that have it: from, to (not included).
PYTHONS = {"3.11": ("4.2.0", "5.1.0"), "3.13": ("5.1.0", None)}
LIGHT = ("mitsuba-oidn", "OpenEXR")
LARGE = "paper_*.safetensors"  # 29 MB of weights, in `full` zips alone


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


def own_wheel(
    folder: Path,
    *left_out: str,
    website: str | None = None,
    platform: str = "all",
) -> Path:
    """Build a wheel of what renders, from a copy without the rest.

    `left_out` are patterns of names; the `website` goes into its metadata. The core is
    compiled for the `platform`.
    """
    source = folder / "source"
    source.mkdir(parents=True)
    for name in PROJECT_FILES:
        shutil.copy(ROOT / name, source)
    if website:
        with (source / "pyproject.toml").open("a", encoding="utf-8") as file:
            file.write(f"\n[project.urls]\nHomepage = {json.dumps(website)}\n")
    for name in PACKAGES:
        ignored = shutil.ignore_patterns("__pycache__", *left_out)
        shutil.copytree(ROOT / name, source / name, ignore=ignored)
    options = ["--quiet", "--no-deps", "--no-build-isolation", "--wheel-dir"]
    words = ["-P", "-m", "pip", "wheel", *options, str(folder), str(source)]
    # not from the copy: zig remembers what it compiled by the place of the sources
    libraries = folder / "libraries"
    compile_libraries(chosen(platform), libraries)
    _run(*words, XRDS_PLATFORMS=platform, XRDS_LIBRARIES=str(libraries))
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
    places = ["--source-dir", str(add_on), "--output-filepath", str(path)]
    blenders_tool("build", *places)


def blenders_tool(*words: str) -> None:
    """Run what `blender --command extension` runs; ends the program if it fails."""
    import bpy

    scripts = Path(bpy.utils.resource_path("LOCAL")) / "scripts"
    _run(str(scripts / "addons_core" / "bl_pkg" / "cli" / "blender_ext.py"), *words)


def _run(*words: str, **variables: str) -> None:
    done = subprocess.run(
        [sys.executable, *words],
        env=os.environ | variables,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        sys.exit(f"{' '.join(words)} failed:\n{done.stdout}{done.stderr}")


def _with_libraries(
    kind: str, options: argparse.Namespace, own: Callable[[str], Path]
) -> None:
    """One zip of a kind for each platform and Python that the index has wheels for.

    `own` gives the own wheel for a platform.
    """
    wanted = list(LIGHT)
    if kind == "full":
        wanted += [f"torch=={options.torch}", "safetensors"]
    for target in targets(options.platform, options.python):
        name = target.name if kind == "full" else f"{kind}-{target.name}"
        try:
            pins = resolve(target, wanted)
            wheels = download(target, pins, options.cache / name)
        except (NoCpuBuild, LookupError) as error:
            print(f"{name}: no zip, {error}")
            continue
        lines = {"platforms": [target.platform]} | _versions(target, options)
        lines |= _website(options)
        wheels.insert(0, own(target.platform))
        _print_size(build(options.out, name, wheels, lines))


def _versions(target: Target, options: argparse.Namespace) -> dict[str, object]:
    """The Blenders that have the target's Python, as lines of the manifest."""
    if options.any_blender:
        return {}
    least, end = PYTHONS[target.python]
    newest = {"blender_version_max": end} if end else {}
    return {"blender_version_min": least, **newest}


def _website(options: argparse.Namespace) -> dict[str, object]:
    """The project's address, where it is told, as a line of the manifest."""
    return {"website": options.website} if options.website else {}


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
    kinds = ("bare", "light", "full")
    add("--kind", nargs="+", choices=kinds, default=["light", "full"])
    add("--torch", default="2.13.0", help="version of PyTorch")
    names = {"nargs": "+", "choices": list(PLATFORMS), "default": list(PLATFORMS)}
    add("--platform", **names)
    add("--python", nargs="+", default=list(PYTHONS), help="as 3.11")
    distributions = "for builds of distributions, which pair it with other Pythons"
    add("--website", help="address of the project, for Blender and the package index")
    add("--any-blender", action="store_true", help=distributions)
    options = parser.parse_args()
    if not options.any_blender and set(options.python) - set(PYTHONS):
        parser.error(f"Blenders have Python {', '.join(PYTHONS)}; see --any-blender")
    with tempfile.TemporaryDirectory() as folder:

        @cache
        def own(whole: bool, platform: str) -> Path:
            left_out = () if whole else (LARGE,)
            place = Path(folder) / ("whole" if whole else "light") / platform
            return own_wheel(
                place, *left_out, website=options.website, platform=platform
            )

        for kind in options.kind:
            if kind == "bare":
                wheels = [own(False, "all")]
                _print_size(build(options.out, kind, wheels, _website(options)))
            else:
                _with_libraries(kind, options, partial(own, kind == "full"))


if __name__ == "__main__":
    main()
