"""`python -m xrds_lab.stability.fuzz`: `xrds denoise` on shots that are all wrong.

Each case is a small shot whose headers, windows, channels, bytes, cameras and options
are made odd by chance, and a process of its own that denoises it. What must not happen
is counted: tracebacks and NumPy's warnings, hangs, crashes, much memory, half-written
files, inputs that change, frames that are lost without a word. A seed and a number tell
a case. POSIX alone: processes are forked, so that each begins with all modules loaded.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import json
import os
import shutil
import signal
import sys
import tempfile
import time
import warnings
from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from xrds_core import exr
from xrds_core.atomic import write_json
from xrds_core.errors import PictureError

from .odd_shots import Case, make_case

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

LIMIT = 60.0  # seconds that a case may take
MEMORY = 2 << 30  # bytes that a case may take
_STATUSES = (0, 1, 2)


@dataclass(frozen=True)
class Outcome:
    """How one case went; `faults` are the names of what must not happen."""

    case: int
    words: list[str]
    status: int
    seconds: float
    memory: int
    """Bytes, the most at once."""
    faults: list[str]
    lines: list[str]
    """The last ones on stderr."""


def fuzz(seconds: float, seed: int = 0, first: int = 0) -> Iterator[Outcome]:
    """Yield the outcomes of cases `first`, `first` + 1, ... for some seconds."""
    _load()
    end, number = time.monotonic() + seconds, first
    while time.monotonic() < end:
        with tempfile.TemporaryDirectory(prefix="xrds-fuzz-") as folder:
            yield run_case(number, make_case(Path(folder), seed, number))
        number += 1


def run_case(number: int, case: Case) -> Outcome:
    """Denoise one shot in a process of its own."""
    before, started = _inputs(case.folder), time.monotonic()
    process = os.fork()
    if process == 0:
        _denoise(case)
    status, memory = _awaited(process, started + LIMIT)
    errors = (case.folder / "stderr").read_text("utf-8", "replace")
    faults = [*_told(status, memory, errors)]
    after = _inputs(case.folder)
    if any(after.get(name) != told for name, told in before.items()):
        faults.append("inputs changed")
    faults += _written(case, status)
    return Outcome(
        number,
        case.words,
        status,
        time.monotonic() - started,
        memory,
        faults,
        errors.splitlines()[-12:],
    )


def _load() -> None:
    """Load what every case needs, but no denoiser: it has threads of its own."""
    from xrds_blender.command import main  # noqa: F401
    from xrds_core.denoising import denoiser, oidn_device  # noqa: F401
    from xrds_core.sequence import denoise  # noqa: F401

    with contextlib.suppress(PictureError):
        exr.attributes(os.devnull)


def _denoise(case: Case) -> None:
    """In the child: run the command, and end."""
    from xrds_blender.command.main import main

    os.setsid()
    with (case.folder / "stderr").open("wb") as stream:
        os.dup2(stream.fileno(), 2)
    sys.stderr = os.fdopen(os.dup(2), "w", errors="backslashreplace", buffering=1)
    nothing = os.open(os.devnull, os.O_RDWR)
    os.dup2(nothing, 1)
    os.dup2(nothing, 0)
    sys.stdout = os.fdopen(os.dup(1), "w")
    os.chdir(case.folder)
    tempfile.tempdir = str(case.folder)
    warnings.simplefilter("error", RuntimeWarning)
    status = 99
    try:
        status = main(case.words)
    finally:
        os._exit(status)


def _awaited(process: int, end: float) -> tuple[int, int]:
    """Return exit status, negative of a signal, and peak memory; killed at `end`."""
    while True:
        done, status, usage = os.wait4(process, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status), usage.ru_maxrss << 10
        if time.monotonic() > end:
            os.kill(process, signal.SIGKILL)
            end = float("inf")
        time.sleep(0.01)


def _told(status: int, memory: int, errors: str) -> Iterator[str]:
    if status == -signal.SIGKILL:
        yield "hang"
    elif status not in _STATUSES:
        yield "crash"
    if "Traceback" in errors or "a bug in XRDS" in errors:
        yield "traceback"
    elif any(not line.startswith("xrds: ") for line in errors.splitlines()):
        yield "foreign line"
    if status > 0 and not errors.strip():
        yield "no word"
    if memory > MEMORY:
        yield "memory"


def _written(case: Case, status: int) -> Iterator[str]:
    """What is wrong with the outputs."""
    if any(case.folder.rglob(".xrds-*.unfinished")):
        yield "half-written"
    outputs = [x for x in case.output.glob("*.exr") if x.is_file()]
    if status == 0 and len(outputs) < case.least:
        yield "frames lost"
    for path in outputs:
        try:
            planes = [exr.File(path).pixels(name) for name in case.picture(path)]
        except (PictureError, KeyError):
            yield "unreadable output"
            continue
        if not all(np.isfinite(plane).all() for plane in planes):
            yield "not finite"


def _inputs(folder: Path) -> dict[str, str]:
    """What the input files hold, by name."""
    files = [x for x in (folder / "in").iterdir() if x.is_file()]
    files += [x for x in folder.glob("cameras.*") if x.is_file()]
    return {x.name: hashlib.blake2b(x.read_bytes()).hexdigest() for x in files}


def summary(outcomes: Sequence[Outcome], seed: int) -> dict[str, Any]:
    """What is told of many cases: counts, and those that went wrong."""
    faults = Counter(fault for x in outcomes for fault in set(x.faults))
    largest = max(outcomes, key=lambda x: x.memory)
    return {
        "seed": seed,
        "cases": len(outcomes),
        "statuses": dict(sorted(Counter(str(x.status) for x in outcomes).items())),
        "faults": dict(faults),
        "peak_memory": largest.memory,
        "peak_memory_case": largest.case,
        "longest_seconds": round(max(x.seconds for x in outcomes), 1),
        "wrong": [asdict(x) for x in outcomes if x.faults],
    }


def _main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--out", type=Path, required=True, help="folder for fuzz.json")
    parser.add_argument("--keep", action="store_true", help="run the first case alone")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    if options.keep:
        _keep(options.out / f"case{options.first}", options.seed, options.first)
        return
    outcomes: list[Outcome] = []
    for outcome in fuzz(options.seconds, options.seed, options.first):
        outcomes.append(outcome)
        if outcome.faults:
            print(f"case {outcome.case}: {', '.join(outcome.faults)}", flush=True)
        if len(outcomes) % 50 == 1 or outcome.faults:
            write_json(options.out / "fuzz.json", summary(outcomes, options.seed))
    write_json(options.out / "fuzz.json", summary(outcomes, options.seed))


def _keep(folder: Path, seed: int, number: int) -> None:
    """Run one case alone and leave its files."""
    _load()
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    outcome = run_case(number, make_case(folder, seed, number))
    print(json.dumps(asdict(outcome), indent=1))


if __name__ == "__main__":
    _main()
