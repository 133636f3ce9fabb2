"""One shot on a card and on the processor: seconds by stage, pictures, memory."""

from __future__ import annotations

import statistics
import time
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar
from unittest.mock import patch

import numpy as np

from xrds_blender.planning.settings import DEFAULT_DENOISING

from .. import metrics
from ..bench import machine
from ..gallery.judge import compare
from .cycles import memory_in_use, render_on

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from xrds_core.accumulation.frame import Stored
    from xrds_core.arrays import Array

    Row = dict[str, Any]

T = TypeVar("T")

CPU = "cpu"
REACH = 4
_FRAMES = range(1, 10)
_REFERENCE_SEEDS = (2_000_003, 2_000_029)  # no noisy frame's is near


@dataclass(frozen=True)
class Case:
    """A shot of the gallery at a size and some samples per pixel.

    Stages are timed where it `is_timed`: what follows sampling takes as long whatever
    the samples. `cycles` is the kind of Cycles' card, or CPU.
    """

    shot: str
    size: tuple[int, int]
    samples: int
    radii: tuple[int, ...]
    is_timed: bool
    cycles: str
    reference_samples: int = 512
    rounds: int = 3

    @property
    def label(self) -> str:
        """Name in files and lines."""
        width, height = self.size
        return f"{self.shot}-{width}x{height}-{self.samples}spp"


def measure(case: Case, folder: Path) -> Iterator[Row]:
    """Yield the rows of a case, one of each method.

    Raises SceneError if it does not render.
    """
    from xrds_blender.interface.registration import ensure_registered

    from ..gallery.table import SHOTS

    ensure_registered()
    shot = SHOTS[case.shot]
    scene, middle = shot.build(folder, case.size), shot.judged[0]
    about = {
        "shot": case.shot,
        "size": list(case.size),
        "samples": case.samples,
        "cycles_device": render_on(scene, case.cycles),
    }
    scene.render.use_persistent_data = True
    scene.cycles.samples = case.samples
    machine.forget_peak()
    truth, rivals = _references(scene, case, middle), _cycles(scene, case, middle)
    alone = rivals["cycles_oidn"]["radiance"]

    def judged(method: str, radius: int, row: Row) -> Row:
        found = _judged(row, alone, truth)
        peaks = {"peak_memory": machine.peak(), "card_memory": memory_in_use()}
        return {**about, "method": method, "radius": radius, **found, **peaks}

    for name, row in rivals.items():
        yield judged(name, 0, {**row})
    sampled, seconds = _sample(scene, case, shot.frames)
    own = sampled.pop(middle)
    lenders = sorted(sampled.values(), key=lambda x: abs(x.number - middle))
    for radius in (0, *case.radii):
        row = _ours(case, own, lenders[: 2 * radius])
        yield judged("xrds", radius, {"sample": seconds, **row})
    if case.is_timed:
        yield judged("shot", REACH, _whole_shot(scene, case))


def _sample(
    scene: Any, case: Case, numbers: Sequence[int]
) -> tuple[dict[int, Stored], float]:
    """The frames' samples, and the median of their seconds."""
    from xrds_blender.planning.request import render_request
    from xrds_blender.rendering.blender_job import call_engine
    from xrds_blender.rendering.sampling import sample_frame

    job = render_request(scale=1, samples=case.samples, temporal_radius=REACH)
    found, seconds = {}, []
    for place, number in enumerate(numbers):
        scene.frame_set(number)

        def sample(*given: Any, place: int = place) -> Any:
            return sample_frame(*given, job, place)

        made, taken = _clocked(call_engine, scene, sample)
        found[number] = next(iter(made.views.values()))
        seconds.append(taken)
    return found, statistics.median(seconds)


def _references(scene: Any, case: Case, number: int) -> list[Array]:
    from xrds_blender.planning.request import render_request
    from xrds_blender.rendering.blender_job import call_engine
    from xrds_blender.rendering.sampling import sample_frame

    scene.frame_set(number)
    job = render_request(scale=1, samples=case.reference_samples)
    found = []
    for seed in _REFERENCE_SEEDS:
        one = replace(job, seed=seed)
        made = call_engine(scene, lambda *given, one=one: sample_frame(*given, one))
        found.append(next(iter(made.views.values())).picture[..., :3])
    return found


def _cycles(scene: Any, case: Case, number: int) -> dict[str, Row]:
    """Cycles and its denoiser: on its card, and denoised on the processor."""
    from xrds_blender import render

    scene.frame_set(number)
    work = partial(render, plain=True, samples=case.samples, denoiser=DEFAULT_DENOISING)
    found = {}
    for name, on_card in (("cycles_oidn", True), ("cycles_oidn_cpu", False)):
        scene.cycles.denoising_use_gpu = on_card and case.cycles != "CPU"
        runs = []
        for _ in range(case.rounds + 1):
            picture, taken = _clocked(work, scene)
            runs.append(taken)
        # the first has loaded the denoiser
        found[name] = {
            "radiance": np.asarray(picture.radiance, np.float32),
            "total": statistics.median(runs[1:]),
        }
    return found


def _ours(case: Case, own: Stored, lenders: Sequence[Stored]) -> Row:
    """A frame denoised on the processor and on the card; radiance of the latter.

    The processor accumulates it both times.
    """
    ways = {"cpu": CPU, "card": "auto"}
    finish = {way: _finishing(case, device) for way, device in ways.items()}
    row: Row = {}
    pictures: dict[str, Array] = {}
    for way in ways:
        picture, row[f"{way}_first"] = _clocked(finish[way], own, lenders)
        pictures[way] = np.asarray(picture.radiance)
        row[f"{way}_denoised_on"] = picture.device
    runs: dict[str, list[dict[str, float]]] = {way: [] for way in ways}
    for _ in range(case.rounds if case.is_timed else 0):
        for way in ways:
            # as in a shot: one neighbour is new, the others are known
            fresh = [*lenders[:-1], *map(replace, lenders[-1:])]
            picture, taken = _clocked(finish[way], own, fresh)
            runs[way].append({"total": taken, **picture.seconds})
    row |= {
        f"{way}_{stage}": statistics.median(run[stage] for run in found)
        for way, found in runs.items()
        if found
        for stage in ("total", "denoise")
    }
    if case.is_timed:
        every = [run["accumulate"] for found in runs.values() for run in found]
        row["accumulate"] = statistics.median(every)
    apart = np.abs(pictures["cpu"] - pictures["card"]).max(axis=-1)
    apart /= max(float(pictures["cpu"].mean()), 1e-9)
    return row | {
        "radiance": pictures["card"],
        "pixels_apart": float((apart > 1e-3).mean()),
        "most_apart": float(apart.max()),
    }


def _whole_shot(scene: Any, case: Case) -> Row:
    """Seconds per frame of the whole shot, finished beside sampling and in turn."""
    from xrds_blender.planning.request import render_request
    from xrds_blender.rendering import shot

    job = render_request(scale=1, samples=case.samples, temporal_radius=REACH)
    found = {}
    for name, is_on in (("in_turn", False), ("overlapped", case.cycles != "CPU")):
        with patch.object(shot, "samples_on_card", lambda _, is_on=is_on: is_on):
            pictures, taken = _clocked(list, shot.render_shot(scene, job, _FRAMES))
        found[name] = taken / len(pictures)
        radiance = np.asarray(pictures[len(pictures) // 2][1].radiance)
    return {"radiance": radiance, **found}


def _finishing(case: Case, device: str) -> Callable[..., Any]:
    from xrds_blender.planning.request import render_request
    from xrds_blender.rendering.full_size import FullSize

    job = render_request(
        scale=1, samples=case.samples, temporal_radius=REACH, device=device
    )
    return FullSize(job).finish_stored


def _judged(row: Row, alone: Array, truth: Sequence[Array]) -> Row:
    shown, single, *references = (
        metrics.to_srgb(np.maximum(x[..., :3], 0.0))
        for x in (row.pop("radiance"), alone, *truth)
    )
    verdict = compare(shown, single, references)
    return {name: _rounded(x) for name, x in row.items()} | {
        "psnr": round(verdict.psnr, 3),
        "gain": round(verdict.gain, 3),
        "worst_block": round(verdict.worst, 2),
        "share_of_blocks": round(verdict.share, 4),
    }


def _rounded(value: Any) -> Any:
    return round(value, 5) if isinstance(value, float) else value


def _clocked(work: Callable[..., T], *given: Any) -> tuple[T, float]:
    started = time.perf_counter()
    result = work(*given)
    return result, time.perf_counter() - started
