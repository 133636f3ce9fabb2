"""A shot: every frame is sampled once and lends its samples to its neighbours.

A frame is finished when its last neighbour is there: their noisy samples are moved
along with what they show, and the sum is denoised once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from xrds_core.temporal.moving import Movement
from xrds_core.temporal.window import Shot, slide

from ..frame import progress
from ..frame.denoisers import load_denoiser
from ..frame.job import Picture, RenderJob
from ..frame.rendering import call_engine
from .finishing import finish
from .sampling import Sampled, sample_frame


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
    denoiser = load_denoiser(job)
    todo = tuple(number for number in frames if not is_done(number))
    shot = Shot(todo, job.temporal_radius, lending=tuple(frames))
    movement = Movement()

    def sample(number: int) -> Sampled:
        scene.frame_set(number)
        place = shot.order.index(number)
        return call_engine(scene, lambda *given: _sample(*given, job, place))

    for number, own, lenders in slide(shot, sample):
        if is_done(number):  # another machine was quicker
            continue
        view = next(iter(own.views))
        others = [each.views[view] for each in lenders.values()]
        picture = finish(own.views[view], others, job, denoiser, movement)
        seconds = own.seconds | picture.seconds
        seconds["total"] = sum(seconds.values())
        yield number, replace(picture, seconds=seconds)


def _sample(engine: Any, depsgraph: Any, job: RenderJob, place: int) -> Sampled:
    frame = depsgraph.scene_eval.frame_current
    progress.begin(engine, f"{progress.SAMPLES} of frame {frame}", 1, 2)
    try:
        return sample_frame(engine, depsgraph, job, place)
    finally:
        progress.end()
