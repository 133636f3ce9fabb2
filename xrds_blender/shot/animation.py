"""Blender's own animation renders: the engine samples the frames ahead by itself.

Blender asks for one frame after the other. Inside the render of a frame its neighbours
are evaluated and sampled too, those ahead as well; each is kept until its last
neighbour is finished, and none is sampled twice. What is kept lasts for one render job,
so that no edit of the file comes between.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from xrds_core.arrays import Array
from xrds_core.temporal.moving import Movement

from ..cycles import session
from ..cycles.passes import CyclesPasses
from ..frame import history, progress
from ..frame.denoisers import load_denoiser
from ..frame.job import Picture, RenderJob
from ..frame.layer import render_layer
from .finishing import finish
from .sampling import Sampled, can_lend, sample_frame


@dataclass
class _Window:
    """The frames of one view layer that are kept, by number.

    `passes` are Cycles' own of frames that were sampled before their turn.
    """

    job: RenderJob
    sampled: dict[int, Sampled] = field(default_factory=dict)
    passes: dict[int, dict[tuple[str, str], Array]] = field(default_factory=dict)
    movement: Movement = field(default_factory=Movement)

    def forget_before(self, number: int) -> None:
        for kept in (self.sampled, self.passes):
            for old in [n for n in kept if n < number]:
                del kept[old]


_windows: dict[tuple[str, str], _Window] = {}


def forget(*_: Any) -> None:
    """For Blender's handlers: a render job begins or ends."""
    _windows.clear()


def render_frame(engine: Any, depsgraph: Any, job: RenderJob) -> Picture:
    """Render what Blender asks for: a frame by itself, or one of an animation.

    As `render_layer`; in an animation at scale 1 with the samples of its neighbours.
    """
    if not _has_neighbours(engine, depsgraph, job):
        return render_layer(engine, depsgraph, job)
    place = history.place_of(depsgraph)
    try:
        picture = _render_among_neighbours(engine, depsgraph, job)
    finally:
        progress.end()
    history.keep(place, job, picture)
    return picture


def _has_neighbours(engine: Any, depsgraph: Any, job: RenderJob) -> bool:
    if job.plain or job.is_picked or job.scale > 1 or not job.temporal_radius:
        return False
    is_animation = engine.is_animation and not _renders_single_frames()
    return is_animation and can_lend(depsgraph.scene_eval)


def _renders_single_frames() -> bool:
    """Whether Blender was started for frames by number.

    Each is a render job of its own then, which could keep nothing for the next.
    """
    import bpy

    return bpy.app.background and bool({"-f", "--render-frame"} & set(sys.argv))


def _render_among_neighbours(engine: Any, depsgraph: Any, job: RenderJob) -> Picture:
    """Render the frame into the engine's result and return the first view's picture.

    Every pass but Combined is Cycles' own. Raises Cancelled when the user stops it.
    """
    started = time.perf_counter()
    denoiser = load_denoiser(job)
    scene, layer_name = depsgraph.scene_eval, depsgraph.view_layer_eval.name
    number, needed = scene.frame_current, _needed(scene, job)
    window = _windows.get((scene.name, layer_name))
    if window is None or window.job != job:
        window = _windows[scene.name, layer_name] = _Window(job)
    window.forget_before(needed[0])
    _sample_missing(engine, depsgraph, window, number, needed)

    report = progress.reporter(engine)
    progress.begin(engine, progress.DENOISE, 2, 2)
    own = window.sampled[number]
    lenders = [window.sampled[n] for n in needed if n != number]
    pictures = {
        view: finish(
            stored,
            [each.views[view] for each in lenders],
            job,
            denoiser,
            window.movement,
            report,
        )
        for view, stored in own.views.items()
    }
    combined = {v: np.dstack((p.radiance, p.alpha)) for v, p in pictures.items()}
    session.write_combined(engine, layer_name, combined)
    first = next(iter(pictures.values()))
    first.seconds.update({**own.seconds, **first.seconds})
    first.seconds["total"] = time.perf_counter() - started
    return first


def _needed(scene: Any, job: RenderJob) -> list[int]:
    """Numbers of the frame and of its neighbours inside the animation, in order."""
    step, radius = scene.frame_step, job.temporal_radius
    around = range(-radius * step, radius * step + 1, step)
    numbers = [scene.frame_current + offset for offset in around]
    return [
        n
        for n in numbers
        if n == scene.frame_current or scene.frame_start <= n <= scene.frame_end
    ]


def _sample_missing(
    engine: Any, depsgraph: Any, window: _Window, number: int, needed: list[int]
) -> None:
    """Sample what is not kept; the result then holds the passes of frame `number`."""
    missing = [n for n in needed if n not in window.sampled and n != number]
    own_is_missing = number not in window.sampled
    if not missing and not own_is_missing:
        session.allocate(engine)
        with CyclesPasses(engine, depsgraph) as passes:
            passes.put_back(window.passes.pop(number))
        return
    with CyclesPasses(engine, depsgraph) as passes:
        try:
            for ahead in missing:
                engine.frame_set(ahead, 0.0)
                progress.begin(engine, f"{progress.SAMPLES} of frame {ahead}", 1, 2)
                window.sampled[ahead] = sample_frame(engine, depsgraph, window.job)
                if ahead > number:
                    window.passes[ahead] = passes.all_passes()
        finally:
            if missing:
                engine.frame_set(number, 0.0)
        if own_is_missing:
            progress.begin(engine, f"{progress.SAMPLES} of frame {number}", 1, 2)
            window.sampled[number] = sample_frame(engine, depsgraph, window.job)
        else:
            passes.put_back(window.passes.pop(number))
