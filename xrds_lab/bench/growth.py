"""How seconds and memory grow with the frame, and where the network pays.

Over frames of one scene and over the cores of this machine: a whole frame by Cycles
with OIDN, one by each network, and what OIDN, the networks and single samples take
alone. The break-even sets what the small render saves against what the network takes.
"""

from __future__ import annotations

import math
from contextlib import nullcontext
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from xrds_blender.planning.request import render_request
from xrds_blender.planning.settings import DEFAULT_DENOISING, Denoising
from xrds_core.native.library import processors

from . import machine, tasks
from .inputs import Request
from .stages import PLAIN_FRAME, StageTimes, Stopwatch, clocked, in_process_name
from .sweep import anchor, xrds
from .windows import Window

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from xrds_blender.planning.settings import Network

    from .measure import Settings
    from .stages import Run, Task
    from .windows import Shot

    Size = tuple[int, int]
    Row = dict[str, Any]

# Cores that no machine at hand has; each stage's line in 1/cores is drawn on to them.
MORE_CORES = (8, 32)
# Larger frames are timed on all cores alone: what cores bring, smaller ones tell.
MOST_PIXELS_OF_FEW_CORES = 1920 * 1080
MEMORY_LIMIT = 1 << 30
QUICK_DENOISER = Denoising.HIGH_FAST
NOTE = (
    "Break-even at equal rays: saved is a frame of one sample + OIDN less the "
    "low-resolution render of scale² samples, its OIDN and one guide sample; paid is "
    f"the network. OIDN at full size is Blender's default ({DEFAULT_DENOISING}) or the "
    f"quicker {QUICK_DENOISER}. More cores than this machine has are extrapolated: "
    "every stage as a + b / cores through its runs on fewer. There was no graphics "
    "card to fit."
)


def growth(
    shot: Shot,
    sizes: Sequence[Size],
    settings: Settings,
    done: Callable[[float, str], object],
) -> dict[str, Any]:
    """Measure one scene at every size with 1 and all cores; the report's `growth`.

    `done` gets the megapixels of each run and its name.
    """
    counts = _core_counts()
    rows: list[Row] = []
    for size in sizes:
        few = size[0] * size[1] <= MOST_PIXELS_OF_FEW_CORES
        for cores in counts if few else counts[-1:]:
            rows += _measured(_resized(shot, size), cores, counts, settings, done)
    return {
        "scene": shot.name,
        "sizes": [list(size) for size in sizes],
        "rows": rows,
        "exponents": exponents(rows),
        "break_even": break_even(rows, settings.sweep.networks),
        "note": NOTE,
    }


def _core_counts() -> list[int]:
    """One core and all of them, where threads can be held to cores (Linux)."""
    most = processors()
    if not Path("/proc/self/task").is_dir() or most == 1:
        return [most]
    return [1, most]


def _resized(shot: Shot, size: Size) -> Shot:
    return replace(shot, window=Window(*size, 0, 0, *size), reference=None)


def _measured(
    shot: Shot,
    cores: int,
    counts: Sequence[int],
    settings: Settings,
    done: Callable[[float, str], object],
) -> list[Row]:
    """Rows of one frame size on so many cores."""
    size = shot.window.frame_width, shot.window.frame_height
    name = f"{shot.identity}-{cores}cores-growth.json"
    times = StageTimes(settings.folder.directory / name)
    watch = Stopwatch(shot, times, _renders(), _tasks(shot, settings), settings.journal)
    all_of_them = cores == max(counts)
    with nullcontext() if all_of_them else machine.only_cores(cores):
        pixels = size[0] * size[1] / 1e6
        watch.measure(
            settings.rounds, lambda what: done(pixels, f"{size[0]}x{size[1]}: {what}")
        )
    return [
        {
            "task": task,
            "size": list(size),
            "pixels": size[0] * size[1],
            "cores": cores,
            "seconds": seconds,
            "peak_memory": peak,
        }
        for task, seconds, peak in _rows(times, settings)
    ]


def _renders() -> list[Request]:
    kinds = ("plain", "guides")
    lines = [anchor(kind, more=more) for kind in kinds for more in (False, True)]
    modes = (DEFAULT_DENOISING, QUICK_DENOISER)
    return lines + [anchor("plain", 1, mode) for mode in modes]


def _tasks(shot: Shot, settings: Settings) -> dict[str, Task]:
    """Networks alone, without and with a memory limit, and whole frames by each."""
    sweep, networks = settings.sweep, settings.networks
    configs = {in_process_name(xrds(n)): xrds(n) for n in sweep.networks}
    known = tasks.tasks(shot, configs.values(), networks)
    timed = {name: known[name] for name in [PLAIN_FRAME, *configs]}
    for name, config in configs.items():
        timed[_limited(name)] = _limited_network(shot, settings, config.network)
        timed[_frame(name)] = _xrds_frame(shot, settings, config.network)
    return timed


def _limited(name: str) -> str:
    return f"{name}, limit {MEMORY_LIMIT >> 20} MiB"


def _frame(name: str) -> str:
    return f"whole frame, {name}"


def _less_network(name: str) -> str:
    return f"{_frame(name)}, less the network"


def _alone(denoiser: Denoising) -> str:
    return f"OIDN {denoiser} alone"


def _limited_network(shot: Shot, settings: Settings, network: Network) -> Task:
    def task() -> Run:
        low, full = tasks.noise(shot.window, network.scale)
        upscaler = settings.networks[network]
        return clocked(lambda: upscaler(low, full, full, memory_limit=MEMORY_LIMIT))

    return task


def _xrds_frame(shot: Shot, settings: Settings, network: Network) -> Task:
    """A frame with the rays of one full-resolution sample and one guide sample."""
    job = render_request(
        **network._asdict(),
        samples=network.scale**2,
        guide_samples=1,
        device=settings.networks.device,
        weights=settings.networks.weights,
        denoiser=QUICK_DENOISER,
    )

    def task() -> Run:
        picture, run = tasks.frame(shot, job)
        return run | {stage: picture.seconds[stage] for stage in ("network", "guides")}

    return task


def _rows(
    times: StageTimes, settings: Settings
) -> Iterator[tuple[str, float, int | None]]:
    """Task, seconds and peak memory; what failed is left out."""
    if times.count(PLAIN_FRAME):
        yield PLAIN_FRAME, times.median(PLAIN_FRAME), times.peak(PLAIN_FRAME)
    for network in settings.sweep.networks:
        name = in_process_name(xrds(network))
        for task in (name, _limited(name), _frame(name)):
            if times.count(task):
                yield task, times.median(task), times.peak(task)
        if times.count(_frame(name)):
            seconds = times.median(_frame(name)) - times.median(_frame(name), "network")
            yield _less_network(name), seconds, None
    for mode in (DEFAULT_DENOISING, QUICK_DENOISER):
        try:
            seconds = times.denoising(mode)
        except KeyError:
            continue
        yield _alone(mode), seconds, None
    for kind in ("plain", "guides"):
        try:
            yield f"one sample, {kind}", times.line(kind)[1], None
        except KeyError:
            continue


# --- fits -----------------------------------------------------------------------------


def exponents(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Power of the pixels by which each task's seconds and memory grow."""
    fitted = []
    for task, cores in dict.fromkeys((row["task"], row["cores"]) for row in rows):
        mine = [r for r in rows if (r["task"], r["cores"]) == (task, cores)]
        fits = {key: power(mine, key) for key in ("seconds", "peak_memory")}
        if fits["seconds"] is not None:
            fitted.append({"task": task, "cores": cores} | fits)
    return fitted


def power(rows: Sequence[Row], key: str, over: str = "pixels") -> float | None:
    """Slope of the least-squares line through the logarithms; None for one point."""
    known = [(r[over], r[key]) for r in rows if r[key]]
    if len({x for x, _ in known}) < 2:
        return None
    x, y = (np.log([pair[i] for pair in known]) for i in (0, 1))
    return float(np.polyfit(x, y, 1)[0])


def break_even(rows: Sequence[Row], networks: Sequence[Network]) -> list[Row]:
    """Seconds saved by the small render against seconds paid for the network."""
    sizes = dict.fromkeys(tuple(row["size"]) for row in rows)
    known = sorted({row["cores"] for row in rows})
    results = []
    for network, size in product(networks, sizes):
        name = in_process_name(xrds(network))
        here = [row for row in rows if tuple(row["size"]) == size]
        for cores in [*known, *(c for c in MORE_CORES if c > max(known))]:
            balance = _balance(here, name, cores)
            if balance is not None:
                own = {"network": name, "size": list(size), "cores": str(cores)}
                results.append(own | {"extrapolated": cores not in known} | balance)
    return results


def _balance(rows: Sequence[Row], name: str, cores: int) -> Row | None:
    """Seconds saved and paid by one network at one frame size."""
    plain, rest, paid, default, quick = (
        seconds_on(rows, task, cores)
        for task in (
            PLAIN_FRAME,
            _less_network(name),
            name,
            _alone(DEFAULT_DENOISING),
            _alone(QUICK_DENOISER),
        )
    )
    if plain is None or rest is None or paid is None:
        return None
    saved_quick = None
    if default is not None and quick is not None:
        saved_quick = plain - default + quick - rest
    return {"saved": plain - rest, "saved_quick": saved_quick, "paid": paid}


def seconds_on(rows: Sequence[Row], task: str, cores: int) -> float | None:
    """Seconds of a task on so many cores: measured, or as a + b / cores.

    None where it was not measured, or on one count of cores alone.
    """
    known = {row["cores"]: row["seconds"] for row in rows if row["task"] == task}
    if cores in known:
        return float(known[cores])
    if len(known) < 2:
        return None
    few, many = min(known), max(known)
    slope = (known[few] - known[many]) / (1 / few - 1 / many)
    fixed = known[many] - slope / many
    seconds = fixed + slope / cores
    return seconds if math.isfinite(seconds) and seconds > 0 else None
