"""The one path from a scene to a picture; every button and command ends here.

A still is a frame without neighbours; a frame of an animation has those of its shot.
Both are sampled and finished by the same method, and written by the same lines.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import takewhile
from typing import Any

import numpy as np

from xrds_core.arrays import Array
from xrds_core.errors import Cancelled

from ..cycles import session
from ..frame import history, progress, torch_folder
from ..frame.job import NetworkFailed, Picture, RenderJob
from ..frame.rendering import call_engine
from ..internals.lifetimes import RENDER_JOB
from .choosing import ChosenJob, choose_for_shot, chosen
from .cycles_only import CyclesOnly
from .engine_frames import EngineFrames
from .full_size import FullSize
from .methods import Method
from .sampling import Keep, Sampled, has_neighbours
from .super_resolution import SuperResolution


@dataclass(frozen=True)
class _Animation:
    """A view layer's frames in one render job; `asked` is what `chosen` came from."""

    asked: RenderJob
    chosen: ChosenJob
    frames: EngineFrames


@dataclass
class Animations:
    """Those of one render job, by scene and view layer: no edit comes between."""

    by_layer: dict[tuple[str, str], _Animation] = field(default_factory=dict)


def method_of(chosen: ChosenJob, keep: Keep | None = None) -> Method:
    """What makes pictures of a job; `keep` as in `FullSize`.

    Raises XRDSError where its parts cannot be loaded.
    """
    job = chosen.job
    if job.plain:
        return CyclesOnly(job)
    if job.scale == 1:
        return FullSize(job, keep, chosen.denoise_in_time)
    return SuperResolution(job)


def render(
    scene: Any, scale: int = 2, *, layer: str | None = None, **choices: Any
) -> Picture:
    """As `xrds_blender.render`; the engine must be registered."""
    job, start = RenderJob(scale=scale, **choices), time.perf_counter()

    def work(engine: Any, depsgraph: Any) -> Picture:
        return render_alone(engine, depsgraph, job, start)

    return call_engine(scene, work, layer)


def render_frame(engine: Any, depsgraph: Any, job: RenderJob) -> Picture:
    """Render what Blender asks for: a frame by itself, or one of an animation.

    As `render_alone`; in an animation with the samples of its neighbours.
    """
    if engine.is_animation:
        scene = depsgraph.scene_eval
        left = (scene.frame_end - scene.frame_current) // scene.frame_step
        progress.begin_frame(scene.frame_current, left)
        if not _renders_single_frames() and has_neighbours(scene, job):
            return _render_in_animation(engine, depsgraph, job)
    return render_alone(engine, depsgraph, job)


def render_alone(
    engine: Any, depsgraph: Any, job: RenderJob, start: float | None = None
) -> Picture:
    """Render the layer into the engine's result; the picture is of its first view.

    `start`, a reading of perf_counter, is where a time budget and the total begin.
    Raises Cancelled when the user stops it and XRDSError where it cannot be done, then
    with nothing written; but NetworkFailed, as for too little memory, with the
    low-resolution picture in the result, enlarged.
    """
    start = time.perf_counter() if start is None else start
    alone, place = replace(job, temporal_radius=0), history.place_of(depsgraph)
    layer_name = depsgraph.view_layer_eval.name  # Cycles may free it as it renders
    try:
        with chosen(engine, depsgraph, alone, start) as found:
            if found.job.is_enlarged and torch_folder.loaded() is None:
                progress.begin(engine, progress.LOADING, 0)  # which takes some seconds
            method = method_of(found)  # first: missing weights are to cost no render
            own = method.sample(engine, depsgraph)
            picture = _finish(engine, layer_name, method, own)
    finally:
        progress.end()
    return _told(found, picture, job, place, start)


def _render_in_animation(engine: Any, depsgraph: Any, job: RenderJob) -> Picture:
    """Render the frame with its neighbours; every pass but Combined is Cycles' own."""
    start, place = time.perf_counter(), history.place_of(depsgraph)
    key = depsgraph.scene_eval.name, depsgraph.view_layer_eval.name
    number = depsgraph.scene_eval.frame_current
    try:
        animations = RENDER_JOB.of(Animations).by_layer
        animation = animations.get(key)
        if animation is None or animation.asked != job:
            choice = choose_for_shot(engine, depsgraph, job)
            frames = EngineFrames.of(depsgraph.scene_eval, method_of(choice))
            animation = animations[key] = _Animation(job, choice, frames)
        frames = animation.frames
        try:
            found = frames.neighbourhood(engine, depsgraph)
        except Cancelled:
            own = frames.window.get(number)
            if own is not None:  # else its samples so far are in the result already
                _leave_stopped(engine, key[1], frames.method, own)
            raise
        others = list(found.neighbours.values())
        picture = _finish(engine, key[1], frames.method, found.own, others)
    finally:
        progress.end()
    return _told(animation.chosen, picture, job, place, start)


def _told(
    choice: ChosenJob,
    picture: Picture,
    job: RenderJob,
    place: history.Place,
    start: float,
) -> Picture:
    """The picture with what it was rendered by and how long; it is remembered."""
    picture = choice.told(picture)
    picture.seconds["total"] = time.perf_counter() - start
    history.keep(place, picture.job or job, picture)
    return picture


def _finish(
    engine: Any,
    layer_name: str,
    method: Method,
    own: Sampled,
    others: Sequence[Sampled] = (),
) -> Picture:
    """Make the picture of each view and write it; returns the first view's."""
    try:
        report = method.begin_finishing(engine)
        pictures = {v: method.finish(own, others, v, report) for v in own.views}
        session.stop_if_cancelled(engine)
    except NetworkFailed:
        _write(engine, layer_name, method, own, method.stopped(own))
        raise
    except Cancelled:
        _leave_stopped(engine, layer_name, method, own)
        raise
    started = time.perf_counter()
    combined = {v: np.dstack((p.radiance, p.alpha)) for v, p in pictures.items()}
    _write(engine, layer_name, method, own, combined)
    seconds = dict.fromkeys(progress.STAGES, 0.0) | own.seconds
    for stage in {stage for p in pictures.values() for stage in p.seconds}:
        seconds[stage] += sum(p.seconds.get(stage, 0.0) for p in pictures.values())
    seconds["write"] = time.perf_counter() - started
    return replace(next(iter(pictures.values())), seconds=seconds)


def _leave_stopped(engine: Any, layer_name: str, method: Method, own: Sampled) -> None:
    """Leave what there is of a frame that was stopped, if the job asks for it."""
    if method.job.stop_keeps:
        _write(engine, layer_name, method, own, method.stopped(own))


def _write(
    engine: Any,
    layer_name: str,
    method: Method,
    own: Sampled,
    pictures: dict[str, Array],
) -> None:
    """Write the pictures (H, W, 4) and the light passes of each view."""
    layer = engine.get_result().layers[layer_name]
    for view in own.views:
        for name, light in method.light_passes(own, view).items():
            session.write_pass(layer, name, view, light)
    session.write_combined(engine, layer_name, pictures)


def _renders_single_frames() -> bool:
    """Whether Blender was started for frames by number alone.

    Each is a render job of its own then, which could keep nothing for the next. What
    stands after -- is a script's, as is everything where Blender is a module.
    """
    if not _is_program_without_window():
        return False
    words = set(takewhile(lambda word: word != "--", sys.argv))
    animates = {"-a", "--render-anim"} & words
    return bool({"-f", "--render-frame"} & words) and not animates


def _is_program_without_window() -> bool:
    """Whether this is Blender in the background, not its Python module."""
    import bpy

    return bpy.app.background and bool(bpy.app.binary_path)
