"""Compile the C core into one library for each platform, with zig from any of them.

    python xrds_core/native/compile.py [--platform linux-x64 ...] [--out FOLDER]

Runs before anything is installed, so it imports the standard library alone. Zig comes
as a package, brings the headers of all platforms, and is the same everywhere.
"""

from __future__ import annotations

import argparse
import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path

HERE = Path(__file__).resolve().parent
LIBRARIES = HERE / "lib"
"""Where the libraries lie in an installed package, and in a source tree."""
ZIG = "ziglang>=0.15.2,<0.18"
"""The versions that pyproject.toml requires."""


class CompileError(Exception):
    """Zig is missing or the sources do not compile; the first line says which."""


@dataclass(frozen=True)
class Platform:
    """What a library is compiled for."""

    target: str
    """Zig's name, with the oldest system that the library runs on."""
    tag: str
    """What a wheel for it is tagged with."""
    system: tuple[str, str]
    """`sys.platform`, and what `machine` says."""
    suffix: str


PLATFORMS = {
    "linux-x64": Platform(
        "x86_64-linux-gnu.2.28", "manylinux_2_28_x86_64", ("linux", "x86_64"), ".so"
    ),
    "linux-arm64": Platform(
        "aarch64-linux-gnu.2.28", "manylinux_2_28_aarch64", ("linux", "aarch64"), ".so"
    ),
    "windows-x64": Platform(
        "x86_64-windows-gnu", "win_amd64", ("win32", "win-amd64"), ".dll"
    ),
    "macos-arm64": Platform(
        "aarch64-macos.11.0", "macosx_11_0_arm64", ("darwin", "arm64"), ".dylib"
    ),
    "macos-x64": Platform(
        "x86_64-macos.11.0", "macosx_11_0_x86_64", ("darwin", "x86_64"), ".dylib"
    ),
}

# Results must not depend on whether a processor can multiply and add at once, so the
# compiler may not join the two. Zig checks for undefined behaviour unless told not to.
_FLAGS = shlex.split(
    "-c -std=c11 -O3 -Wall -fvisibility=hidden -fno-math-errno -fno-trapping-math "
    "-ffp-contract=off -fno-sanitize=undefined"
)
# The kernels are compiled once for each level of processors that a platform has.
_LEVELS = {"v1": "x86_64", "v3": "x86_64_v3"}


def this_platform() -> str:
    """The platform that this Python runs on.

    Raises CompileError where there is no library for it.
    """
    name = sysconfig.get_platform()
    machine = name if sys.platform == "win32" else os.uname().machine
    for platform, description in PLATFORMS.items():
        if description.system == (sys.platform, machine):
            return platform
    raise CompileError(f"no library for {name}; there is {', '.join(PLATFORMS)}")


def chosen(text: str | None) -> list[str]:
    """Return the platforms named in a text such as `linux-x64,macos-x64`.

    Parameters
    ----------
    text : str or None
        Names, or `all`; without any it is this platform.

    Returns
    -------
    platforms : list of str

    Raises
    ------
    CompileError
        If a name is unknown.
    """
    names = (text or "").replace(",", " ").split()
    if names == ["all"]:
        return list(PLATFORMS)
    for name in names:
        if name not in PLATFORMS:
            known = ", ".join(PLATFORMS)
            raise CompileError(f"platform {name!r} is unknown; use all, {known}")
    return names or [this_platform()]


def library_name(platform: str) -> str:
    """The file name of a platform's library."""
    return platform + PLATFORMS[platform].suffix


def sources() -> list[Path]:
    """The files that libraries are made of."""
    return sorted([*HERE.glob("*.c"), *HERE.glob("*.h")])


def compile_libraries(
    platforms: Iterable[str],
    folder: Path = LIBRARIES,
    flags: Sequence[str] = (),
    compiler: str | None = None,
) -> list[Path]:
    """Compile a library for each platform.

    An earlier library is replaced as a whole, so that a process that has loaded it runs
    on.

    Parameters
    ----------
    platforms : iterable of str
        Names among PLATFORMS.
    folder : Path
        Where the libraries go.
    flags : sequence of str
        Further flags, behind all others; with some, symbols stay in the library.
    compiler : str, optional
        Takes the place of zig, for this platform.

    Returns
    -------
    paths : list of Path
        The libraries.

    Raises
    ------
    CompileError
        If zig is missing or the sources do not compile.
    """
    if compiler is None and find_spec("ziglang") is None:
        raise CompileError(f"zig is missing: run pip install '{ZIG}'")
    folder.mkdir(parents=True, exist_ok=True)
    with (
        tempfile.TemporaryDirectory(prefix="xrds-") as place,
        ThreadPoolExecutor(os.cpu_count()) as pool,
    ):
        work = Path(place)
        run = partial(_run, compiler, _find_cache(work))
        jobs = {
            name: [
                pool.submit(run, [*words, *flags, "-o", str(made)])
                for made, words in _list_objects(name, work).items()
            ]
            for name in platforms
        }
        for running in jobs.values():
            for job in running:
                job.result()
        return [_link(name, folder, flags, work, run) for name in jobs]


def _list_objects(platform: str, work: Path) -> dict[Path, list[str]]:
    """The object files of a library, and how each is compiled."""
    target = PLATFORMS[platform].target
    windows = target.startswith("x86_64-windows")
    base = ["-target", target, *_FLAGS, *([] if windows else ["-fPIC"])]
    levels = _LEVELS if target.startswith("x86_64") else {"v1": ""}
    arguments = {}
    for level, processor in levels.items():
        named = [f"-DNAME(x)=x##_{level}", *_processor_flags(processor)]
        arguments[f"kernels_{level}"] = ["kernels.c", *named]
    arguments["dispatch"] = ["dispatch.c", *_processor_flags(levels["v1"])]
    if windows:
        arguments["windows"] = ["windows.c", *_processor_flags(levels["v1"])]
    return {
        work / f"{platform}-{name}.o": [*base, *words, str(HERE / source)]
        for name, (source, *words) in arguments.items()
    }


def _processor_flags(name: str) -> list[str]:
    return [f"-mcpu={name}"] if name else []


def _link(
    platform: str,
    folder: Path,
    flags: Sequence[str],
    work: Path,
    run: Callable[[list[str]], None],
) -> Path:
    target = PLATFORMS[platform].target
    made = work / library_name(platform)
    words = ["-shared", "-O3", "-target", target, *flags, "-o", str(made)]
    words += [] if flags else ["-s"]
    if target.startswith("x86_64"):
        words += _processor_flags(_LEVELS["v1"])
    objects = [str(path) for path in _list_objects(platform, work)]
    if "windows" in target:  # see windows.c
        objects += ["-nostdlib", "-lucrtbase"]
    if "macos" in target:  # else the temporary folder's name is kept in it
        words.append(f"-Wl,-install_name,@rpath/{made.name}")
    run([*words, *objects])
    part = folder / f"{made.name}.part"
    shutil.copyfile(made, part)
    return part.replace(folder / made.name)


def _find_cache(work: Path) -> Path:
    """Where zig keeps what it compiled: its own place, if that can be written to."""
    if folder := os.environ.get("ZIG_GLOBAL_CACHE_DIR"):
        return Path(folder)
    windows = sys.platform == "win32"
    kept = os.environ.get("LOCALAPPDATA" if windows else "XDG_CACHE_HOME")
    if not kept and not windows and (home := os.environ.get("HOME")):
        kept = f"{home}/.cache"
    try:
        own = Path(kept or work) / "zig"
        own.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=own):
            return own
    except OSError:
        return work / "zig"


def _run(compiler: str | None, cache: Path, words: list[str]) -> None:
    """Run a C compiler, zig's if it is None; what it warns of goes on to stderr."""
    if compiler:
        command = [*shlex.split(compiler), *_translate_flags(words)]
    else:  # -P: nothing of the working folder is taken for zig
        command = [sys.executable, "-P", "-m", "ziglang", "cc", *words]
    environment = os.environ | {"ZIG_GLOBAL_CACHE_DIR": str(cache)}
    done = subprocess.run(
        command,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="backslashreplace",
        check=False,
    )
    if done.returncode:
        output = f"{shlex.join(command)}\n{done.stdout}"
        raise CompileError(f"the C core does not compile\n{output}")
    if done.stdout:
        print(done.stdout, file=sys.stderr, end="")


def _translate_flags(words: list[str]) -> list[str]:
    """Zig's options as GCC and Clang have them."""
    kept = []
    following = iter(words)
    for word in following:
        if word == "-target":
            next(following)
        else:
            named = word.startswith("-mcpu=x86_64")
            changed = word.replace("-mcpu", "-march").replace("_", "-")
            kept.append(changed if named else word)
    return kept


def main() -> None:
    """Compile for the platforms named on the command line, this one without any."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    add = parser.add_argument
    add("--platform", nargs="+", default=[], help=f"all, {', '.join(PLATFORMS)}")
    add("--out", type=Path, default=LIBRARIES, help="folder for the libraries")
    add("--flags", type=shlex.split, default=[], help="more flags, behind all others")
    add("--compiler", help="GCC or Clang in the place of zig, for this platform")
    options = parser.parse_args()
    try:
        platforms = chosen(" ".join(options.platform))
        for path in compile_libraries(
            platforms, options.out, options.flags, options.compiler
        ):
            print(f"{path}  {path.stat().st_size / 1e3:.0f} kB")
    except (CompileError, OSError) as error:
        sys.exit(f"compile.py: {error}")


if __name__ == "__main__":
    main()
