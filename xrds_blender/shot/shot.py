"""A shot: every frame is sampled once and lends its samples to its neighbours.

A frame is finished when its last neighbour is there: their noisy samples are moved
along with what they show, and the sum is denoised once and, above scale 1, enlarged.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from xrds_core.temporal.window import Shot, place_of, slide

from ..frame import progress
from ..frame.job import Picture, RenderJob
from ..frame.rendering import call_engine
from ..scene.cuts import cuts
from .choosing import ShotJob, choose_for_shot
from .keeping import Keeper
from .method import FullSize, method_of
from .sampling import Sampled


def render_shot(
    scene: Any,
    job: RenderJob,
    frames: Sequence[int],
    is_done: Callable[[int], bool] = lambda _: False,
    keeper: Keeper | None = None,
) -> Iterator[tuple[int, Picture]]:
    """Render frames of a scene, each with its neighbours' samples, in order.

    Frames that `is_done` says are there only lend, and only where a neighbour needs
    them. A `keeper` keeps the samples of every frame rendered; what it has already is
    not rendered again, and lends to these frames from beyond their ends, too. Yields
    numbers and pictures, of stereo the first view's; the scene stays at the last frame
    rendered. What the job leaves open is chosen at the first frame to render. Raises
    what `render` raises.
    """
    todo = tuple(number for number in frames if not is_done(number))
    chosen = _chosen(scene, job, todo)
    job = chosen.job
    method = method_of(job, keeper and keeper.write)
    beside = keeper.beside(frames, job.temporal_radius) if keeper else []
    lending = sorted({*frames, *beside})
    shot = Shot(todo, job.temporal_radius, cuts(scene, lending), lending=tuple(lending))

    def load(number: int) -> Sampled | None:
        if keeper and (kept := keeper.read(number)):
            return kept
        if number not in frames:
            return None
        return _sample(scene, method, frames, number, shot.is_between(number))

    for number, own, lenders in slide(shot, load):
        if is_done(number):  # another machine was quicker
            continue
        view, others = next(iter(own.views)), list(lenders.values())
        if method.lacks(own, others):
            own = _sample(scene, method, frames, number)  # noqa: PLW2901
        picture = method.finish(own, others, view)
        seconds = own.seconds | picture.seconds
        seconds["total"] = sum(seconds.values())
        yield number, chosen.told(replace(picture, seconds=seconds))


def _chosen(scene: Any, job: RenderJob, todo: Sequence[int]) -> ShotJob:
    if not (job.is_picked and todo):
        return ShotJob(job)
    scene.frame_set(todo[0])
    return call_engine(scene, lambda *given: choose_for_shot(*given, job))


def keep_shot(
    scene: Any, job: RenderJob, frames: Sequence[int], keeper: Keeper
) -> Iterator[int]:
    """Render the samples of frames that are not kept yet; yields their numbers.

    Raises what `render` raises.
    """
    method = method_of(job, keeper.write)
    for number in frames:
        if keeper.read(number) is None:
            _sample(scene, method, frames, number)
            yield number


def _sample(
    scene: Any,
    method: FullSize,
    frames: Sequence[int],
    number: int,
    between: bool = False,
) -> Sampled:
    """Sample a frame of a shot, the same way whatever part of the shot `frames` are."""
    scene.frame_set(number)
    place = place_of(number, frames)

    def work(engine: Any, depsgraph: Any) -> Sampled:
        try:
            return method.sample(engine, depsgraph, place, between)
        finally:
            progress.end()

    return call_engine(scene, work)
