"""Seconds per frame of whole frames: a shot by XRDS beside Cycles + OIDN.

To be run on a quiet machine. The runs of both take turns; each figure is a median.
What finishing takes is timed up to a few samples, and hardly depends on them: frames of
many are finished, on paper, in the seconds of few. What is not timed lies on the line
through the fewest and the most samples that are: Cycles' seconds are linear in them.
"""

from __future__ import annotations

import json
import statistics
import time
from typing import TYPE_CHECKING, Any, TypeVar

from xrds_blender.planning.settings import DEFAULT_DENOISING
from xrds_core.files import write_json

from ..bench.inputs import open_scene
from ..bench.windows import Window
from .frames import MIDDLE
from .methods import DEFAULT, XRDS
from .motions import animate

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from xrds_blender.planning.request import Request
    from xrds_core.accumulation.frame import Stored

    from ..bench.windows import Shot

    Timed = dict[str, dict[str, Any]]

T = TypeVar("T")

_FINISHED = 2  # samples, at most, of frames whose finishing is timed


class SceneSeconds:
    """Seconds by method, samples and radius of one scene, kept in a file.

    Frames are whole, of `resolution` where it is given: half the width and height take
    a quarter of the seconds, whatever the method.
    """

    def __init__(
        self, shot: Shot, directory: Path, resolution: tuple[int, int] | None = None
    ) -> None:
        window = shot.window.whole
        if resolution is not None:
            window = Window(*resolution, 0, 0, *resolution)
        self.shot, self.window = shot, window
        name = f"{shot.identity}-{window.label}-shot-seconds.json"
        self._path = directory / name
        self.known: dict[str, Timed] = {}
        if self._path.is_file():
            self.known = json.loads(self._path.read_text("utf-8"))

    def per_frame(self, method: str, samples: int, radius: int) -> float | None:
        """Seconds of all that the user waits for, per frame; None if nothing tells."""
        return per_frame(self.known, method, samples, radius)

    def measure(self, samples: int, radii: Sequence[int], rounds: int) -> None:
        """Time what is missing: a frame's samples, finishing it, and the rival."""
        known = self.known.setdefault(str(samples), {})
        left = [r for r in radii if _name(XRDS, r) not in known]
        if not left and _name(DEFAULT, 0) in known:
            return
        few = {}
        if samples > _FINISHED:
            self.measure(_FINISHED, radii, rounds)
            few = self.known[str(_FINISHED)]
        known |= timed(self.shot.path, self.window, samples, left, rounds, few)
        write_json(self._path, self.known)


def per_frame(
    known: Mapping[str, Timed], method: str, samples: int, radius: int
) -> float | None:
    """Seconds of a frame, on the line through the least and the most `known` samples.

    None if nothing tells.
    """
    name = _name(method, radius)
    seconds = {int(n): x[name]["total"] for n, x in known.items() if name in x}
    if samples in seconds or len(seconds) < 2:
        return seconds.get(samples)
    few, many = min(seconds), max(seconds)
    slope = (seconds[many] - seconds[few]) / (many - few)
    return float(seconds[few] + max(slope, 0.0) * (samples - few))


def timed(
    path: Path,
    window: Window,
    samples: int,
    radii: Sequence[int],
    rounds: int,
    few: Timed,
) -> Timed:
    """Time a panning shot: seconds of a frame by stage, `total` and `cpu`.

    Finishing is taken from `few`, the figures of fewer samples, where there are any.
    """
    from xrds_blender import render
    from xrds_blender.planning.request import render_request

    reach = max(*radii, rounds // 2, 1)
    scene = open_scene(path, window)
    animate(scene, window, "pan", MIDDLE, reach)
    job = render_request(scale=1, samples=samples, temporal_radius=reach)
    plain = {"plain": True, "samples": samples, "denoiser": DEFAULT_DENOISING}
    sampled: dict[int, Stored] = {}
    ours, rival = [], []
    for number in range(MIDDLE - reach, MIDDLE + reach + 1):
        is_timed = abs(number - MIDDLE) <= rounds // 2
        if few and not is_timed:
            continue
        scene.frame_set(number)
        sampled[number], clock = _clocked(lambda: _sample(scene, job))
        ours.append(clock)
        if is_timed:
            rival.append(_clocked(lambda: render(scene, **plain))[1])
    result = {_name(DEFAULT, 0): _median(rival)}
    for radius in radii:
        if few:
            finished = few[_name(XRDS, radius)]["finish"]
        else:
            finished = _finished(
                sampled, job.with_settings(temporal_radius=radius), rounds
            )
        taken = _median(ours)
        both = {name: taken[name] + finished[name] for name in ("total", "cpu")}
        result[_name(XRDS, radius)] = {**both, "sample": taken, "finish": finished}
    return result


def _sample(scene: Any, job: Request) -> Stored:
    """One frame's samples, packed as a shot keeps them."""
    from xrds_blender.rendering.blender_job import call_engine
    from xrds_blender.rendering.sampling import sample_frame

    made = call_engine(scene, lambda *given: sample_frame(*given, job))
    return next(iter(made.views.values()))


def _finished(
    sampled: Mapping[int, Stored], job: Request, rounds: int
) -> dict[str, float]:
    """Seconds of the middle frame's accumulation and denoising."""
    from xrds_blender.rendering.full_size import FullSize
    from xrds_core.shot import Shot as Window

    numbers = Window(tuple(sampled), job.settings.temporal_radius).neighbours(MIDDLE)
    own, lenders = sampled[MIDDLE], [sampled[number] for number in numbers]
    method, runs = FullSize(job), []
    for _ in range(rounds):
        picture, clock = _clocked(lambda: method.finish_stored(own, lenders))
        runs.append({**picture.seconds, **clock})
    return _median(runs)


def _clocked(work: Callable[[], T]) -> tuple[T, dict[str, float]]:
    wall, cpu = time.perf_counter(), time.process_time()
    result = work()
    clock = {"total": time.perf_counter() - wall, "cpu": time.process_time() - cpu}
    return result, clock


def _median(runs: Sequence[dict[str, float]]) -> dict[str, float]:
    return {name: statistics.median(run[name] for run in runs) for name in runs[0]}


def _name(method: str, radius: int) -> str:
    return f"{method}-{radius}"
