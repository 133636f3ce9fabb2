"""The one path from a scene to a picture; every button and command ends here.

A still is a frame without neighbours; a frame of an animation has those of its shot.
Both are sampled and finished by the same method, and written by the same lines.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import takewhile
from typing import Any

from xrds_core.arrays import Array
from xrds_core.errors import Cancelled
from xrds_core.overlap import Overlap

from ..cycles import session
from ..cycles.session import samples_on_card
from ..internals.lifetimes import RENDER_JOB
from ..planning.plan import SAME_PICTURE
from ..planning.request import Request, render_request
from ..scene.contents import frame_range
from . import history, stages, torch_folder
from .blender_job import call_engine
from .engine_frames import EngineFrames, layers_of
from .full_size import FullSize
from .methods import CyclesOnly, Method, Report
from .picture import NetworkFailed, Picture, joined
from .sampling import OnSampled, Sampled, has_neighbours
from .super_resolution import SuperResolution
from .time_budget import Timed, in_time


@dataclass(frozen=True)
class _Animation:
    """A view layer's frames in one render job, and the request that they are for."""

    request: Request
    frames: EngineFrames


@dataclass
class Animations:
    """Those of one render job, by scene and view layer: no edit comes between."""

    by_layer: dict[tuple[str, str], _Animation] = field(default_factory=dict)


@dataclass
class _Alone:
    """View layers of one render job whose frames are rendered by themselves."""

    layers: set[str] = field(default_factory=set)


def method_of(
    request: Request,
    on_sampled: OnSampled | None = None,
    timed: Timed | None = None,
) -> Method:
    """What makes pictures of a job; `on_sampled` and `timed` as in `FullSize`.

    Raises XRDSError where its parts cannot be loaded.
    """
    if request.settings.is_cycles_only:
        return CyclesOnly(request)
    if not request.settings.is_enlarged:
        return FullSize(request, on_sampled, timed)
    return SuperResolution(request)


def render(
    scene: Any, scale: int = 1, *, layer: str | None = None, **choices: Any
) -> Picture:
    """As `xrds_blender.render`; the engine must be registered."""
    return render_scene(scene, render_request(scale, **choices), layer)


def render_scene(scene: Any, request: Request, layer: str | None = None) -> Picture:
    """Render the scene's current frame, one layer of it, by itself."""
    start = time.perf_counter()

    def work(engine: Any, depsgraph: Any) -> Picture:
        return render_alone(engine, depsgraph, request, start)

    return call_engine(scene, work, layer)


def render_frame(engine: Any, depsgraph: Any, request: Request) -> Picture:
    """Render what Blender asks for: a frame by itself, or one of an animation.

    As `render_alone`; in an animation with the samples of its neighbours.
    """
    if not engine.is_animation or _renders_single_frames():
        return render_alone(engine, depsgraph, request)
    scene = depsgraph.scene_eval
    stages.begin_frame(scene.frame_current, scene.frame_end)
    try:
        if has_neighbours(scene, request):
            return _render_in_animation(engine, depsgraph, request)
        if request.deadline is not None:
            alone = request.with_settings(temporal_radius=0)
            return _render_in_animation(engine, depsgraph, alone)
        layers = RENDER_JOB.of(_Alone).layers
        layer = depsgraph.view_layer_eval.name
        if layer not in layers:
            layers.add(layer)
            stages.begin_animation(0, len(frame_range(scene)))
        return render_alone(engine, depsgraph, request)
    finally:
        stages.end_frame()


def render_alone(
    engine: Any, depsgraph: Any, request: Request, start: float | None = None
) -> Picture:
    """Render the layer into the engine's result; the picture is of its first view.

    `start`, a reading of perf_counter, is where a time budget and the total begin.
    Raises Cancelled when the user stops it and XRDSError where it cannot be done, then
    with nothing written; but NetworkFailed, as for too little memory, with the
    low-resolution picture in the result, enlarged.
    """
    start = time.perf_counter() if start is None else start
    layer = history.layer_of(depsgraph)
    alone = request.with_settings(temporal_radius=0)
    try:
        with in_time(engine, depsgraph, alone, start) as timed:
            if alone.settings.is_enlarged and torch_folder.loaded() is None:
                stages.begin(engine, stages.LOADING, 0)  # which takes some seconds
            # first: missing weights are to cost no render
            loading = time.perf_counter()
            method = method_of(timed.request, timed=timed)
            loading = time.perf_counter() - loading
            own = method.sample(engine, depsgraph)
            picture = _finish(engine, layer.name, method, own)
            picture.seconds["load"] = loading
    finally:
        stages.end()
    return _remembered(picture, layer, start)


def _render_in_animation(engine: Any, depsgraph: Any, request: Request) -> Picture:
    """Render the frame with its neighbours; every pass but Combined is Cycles' own."""
    start, layer = time.perf_counter(), history.layer_of(depsgraph)
    key = layer.scene, layer.name
    number = depsgraph.scene_eval.frame_current
    try:
        animations = RENDER_JOB.of(Animations).by_layer
        animation = animations.get(key)
        if animation is None or animation.request != request:
            same = (a for k, a in animations.items() if k[0] == key[0])
            beside = next((a.frames.method for a in same if a.request == request), None)
            scene, layers = depsgraph.scene_eval, layers_of(depsgraph.scene_eval)
            timed = request.in_shot(layers * len(frame_range(scene)))
            frames = EngineFrames.of(scene, method_of(timed), beside)
            animation = animations[key] = _Animation(request, frames)
        frames = animation.frames
        try:
            frame = frames.neighbourhood(engine, depsgraph)
        except Cancelled:
            own = frames.window.get(number)
            if own is not None:  # else its samples so far are in the result already
                _leave_stopped(engine, key[1], frames.method, own)
            raise
        others = list(frame.neighbours.values())
        ahead = None
        if samples_on_card(depsgraph.scene_eval):
            ahead = partial(frames.sample_next, engine, depsgraph)
        picture = _finish(engine, key[1], frames.method, frame.own, others, ahead)
    finally:
        stages.end()
    return _remembered(picture, layer, start)


def _remembered(picture: Picture, layer: history.Layer, start: float) -> Picture:
    """The picture with how long it took, which is remembered."""
    picture.seconds["total"] = time.perf_counter() - start
    assert picture.settings is not None
    is_paced = any(each.decision == SAME_PICTURE for each in picture.plan)
    share = picture.settings.share if is_paced else None
    devices = _devices(picture)
    history.remember(layer, picture.settings, picture.seconds, devices, share)
    return picture


def _devices(picture: Picture) -> dict[str, str]:
    """What the last stage of a picture ran on."""
    assert picture.settings is not None
    stage = "network" if picture.settings.is_enlarged else "denoise"
    return {stage: picture.device}


def _finish(
    engine: Any,
    layer_name: str,
    method: Method,
    own: Sampled,
    others: Sequence[Sampled] = (),
    ahead: Callable[[Overlap[Any]], None] | None = None,
) -> Picture:
    """Make the picture of each view and write it; returns the first view's.

    What there is to do `ahead` is done meanwhile.
    """

    def finish(report: Report | None) -> dict[str, Picture]:
        return {v: method.finish(own, others, v, report) for v in own.views}

    try:
        report = method.begin_finishing(engine)
        if ahead is None:
            pictures = finish(report)
        else:
            # Blender's progress is for its own thread alone
            with Overlap[dict[str, Picture]](True) as overlap:
                list(overlap.put(partial(finish, None)))
                ahead(overlap)
                (pictures,) = overlap.rest()
        session.stop_if_cancelled(engine)
    except NetworkFailed:
        _write(engine, layer_name, method, own, method.stopped(own))
        raise
    except Cancelled:
        _leave_stopped(engine, layer_name, method, own)
        raise
    started = time.perf_counter()
    picture = joined(pictures, own.seconds)
    combined = picture.views or dict.fromkeys(pictures, picture.pixels)
    parts = {view: finished.parts for view, finished in pictures.items()}
    _write(engine, layer_name, method, own, combined, parts)
    picture.seconds["write"] = time.perf_counter() - started
    return picture


def _leave_stopped(engine: Any, layer_name: str, method: Method, own: Sampled) -> None:
    """Leave what there is of a frame that was stopped, if the request asks for it."""
    if method.request.finish_stopped:
        _write(engine, layer_name, method, own, method.stopped(own))


def _write(
    engine: Any,
    layer_name: str,
    method: Method,
    own: Sampled,
    pictures: dict[str, Array],
    parts: Mapping[str, Mapping[str, Array]] | None = None,
) -> None:
    """Write the pictures (H, W, 4) and the light passes of each view.

    `parts` are those that were finished with the pictures.
    """
    layer = engine.get_result().layers[layer_name]
    for view in own.views:
        finished = (parts or {}).get(view, {})
        for name, light in {**method.light_passes(own, view), **finished}.items():
            session.write_pass(layer, name, view, light)
    session.write_combined(engine, layer_name, pictures)


def _renders_single_frames() -> bool:
    """Whether Blender was started for frames by number alone.

    Each is a render job of its own then, which could pass nothing on to the next. What
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
