"""`xrds stability --fuzz`: `xrds denoise` on shots that are all wrong.

Each case is a small shot whose headers, windows, channels, bytes, cameras and options
are made odd by chance, and processes of their own that denoise it. What must not happen
is told: tracebacks and NumPy's warnings, hangs, crashes, much memory, half-written
files, inputs that change, frames or attributes that are lost without a word, frames of
`--resume` that differ from those of a run from nothing. A seed and a number tell a
case. POSIX alone: processes are forked, so that each begins with all modules loaded.
"""

from __future__ import annotations

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
from xrds_core.errors import PictureError
from xrds_core.exr.openexr_io import read
from xrds_core.exr.raw_header import attributes_in, header_bytes
from xrds_core.files import read_json, write_json
from xrds_core.progress import duration

from ..progress import silent
from .fuzz_shots import Twice, make_twice
from .odd_shots import Case, make_case

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ..progress import Progress

LIMIT = 60.0  # seconds that a run may take
MEMORY = 2 << 30  # bytes that a run may take
_STATUSES = (0, 1, 2)
_OF_CODING = (
    *(b"channels", b"compression", b"chunkCount", b"dataWindow", b"lineOrder"),
    *(b"tiles", b"type", b"name", b"version", b"xrds.made_of", b"xrds.samples"),
)
_TELL = 20.0  # seconds between lines of progress


@dataclass(frozen=True)
class Run:
    """How one run went; `faults` are the names of what must not happen."""

    words: list[str]
    status: int
    seconds: float
    memory: int
    """Bytes, the most at once."""
    faults: list[str]
    lines: list[str]
    """The last ones on stderr."""


def fuzz(
    out: Path,
    minutes: float,
    *,
    seed: int = 0,
    resume: bool = False,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Run cases 0, 1, ... of a seed for some minutes; `resume` goes on after the last.

    Appends each case with a fault to OUT/fuzz.json, one a line.
    """
    _load()
    out.mkdir(parents=True, exist_ok=True)
    so_far, findings = out / f"fuzz-{seed}.progress.json", out / "fuzz.json"
    told = {"cases": 0, "wrong": 0, "seconds": 0.0}
    if resume and so_far.is_file():
        told = read_json(so_far)
    started = last = time.monotonic()
    while (now := time.monotonic()) < started + 60 * minutes:
        number = int(told["cases"])
        with tempfile.TemporaryDirectory(prefix="xrds-fuzz-") as folder:
            runs = run_case(Path(folder), seed, number)
        if any(run.faults for run in runs):
            told["wrong"] += 1
            line = {"seed": seed, "case": number, "runs": [asdict(x) for x in runs]}
            with findings.open("a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")
            progress(f"case {number}: {', '.join(x for y in runs for x in y.faults)}")
        told |= {
            "cases": number + 1,
            "seconds": told["seconds"] + time.monotonic() - now,
        }
        write_json(so_far, told)
        if now > last + _TELL:
            last = now
            left = duration(max(started + 60 * minutes - now, 0.0))
            progress(f"{number + 1} cases, {told['wrong']} wrong, {left} left")
    return {"seed": seed, **told, "passed": not told["wrong"]}


def keep_case(out: Path, seed: int, number: int) -> list[Run]:
    """Run one case alone and leave its files in a folder of `out`."""
    _load()
    folder = out / f"case-{seed}-{number}"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    return run_case(folder, seed, number)


def run_case(folder: Path, seed: int, number: int) -> list[Run]:
    """Make a case in an empty folder and denoise it: two of three of them twice."""
    if number % 3 == 0:
        return [run(make_case(folder, seed, number))]
    case = make_twice(folder, seed, number)
    first = run(case)
    case.change()
    second, third = run(case.resumed), run(case.afresh)
    second.faults.extend(_differences(case, second, third))
    return [first, second, third]


def run(case: Case) -> Run:
    """Denoise a shot in a process of its own."""
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
    seconds = time.monotonic() - started
    return Run(case.words, status, seconds, memory, faults, errors.splitlines()[-12:])


def _load() -> None:
    """Load what every case needs, but no denoiser: it has threads of its own."""
    from xrds_blender.command import main  # noqa: F401
    from xrds_core.denoising import denoiser, oidn_device  # noqa: F401
    from xrds_core.shot_files import sequence  # noqa: F401

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
    if status > 0 or "--resume" in case.words:  # not all are made by this run
        return
    for path in outputs:
        try:
            planes = [exr.File(path).pixels(name) for name in case.picture(path)]
        except (PictureError, KeyError):
            yield "unreadable output"
            continue
        if not all(np.isfinite(plane).all() for plane in planes):
            yield "not finite"
        if "--picture-only" not in case.words:
            lost = _attributes(case.folder / "in" / path.name) - _attributes(path)
            yield from (f"{path.name} lacks {x[:2]}" for x in sorted(lost)[:1])


def _attributes(path: Path) -> set[tuple[bytes, bytes, bytes]]:
    """What the headers of a file say of the picture, byte by byte.

    Of what they say twice, and otherwise, no reader knows which one is meant.
    """
    try:
        found = [*attributes_in(header_bytes(path) + b"\0\0")]
    except (OSError, ValueError):
        return set()
    told = {(x.name, x.kind, x.value) for x in found if x.name not in _OF_CODING}
    count = Counter(name for name, _, _ in told)
    return {x for x in told if count[x[0]] == 1}


def _differences(case: Twice, resumed: Run, fresh: Run) -> Iterator[str]:
    """What `--resume` left otherwise than a run from nothing, without a line."""
    if resumed.status != fresh.status:
        if fresh.status == 0:
            yield "resume fails"
        return
    for path in sorted((case.folder / "new").glob("*.exr")):
        if not _are_equal(case.output / path.name, path):
            yield f"{path.name} differs"


def _are_equal(one: Path, two: Path) -> bool:
    """Whether all channels of all parts are, bit by bit, and where they lie."""
    try:
        parts = [read(path) for path in (one, two)]
    except PictureError:
        return False
    kinds, others = (
        [(x.name, x.data_window, x.display_window, [*x.channels]) for x in each]
        for each in parts
    )
    if kinds != others or _attributes(one) != _attributes(two):
        return False
    return all(
        a.channels[name].tobytes() == b.channels[name].tobytes()
        for a, b in zip(*parts, strict=True)
        for name in a.channels
    )


def _inputs(folder: Path) -> dict[str, str]:
    """What the input files hold, by name."""
    files = [x for each in ("in", "more") for x in (folder / each).glob("*")]
    files += folder.glob("cameras.*")
    return {
        str(x): hashlib.blake2b(x.read_bytes()).hexdigest()
        for x in files
        if x.is_file()
    }
