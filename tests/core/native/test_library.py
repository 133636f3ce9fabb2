"""The compiled library is given what it expects, or is not called; nothing crashes."""

from __future__ import annotations

import _ctypes
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from frame_sources import Frames
from native_shots import Kind, passes_of, shot
from shots import World, camera, view

from xrds_core.accumulation.accumulate import Accumulated, accumulate
from xrds_core.accumulation.frame import Stored, store
from xrds_core.accumulation.local_filters import find_ranges, find_rims
from xrds_core.frame_source import Window
from xrds_core.native import library as module
from xrds_core.native.library import (
    Arrays,
    LibraryError,
    file_name,
    in_threads,
    library,
)
from xrds_core.shot import Shot

SUPPORT = Path(__file__).resolve().parents[2] / "support"
PREAMBLE = f"""
import os, signal, sys, threading, time
sys.path.insert(0, {str(SUPPORT)!r})
import numpy as np
from native_shots import Kind, shot
from xrds_core.accumulation.accumulate import accumulate

def give(target, others, threads=None):
    return accumulate(target, others, threads=threads).radiance
"""
needs_linux = pytest.mark.skipif(sys.platform != "linux", reason="only as Linux has it")


def start(script: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", PREAMBLE + script]
    pipe = subprocess.PIPE
    # NumPy's BLAS may hang where a process forks beside threads of its own
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    return subprocess.Popen(
        command, stdout=pipe, stderr=pipe, text=True, env=environment
    )


def end(process: subprocess.Popen[str]) -> tuple[str, str]:
    """What a process prints, which is to end by itself."""
    try:
        return process.communicate(timeout=300)
    finally:
        process.kill()


def run(script: str) -> str:
    """What a script prints that ends well."""
    process = start(script)
    out, errors = end(process)
    assert process.returncode == 0, (process.returncode, errors)
    return out


def assert_same(one: Accumulated, two: Accumulated) -> None:
    passes = passes_of(two)
    for name, x in passes_of(one).items():
        assert np.array_equal(x, passes[name], equal_nan=True)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Where the library is looked for, empty."""
    monkeypatch.setattr(module, "FOLDER", tmp_path)
    library.cache_clear()
    yield tmp_path
    library.cache_clear()


@pytest.mark.parametrize(
    ("x", "dtype", "count"),
    [
        (np.zeros(6, np.float64), np.float32, 6),
        (np.zeros(6, np.float16), np.uint16, 6),
        (np.zeros(6, np.int8), np.bool_, 6),
        (np.zeros(6, ">f4"), np.float32, 6),
        (np.zeros(6, np.float32), np.float32, 7),
        (np.zeros(6, np.float32), np.float32, 5),
        (np.zeros(0, np.float32), np.float32, 1),
        (np.zeros(6, object), np.float32, 6),
    ],
)
def test_other_arrays_are_refused(x: Any, dtype: Any, count: int) -> None:
    with pytest.raises(ValueError, match="needed"):
        Arrays().at(x, dtype, count)


def test_arrays_are_kept_and_made_contiguous() -> None:
    whole = np.arange(12, dtype=np.float32).reshape(3, 4)
    arrays = Arrays()
    assert arrays.at(None, np.float32, 3) is None
    assert arrays.at(whole, np.float32, 12) == whole.ctypes.data
    assert arrays.at(whole[:, ::2], np.float32, 6) != whole.ctypes.data
    address, strides = arrays.strided(whole[::-1, ::2])
    assert address == whole.ctypes.data + 32
    assert strides == (-4, 2)


@pytest.mark.parametrize(
    ("name", "dtype"),
    [
        ("picture", np.float32),
        ("inverse_depth", np.float64),
        ("counts", np.float32),
        ("invalid", np.uint8),
    ],
)
def test_frames_of_other_numbers_are_refused(name: str, dtype: Any) -> None:
    target, others = shot(Kind(counts=True, invalid=True))
    wrong = replace(others[0], **{name: getattr(others[0], name).astype(dtype)})
    with pytest.raises(ValueError, match="needed"):
        accumulate(target, [wrong])


@pytest.mark.parametrize("name", ["picture", "inverse_depth", "counts", "invalid"])
@pytest.mark.parametrize("own", [True, False])
def test_frames_of_too_few_pixels_are_refused(name: str, own: bool) -> None:
    target, others = shot(Kind("still", counts=True, invalid=True))
    given = target if own else others[0]
    short = replace(given, **{name: getattr(given, name)[:-1]})
    with pytest.raises(ValueError, match=r"needed|broadcast|reshape"):
        accumulate(*((short, others) if own else (target, [short])))


def test_surfaces_of_another_size_are_refused() -> None:
    depth = np.zeros(12, np.float32)
    for shape in ((3, 5), (1, 11)):
        with pytest.raises(ValueError, match="needed"):
            find_rims(depth, shape, False)
    with pytest.raises(ValueError, match="needed"):
        find_rims(depth.astype(np.float64), (3, 4), False)
    with pytest.raises(ValueError, match="needed"):
        find_ranges(depth.astype(np.float64), (3, 4))


def apart_in_memory(frame: Stored) -> Stored:
    """The same frame, no two numbers of which lie side by side."""

    def wide(x: Any) -> Any:
        return None if x is None else np.repeat(x, 2, axis=0)[::2]

    return replace(
        frame,
        picture=np.asfortranarray(frame.picture),
        inverse_depth=wide(frame.inverse_depth),
        invalid=wide(frame.invalid),
        counts=wide(frame.counts),
        parts={name: wide(x) for name, x in frame.parts.items()},
    )


def test_strides_change_nothing() -> None:
    kind = Kind(counts=True, invalid=True, parts=True, alpha=True, moving=True)
    target, others = shot(kind)
    spread = [apart_in_memory(x) for x in others]
    assert_same(accumulate(target, others), accumulate(apart_in_memory(target), spread))


def test_a_frame_of_one_pixel() -> None:
    for light in (True, False):
        target, others = shot(Kind("still", (1, 1), light=light))
        found = accumulate(target, others)
        assert found.samples.item() >= target.samples
        assert np.isfinite(found.albedo).all()


def test_a_window_of_one_frame() -> None:
    frame = view(3, camera(), World()).frame
    window = Window(Shot((3,), 0), Frames(lambda _: store(frame)))
    (only,) = window
    found = accumulate(only.own, list(only.neighbours.values()))
    assert found.frames == (3,)
    assert found.rejected == 0.0
    expected = frame.albedo.astype(np.float16).astype(np.float32)
    assert np.array_equal(found.albedo, expected)


@pytest.mark.parametrize("threads", [0, 1, 2, 50, None])
def test_any_number_of_threads(threads: int | None) -> None:
    target, others = shot(Kind("turn", (300, 40), sides=(1, 1)))
    whole = accumulate(target, others, threads=1)
    assert_same(whole, accumulate(target, others, threads=threads))


@needs_linux
def test_a_process_may_fork_while_it_runs() -> None:
    told = run("""
target, others = shot(Kind("turn", (300, 600), sides=(1, 1)))
expected = give(target, others)
ends = threading.Event()
def work():
    while not ends.is_set():
        give(target, others)
thread = threading.Thread(target=work)
thread.start()
codes = []
for _ in range(5):
    time.sleep(0.05)
    child = os.fork()
    if not child:
        signal.alarm(120)
        os._exit(0 if np.array_equal(give(target, others, 2), expected) else 3)
    codes.append(os.waitpid(child, 0)[1])
ends.set()
thread.join()
print(codes)
""")
    assert told == "[0, 0, 0, 0, 0]\n"


def test_two_interpreters_at_once() -> None:
    script = """
import hashlib
target, others = shot(Kind("turn", (200, 300), sides=(1, 1)))
found = {hashlib.md5(give(target, others).tobytes()).hexdigest() for _ in range(5)}
print(found)
"""
    both = [start(script) for _ in range(2)]
    told = [end(each)[0] for each in both]
    assert told[0] == told[1]
    assert told[0].count("'") == 2


@needs_linux
@pytest.mark.parametrize("after", [0.02, 0.1, 0.3])
def test_an_interrupt_leaves_no_thread(after: float) -> None:
    told = run(f"""
target, others = shot(Kind("turn", (400, 600)))
expected = give(target, others)
before = threading.active_count()
def interrupt(*_):
    raise KeyboardInterrupt
signal.signal(signal.SIGALRM, interrupt)
# again and again: one that comes while something is freed is ignored
signal.setitimer(signal.ITIMER_REAL, {after}, 0.5)
try:
    try:
        while True:
            give(target, others, 4)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
except KeyboardInterrupt:
    pass
end = time.monotonic() + 60
while threading.active_count() > before and time.monotonic() < end:
    time.sleep(0.01)
print(threading.active_count() == before)
print(np.array_equal(give(target, others), expected))
""")
    assert told == "True\nTrue\n"


def test_a_thread_that_an_interrupt_hides_is_waited_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One that comes as a thread starts: nobody else knows of that thread."""
    start, begun, done = threading.Thread.start, [], []

    def interrupted(thread: threading.Thread) -> None:
        start(thread)
        while not begun:
            time.sleep(0.001)
        raise KeyboardInterrupt

    def work(item: int) -> None:
        begun.append(item)
        time.sleep(0.2)
        done.append(item)

    monkeypatch.setattr(threading.Thread, "start", interrupted)
    with pytest.raises(KeyboardInterrupt):
        in_threads(work, [1, 2, 3], 2)
    assert done == begun == [1]
    time.sleep(0.3)
    assert done == begun == [1]


@needs_linux
def test_a_program_that_is_interrupted_ends() -> None:
    process = start("""
signal.signal(signal.SIGINT, signal.default_int_handler)
target, others = shot(Kind("turn", (400, 600)))
print("ready", flush=True)
while True:
    give(target, others, 4)
""")
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    for _ in range(100):
        process.send_signal(signal.SIGINT)
        try:
            process.wait(1.0)
            break
        except subprocess.TimeoutExpired:
            continue
    _, errors = end(process)
    assert "KeyboardInterrupt" in errors
    assert process.returncode in (1, -signal.SIGINT, 130)


@needs_linux
def test_memory_may_run_out() -> None:
    """At any place: the address space has some more bytes than it needs at rest.

    In one thread: Python waits for ever for one that finds no memory when it begins.
    """
    told = run("""
import resource
target, others = shot(Kind("turn", (128, 900), sides=(1, 1), parts=True, alpha=True))
expected = give(target, others, 1)
results = set()
for more in range(0, 100, 4):
    at_rest = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
    limit = at_rest + (more << 20)
    resource.setrlimit(resource.RLIMIT_AS, (limit, resource.RLIM_INFINITY))
    try:
        found = give(target, others, 1)
    except MemoryError:
        results.add("no memory")
    else:
        results.add("same" if np.array_equal(found, expected) else "other")
    infinite = resource.RLIM_INFINITY, resource.RLIM_INFINITY
    resource.setrlimit(resource.RLIMIT_AS, infinite)
print(sorted(results))
""")
    assert told == "['no memory', 'same']\n"


def assert_refused(match: str) -> None:
    with pytest.raises(LibraryError, match=match) as caught:
        library()
    assert "\n" not in str(caught.value)
    assert "make native" in str(caught.value)


def test_it_may_be_missing(folder: Path) -> None:
    assert_refused("cannot be loaded")
    target = np.zeros(4, np.float32)
    with pytest.raises(LibraryError):
        find_rims(target, (2, 2), False)
    (folder / file_name()).mkdir()
    assert_refused("cannot be loaded")


@pytest.mark.parametrize("kept", [0, 3, 40, 64, 1000, 50_000, -1])
def test_it_may_be_cut_off(folder: Path, kept: int) -> None:
    whole = (Path(module.__file__).parent / "lib" / file_name()).read_bytes()
    (folder / file_name()).write_bytes(whole[:kept])
    assert_refused("cannot be loaded")


@pytest.mark.parametrize(
    "held", [b"\0" * 5000, b"no library", b"\x7fELF" + b"\1" * 999]
)
def test_it_may_hold_anything(folder: Path, held: bytes) -> None:
    (folder / file_name()).write_bytes(held)
    assert_refused("cannot be loaded")


def test_it_may_be_another_library(folder: Path) -> None:
    shutil.copy(_ctypes.__file__, folder / file_name())
    assert_refused("other version")


def test_it_may_have_other_structures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "IN_ORDER", module.IN_ORDER[::-1])
    library.cache_clear()
    try:
        assert_refused("other version")
    finally:
        library.cache_clear()


@pytest.mark.parametrize(
    ("system", "machine"), [("linux", "riscv64"), ("sunos5", "x86_64")]
)
def test_other_platforms_are_told(
    system: str, machine: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "platform", system)
    monkeypatch.setattr(module.platform, "machine", lambda: machine)
    with pytest.raises(LibraryError, match=machine):
        file_name()


def test_structures_are_counted() -> None:
    sizes = [library().struct_size(n) for n in (-1, len(module.IN_ORDER), 1 << 30)]
    assert sizes == [-1, -1, -1]


def test_levels_are_limited_and_found_again() -> None:
    most = library().level()
    assert most in (1, 3)
    for level in (1, 0, -5):
        library().limit_level(level)
        assert library().level() <= 1
    library().limit_level(3)
    assert library().level() == most
    assert Path(library()._name).name == file_name()
