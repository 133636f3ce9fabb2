"""Blender's own animation renders: the engine samples the frames ahead by itself.

Blender asks for one frame after the other. Inside the render of a frame its neighbours
are evaluated and sampled too, those ahead as well; each is kept until its last
neighbour is finished, and none is sampled twice. What is kept lasts for one render job,
so that no edit of the file comes between.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import takewhile
from typing import Any

import numpy as np

from xrds_core.arrays import Array
from xrds_core.errors import Cancelled
from xrds_core.temporal.window import Shot

from ..cycles import session
from ..cycles.pass_names import COMBINED
from ..cycles.passes import CyclesPasses
from ..frame import history, progress
from ..frame.job import NetworkFailed, Picture, RenderJob
from ..frame.layer import render_layer
from ..frame.lending import can_lend
from ..scene.cuts import cuts
from ..scene.facts import requested_passes
from .choosing import ShotJob, choose_for_shot
from .method import FullSize, method_of
from .sampling import Sampled, can_continue, first_sample
from .visiting import go_to

_Passes = dict[tuple[str, str], Array]
# Passes that the first sample of a sequence writes alone, and the layer's switches.
_OF_ONE_SAMPLE = {
    "z": {"Depth"},
    "position": {"Position"},
    "object_index": {"IndexOB", "Object Index"},
    "material_index": {"IndexMA", "Material Index"},
}


@dataclass
class _Window:
    """The frames of one view layer that are kept, by number.

    `passes` are Cycles' own of frames that were sampled before their turn. `count` is
    how many were sampled since `began`. `asked` is the job that `chosen` came from.
    """

    asked: RenderJob
    chosen: ShotJob
    sampled: dict[int, Sampled] = field(default_factory=dict)
    passes: dict[int, _Passes] = field(default_factory=dict)
    began: float = field(default_factory=time.perf_counter)
    count: int = 0
    method: FullSize = field(init=False)

    def __post_init__(self) -> None:
        self.method = method_of(self.job)

    @property
    def job(self) -> RenderJob:
        """That of all its frames."""
        return self.chosen.job

    def begin_frame(self, scene: Any) -> None:
        """Show how far the animation is; frames ahead are sampled already."""
        number, end, step = scene.frame_current, scene.frame_end, scene.frame_step
        newest = max(self.sampled, default=number - step)
        seconds = None
        if self.count:
            each = (time.perf_counter() - self.began) / self.count
            seconds = each * ((end - newest) // step + 1)
        progress.begin_frame(number, (end - number) // step, seconds)

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

    As `render_layer`; in an animation with the samples of its neighbours.
    """
    if engine.is_animation:
        scene = depsgraph.scene_eval
        left = (scene.frame_end - scene.frame_current) // scene.frame_step
        progress.begin_frame(scene.frame_current, left)
    if not _has_neighbours(engine, depsgraph, job):
        return render_layer(engine, depsgraph, job)
    place = history.place_of(depsgraph)
    try:
        picture = _render_among_neighbours(engine, depsgraph, job)
    finally:
        progress.end()
    history.keep(place, picture.job or job, picture)
    return picture


def _has_neighbours(engine: Any, depsgraph: Any, job: RenderJob) -> bool:
    is_animation = engine.is_animation and not _renders_single_frames()
    return is_animation and can_lend(depsgraph.scene_eval, job)


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


def _render_among_neighbours(engine: Any, depsgraph: Any, job: RenderJob) -> Picture:
    """Render the frame into the engine's result and return the first view's picture.

    Every pass but Combined is Cycles' own. Raises Cancelled when the user stops it.
    """
    started = time.perf_counter()
    scene, layer_name = depsgraph.scene_eval, depsgraph.view_layer_eval.name
    number, needed = scene.frame_current, _needed(scene, job)
    window = _windows.get((scene.name, layer_name))
    if window is None or window.asked != job:
        window = _Window(job, choose_for_shot(engine, depsgraph, job))
        scene = depsgraph.scene_eval  # made anew where the scene was probed
        _windows[scene.name, layer_name] = window
    window.forget_before(needed[0])
    window.begin_frame(scene)
    try:
        _sample_missing(engine, depsgraph, window, number, needed)
        lenders = [window.sampled[n] for n in needed if n != number]
        if window.method.lacks(window.sampled[number], lenders):
            with CyclesPasses(engine, depsgraph) as passes:
                window.sampled[number] = _sample(engine, depsgraph, window, passes)
        picture = _finish(engine, layer_name, window, window.sampled[number], lenders)
    except Cancelled:
        _keep(engine, layer_name, window, number)
        raise
    picture.seconds["total"] = time.perf_counter() - started
    return window.chosen.told(picture)


def _keep(engine: Any, layer_name: str, window: _Window, number: int) -> None:
    """Leave what there is of a frame that was stopped, if the job asks for it.

    Where it has not been sampled, its samples so far are in the result already.
    """
    own = window.sampled.get(number)
    if own is not None and window.job.stop_keeps:
        _write_light(engine, layer_name, window, own)
        session.write_combined(engine, layer_name, window.method.stopped(own))


def _finish(
    engine: Any,
    layer_name: str,
    window: _Window,
    own: Sampled,
    lenders: Sequence[Sampled],
) -> Picture:
    """Make the picture of each view and write it; returns the first view's."""
    method = window.method
    report = method.begin_finishing(engine)
    pictures: dict[str, Picture] = {}
    more: dict[str, Array] = {}
    try:
        for view in own.views:
            pictures[view] = method.finish(own, lenders, view, report)
    except NetworkFailed as error:
        more[COMBINED] = np.dstack((error.radiance, error.alpha))
        raise
    finally:
        _write_light(engine, layer_name, window, own, more)
    combined = {v: np.dstack((p.radiance, p.alpha)) for v, p in pictures.items()}
    session.write_combined(engine, layer_name, combined)
    first = next(iter(pictures.values()))
    first.seconds.update({**own.seconds, **first.seconds})
    return first


def _write_light(
    engine: Any,
    layer_name: str,
    window: _Window,
    own: Sampled,
    more: Mapping[str, Array] | None = None,
) -> None:
    """Write what `light_passes` of the method gives of each view."""
    result = engine.get_result()
    for view in own.views:
        for name, light in window.method.light_passes(own, view, more).items():
            session.write_pass(result.layers[layer_name], name, view, light)
    engine.update_result(result)


def _needed(scene: Any, job: RenderJob) -> list[int]:
    """Numbers of the frame and of its neighbours inside the animation, in order."""
    own, step, reach = scene.frame_current, scene.frame_step, job.temporal_radius
    around = range(own - reach * step, own + reach * step + 1, step)
    inside = [n for n in around if scene.frame_start <= n <= scene.frame_end]
    numbers = tuple(sorted({own, *inside}))
    shot = Shot(numbers, reach, cuts(scene, numbers))
    return sorted((own, *shot.lenders(own)))


def _sample_missing(
    engine: Any, depsgraph: Any, window: _Window, number: int, needed: list[int]
) -> None:
    """Sample what is not kept; the result then holds the passes of frame `number`."""
    scene = depsgraph.scene_eval
    missing = [n for n in needed if n not in window.sampled]
    if not missing:
        session.allocate(engine)
    with CyclesPasses(engine, depsgraph) as passes:
        try:
            for each in missing:
                go_to(engine, depsgraph, each)
                between = _is_between(scene, each)
                window.sampled[each] = _sample(
                    engine, depsgraph, window, passes, between
                )
                window.count += 1
                if each >= number and missing[-1] != number:
                    window.passes[each] = passes.all_passes()
        finally:
            go_to(engine, depsgraph, number)
            if number in window.passes:
                passes.put_back(window.passes.pop(number))


def _is_between(scene: Any, number: int) -> bool:
    """As `Shot.is_between`, of the whole animation."""
    first, step = scene.frame_start, scene.frame_step
    around = (number - step, number, number + step)
    inside = first <= around[0] and around[2] <= scene.frame_end
    is_second = (number - first) // step % 2 == 1
    return inside and is_second and not cuts(scene, around)


def _sample(
    engine: Any,
    depsgraph: Any,
    window: _Window,
    passes: CyclesPasses,
    between: bool = False,
) -> Sampled:
    """Sample the frame that the dependency graph is at.

    Under a camera that stands still frames continue one sequence, as `place_of` says.
    Passes that its first sample alone writes are then rendered by themselves, for each
    frame: that nothing moves in them is seldom sure.
    """
    scene = depsgraph.scene_eval
    if not can_continue(scene, window.job):
        return window.method.sample(engine, depsgraph, between=between)
    place = scene.frame_current // scene.frame_step
    sampled = window.method.sample(engine, depsgraph, place)
    asked = _OF_ONE_SAMPLE.keys() & set(requested_passes(depsgraph.view_layer_eval))
    if asked:
        others = passes.all_passes()
        first_sample(engine, depsgraph, window.job, place)
        names = set().union(*(_OF_ONE_SAMPLE[each] for each in asked))
        own = {k: x for k, x in passes.all_passes().items() if k[1] in names}
        passes.put_back(others | own)
    return sampled
