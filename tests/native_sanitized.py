"""Runs the compiled core under a sanitizer, on the shots that it is tested with.

python tests/native_sanitized.py undefined      what C leaves undefined; by Zig
python tests/native_sanitized.py address        reads and writes outside of arrays; by
                                                Clang with its compiler-rt, Linux only

`--seconds` for random shots; packing, surfaces and shots of all sizes come first.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

TESTS = Path(__file__).resolve().parent
SOURCES = TESTS.parent / "xrds_core" / "native"
FLAGS = [
    "-std=c11",
    "-O1",
    "-g",
    "-shared",
    "-fPIC",
    "-fno-omit-frame-pointer",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-ffp-contract=off",
    "-fvisibility=hidden",
    "-w",
]
UNDEFINED = "undefined,float-cast-overflow"
LEVELS = {"v1": "x86-64", "v3": "x86-64-v3"}
# The planes of a block lie in one array: what is between them is forbidden, too. The
# size of that array is asked for with planes that begin at address 64.
BOUNDS = """
#include <sanitizer/asan_interface.h>
#include <stdint.h>
#define BOUND(from, to, end) do { \\
    if ((uintptr_t)(from) < 1u << 20 || (uintptr_t)(end) < 1ull << 32) break; \\
    __asan_unpoison_memory_region(from, (end) - (from)); \\
    __asan_poison_memory_region(to, (end) - (to)); \\
} while (0)
"""


def clang() -> str:
    """The first Clang there is, as `CC` or under the names of its versions."""
    names = [os.environ.get("CC", "clang"), *(f"clang-{n}" for n in range(22, 12, -1))]
    found = next(filter(None, map(shutil.which, names)), None)
    if found is None:
        sys.exit("address needs Clang and its compiler-rt: apt install clang")
    return found


def build(kind: str, folder: Path) -> dict[str, str]:
    """Compile the library into a folder; returns what the environment must hold."""
    flags, environment = list(FLAGS), {}
    if kind == "undefined":
        compiler = [sys.executable, "-m", "ziglang", "cc"]
        flags += [f"-fsanitize={UNDEFINED}", "-fno-sanitize-recover=all"]
        machine = "-mcpu={}".format
        names = {"v1": "x86_64", "v3": "x86_64_v3"}
    else:
        compiler, machine, names = [clang()], "-march={}".format, LEVELS
        (folder / "bounds.h").write_text(BOUNDS)
        flags += ["-fsanitize=address", "-shared-libasan"]
        flags += ["-include", str(folder / "bounds.h")]
        print_name = [*compiler, "-print-file-name=libclang_rt.asan-x86_64.so"]
        runtime = subprocess.run(print_name, check=True, capture_output=True, text=True)
        environment = {
            "LD_PRELOAD": runtime.stdout.strip(),
            "ASAN_OPTIONS": "detect_leaks=0:abort_on_error=0",
            "PYTHONMALLOC": "malloc",
        }
    parts = []
    for level, processor in names.items():
        parts.append(folder / f"{level}.o")
        command = [
            *compiler,
            *flags,
            machine(processor),
            f"-DNAME(x)=x##_{level}",
            "-c",
        ]
        source = SOURCES / "kernels.c"
        subprocess.run([*command, str(source), "-o", str(parts[-1])], check=True)
    whole = [*compiler, *flags, str(SOURCES / "dispatch.c"), *map(str, parts)]
    sys.path[:0] = [str(TESTS.parent)]
    from xrds_core.native.library import file_name

    subprocess.run([*whole, "-o", str(folder / file_name())], check=True)
    return environment


def exercise(folder: Path, seconds: float, first: int) -> None:
    """What runs under the sanitizer, which ends the process where it finds anything."""
    sys.path[:0] = [str(TESTS.parent), str(TESTS / "support")]
    import native_shots as shots
    import numpy as np
    import pytest

    from xrds_core.accumulation.accumulate import accumulate
    from xrds_core.native import library as module

    np.seterr(all="ignore")
    module.FOLDER = folder
    tests = str(TESTS / "core" / "native" / "test_agreement.py")
    chosen = ["-k", "spots or surfaces or pack or half", "-p", "no:cacheprovider"]
    if pytest.main(["--noconftest", *chosen, tests]):
        sys.exit("tests failed")
    kinds = [
        shots.Kind(name, shape, light=light, alpha=alpha, parts=alpha)
        for shape in shots.SHAPES[:-1]
        for name in shots.CAMERAS
        for light in (True, False)
        for alpha in (True, False)
    ]
    start, done = time.monotonic(), 0
    while done < len(kinds) or time.monotonic() - start < seconds:
        is_given = done < len(kinds)
        kind = kinds[done] if is_given else shots.random_kind(first + done)
        for level in (1, 3):
            module.library().limit_level(level)
            target, others = shots.shot(kind)
            accumulate(target, others, threads=1 + done % 3)
        done += 1
    print(f"{done} shots, {time.monotonic() - start:.0f} s: nothing found")


def main() -> int:
    """Build and run; 0 where nothing was found."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("kind", choices=("undefined", "address"))
    parser.add_argument("--seconds", type=float, default=0.0)
    parser.add_argument("--first", type=int, default=0, help="number of random shots")
    parser.add_argument("--library", type=Path, help=argparse.SUPPRESS)
    wanted = parser.parse_args()
    if wanted.library:
        exercise(wanted.library, wanted.seconds, wanted.first)
        return 0
    with tempfile.TemporaryDirectory() as folder:
        environment = build(wanted.kind, Path(folder))
        command = [sys.executable, __file__, *sys.argv[1:], "--library", folder]
        done = subprocess.run(command, check=False, env={**os.environ, **environment})
    return done.returncode


if __name__ == "__main__":
    sys.exit(main())
