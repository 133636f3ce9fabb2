"""A shot: every frame is sampled once and lends its samples to its neighbours.

A frame is finished when its last neighbour is there: their noisy samples are moved
along with what they show, and the sum is denoised once and, above scale 1, enlarged.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from xrds_core.temporal.window import Shot, slide

from ..frame import progress
from ..frame.job import Picture, RenderJob
from ..frame.rendering import call_engine
from ..scene.cuts import cuts
from .method import FullSize, method_of
from .sampling import Sampled


def render_shot(
    scene: Any,
    job: RenderJob,
    frames: Sequence[int],
    is_done: Callable[[int], bool] = lambda _: False,
) -> Iterator[tuple[int, Picture]]:
    """Render frames of a scene, each with its neighbours' samples, in order.

    Frames that `is_done` says are there only lend, and only where a neighbour needs
    them. Yields numbers and pictures, of stereo the first view's; the scene stays at
    the last frame rendered. Raises what `render` raises.
    """
    method = method_of(job)
    todo = tuple(number for number in frames if not is_done(number))
    begun = cuts(scene, sorted(frames))
    shot = Shot(todo, job.temporal_radius, begun, lending=tuple(frames))

    def sample(number: int) -> Sampled:
        scene.frame_set(number)
        place = shot.order.index(number)
        return call_engine(scene, lambda *given: _sample(method, *given, place))

    for number, own, lenders in slide(shot, sample):
        if is_done(number):  # another machine was quicker
            continue
        view = next(iter(own.views))
        picture = method.finish(own, list(lenders.values()), view)
        seconds = own.seconds | picture.seconds
        seconds["total"] = sum(seconds.values())
        yield number, replace(picture, seconds=seconds)


def _sample(method: FullSize, engine: Any, depsgraph: Any, place: int) -> Sampled:
    try:
        return method.sample(engine, depsgraph, place)
    finally:
        progress.end()
