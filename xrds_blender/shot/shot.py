"""A shot from outside of Blender's own animation render: one Blender job per frame.

A frame is finished when its last neighbour is there: their noisy samples are moved
along with what they show, and the sum is denoised once and, above scale 1, enlarged.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from xrds_core.temporal.window import Shot, Window, place_of

from ..frame import progress
from ..frame.job import Picture, RenderJob
from ..frame.rendering import call_engine
from ..scene.cuts import cuts
from .cache import SampleCache
from .choosing import ChosenJob, choose_for_shot
from .methods import Method
from .render import method_of
from .sampling import Sampled


def render_shot(
    scene: Any,
    job: RenderJob,
    frames: Sequence[int],
    is_done: Callable[[int], bool] = lambda _: False,
    cache: SampleCache | None = None,
) -> Iterator[tuple[int, Picture]]:
    """Render frames of a scene, each with its neighbours' samples, in order.

    Frames that `is_done` says are there are neighbours alone, and only where they are
    needed. A `cache` keeps the samples of every frame rendered; what it has already is
    not rendered again, and may lie beyond the ends of these frames. Yields numbers and
    pictures, of stereo the first view's; the scene stays at the last frame rendered.
    What the job leaves open is chosen at the first frame to render. Raises what
    `render` raises.
    """
    todo = tuple(number for number in frames if not is_done(number))
    chosen = _chosen(scene, job, todo)
    job = chosen.job
    method = method_of(chosen, cache and cache.write)
    cached = cache.beside(frames, job.temporal_radius) if cache else []
    there = tuple(sorted({*frames, *cached}))
    shot = Shot(todo, job.temporal_radius, cuts(scene, there), others=there)

    def load(number: int) -> Sampled | None:
        if cache and (found := cache.read(number)):
            return found
        if number not in frames:
            return None
        return _sample(scene, method, frames, number, shot.is_between(number))

    for found in Window(shot, load):
        number, own = found.number, found.own
        if is_done(number):  # another machine was quicker
            continue
        view, others = next(iter(own.views)), list(found.neighbours.values())
        if method.lacks(own, others):
            own = _sample(scene, method, frames, number)
        picture = method.finish(own, others, view)
        seconds = dict.fromkeys(progress.STAGES, 0.0) | own.seconds | picture.seconds
        seconds["total"] = sum(seconds.values())
        yield number, chosen.told(replace(picture, seconds=seconds))


def _chosen(scene: Any, job: RenderJob, todo: Sequence[int]) -> ChosenJob:
    if not (job.is_picked and todo):
        return ChosenJob(job)
    scene.frame_set(todo[0])
    return call_engine(scene, lambda *given: choose_for_shot(*given, job))


def cache_samples(
    scene: Any, job: RenderJob, frames: Sequence[int], cache: SampleCache
) -> Iterator[int]:
    """Render the samples of frames that are not cached yet; yields their numbers.

    Raises what `render` raises.
    """
    method = method_of(ChosenJob(job), cache.write)
    for number in frames:
        if cache.read(number) is None:
            _sample(scene, method, frames, number)
            yield number


def _sample(
    scene: Any,
    method: Method,
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
