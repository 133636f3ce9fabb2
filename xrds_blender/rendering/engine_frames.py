"""The frames of an animation, sampled by the engine inside the render of one of them.

Blender asks for one frame after the other. Inside the render of a frame its neighbours
are evaluated and sampled too, those ahead as well; none is sampled twice.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from xrds_core.arrays import Array
from xrds_core.frame_source import Neighbourhood, Window
from xrds_core.overlap import Overlap
from xrds_core.shot import Shot

from ..cycles import session
from ..cycles.passes import CyclesPasses
from ..scene.contents import cuts, frame_range, requested_passes
from ..scene.strength import strength_of
from . import stages
from .methods import Method, MethodFrames
from .pace.more import Part, render_more
from .sampling import Sampled, can_continue, first_sample

_Passes = dict[tuple[str, str], Array]
# Passes that the first sample of a sequence writes alone, and the layer's switches.
_OF_ONE_SAMPLE = {
    "z": {"Depth"},
    "position": {"Position"},
    "object_index": {"IndexOB", "Object Index"},
    "material_index": {"IndexMA", "Material Index"},
}


@dataclass(frozen=True)
class _Call:
    """One call of `RenderEngine.render()`, and the passes of its layer.

    It is for a frame's `number`; `last` is the last frame that is sampled in it.
    """

    engine: Any
    depsgraph: Any
    passes: CyclesPasses
    number: int
    last: int | None


@dataclass
class EngineFrames(MethodFrames):
    """The frames of one view layer of an animation, for one render job.

    `ahead` are Cycles' own passes of frames that were sampled before their turn.
    """

    method: Method
    window: Window[Sampled] = field(init=False)
    ahead: dict[int, _Passes] = field(default_factory=dict)
    _call: _Call | None = None

    @classmethod
    def of(
        cls, scene: Any, method: Method, beside: Method | None = None
    ) -> EngineFrames:
        """The frames of a scene's range; `beside` is another layer's method."""
        frames = cls(method)
        numbers = frame_range(scene)
        radius, begins = method.request.settings.temporal_radius, cuts(scene, numbers)
        shot = Shot(tuple(numbers), radius, begins)
        method.begin_shot(
            scene,
            shot,
            layers=layers_of(scene),
            beside=None if beside is None else beside.pace,
        )
        frames.window = Window(shot, frames)
        stages.begin_animation(len(numbers), len(numbers))
        return frames

    def neighbourhood(self, engine: Any, depsgraph: Any) -> Neighbourhood[Sampled]:
        """The frame that Blender asks for, with its neighbours.

        The render result then holds the frame's own passes.
        """
        number = depsgraph.scene_eval.frame_current
        for old in [n for n in self.ahead if n < number]:
            del self.ahead[old]
        missing = self.window.missing(number)
        if not missing:
            session.allocate(engine)
        with CyclesPasses(engine, depsgraph) as passes:
            last = missing[-1] if missing else None
            self._call = _Call(engine, depsgraph, passes, number, last)
            try:
                frame = self.window.neighbourhood(number)
            finally:
                self._call = None
                go_to(engine, depsgraph, number)
                if number in self.ahead:
                    passes.put_back(self.ahead.pop(number))
        assert frame is not None
        return frame

    def sample_next(self, engine: Any, depsgraph: Any, overlap: Overlap[Any]) -> None:
        """Sample what the frame after this one needs, while this one is finished.

        Where frames are prepared, the next one is as well, while what the frame after
        it needs is sampled. The render result afterwards holds the passes that it held
        before. Raises Cancelled when the user stops it.
        """
        number = depsgraph.scene_eval.frame_current
        later = sorted(n for n in self.window.shot.frames if n > number)
        if not later:
            return
        self._sample_ahead(engine, depsgraph, self.window.missing(later[0]))
        if self.prepares:
            self.window.prepare(later[0], overlap)
            for after in later[1:2]:
                self._sample_ahead(engine, depsgraph, self.window.missing(after))

    def _sample_ahead(
        self, engine: Any, depsgraph: Any, missing: Sequence[int]
    ) -> None:
        if not missing:
            return
        number = depsgraph.scene_eval.frame_current
        with CyclesPasses(engine, depsgraph) as passes:
            before = passes.all_passes()
            self._call = _Call(engine, depsgraph, passes, number, None)
            try:
                for later_frame in missing:
                    self.window.load(later_frame)
            finally:
                self._call = None
                go_to(engine, depsgraph, number)
                passes.put_back(before)

    def complete(
        self, frame: Neighbourhood[Sampled], prepared: Any
    ) -> tuple[Sampled, Sampled]:
        assert self._call is not None
        go_to(self._call.engine, self._call.depsgraph, frame.number)
        return super().complete(frame, prepared)

    def sample_again(self, number: int) -> Sampled:
        self.ahead.pop(number, None)  # its own passes are rendered now
        return self._sample(between=False)

    def more(self, number: int, part: Part) -> Any:
        call = self._call
        assert call is not None
        place = _place(call.depsgraph.scene_eval)
        request = self.method.request
        return render_more(call.engine, call.depsgraph, request, place, part)

    def load(self, number: int) -> Sampled:
        """Sample a frame, and keep its passes where others overwrite them."""
        call = self._call
        assert call is not None
        go_to(call.engine, call.depsgraph, number)
        strength = strength_of(call.depsgraph.scene_eval, self.method.request)
        sampled = self._sample(self.window.shot.is_between(number))
        sampled = replace(sampled, strength=strength)
        stages.end_sampling()
        if number >= call.number != call.last:
            self.ahead[number] = call.passes.all_passes()
        return sampled

    def _sample(self, between: bool) -> Sampled:
        """Sample the frame that the dependency graph is at.

        Under a camera that stands still frames continue one sequence, as `place_of`
        says. Passes that its first sample alone writes are then rendered by
        themselves, for each frame: that nothing moves in them is seldom sure.
        """
        call = self._call
        assert call is not None
        engine, depsgraph, passes = call.engine, call.depsgraph, call.passes
        scene = depsgraph.scene_eval
        if not can_continue(scene, self.method.request):
            return self.method.sample(engine, depsgraph, between=between)
        place = _place(scene)
        sampled = self.method.sample(engine, depsgraph, place)
        requested = _OF_ONE_SAMPLE.keys() & set(
            requested_passes(depsgraph.view_layer_eval)
        )
        if requested:
            others = passes.all_passes()
            first_sample(engine, depsgraph, self.method.request, place)
            names = set().union(*(_OF_ONE_SAMPLE[each] for each in requested))
            own = {k: x for k, x in passes.all_passes().items() if k[1] in names}
            passes.put_back(others | own)
        return sampled


def _place(scene: Any) -> int:
    """The frame's index among all frames of its step, as `place_of` has it."""
    return int(scene.frame_current // scene.frame_step)


def layers_of(scene: Any) -> int:
    """How many view layers of a scene are rendered."""
    return max(1, sum(layer.use for layer in scene.view_layers))


_ADD_ON = __name__.partition(".")[0]


def go_to(engine: Any, depsgraph: Any, number: int) -> None:
    """Evaluate another frame; nothing where the dependency graph is there already."""
    scene = depsgraph.scene_eval
    if number == scene.frame_current:
        return
    scene = scene.original
    engine.frame_set(number, 0.0)
    handlers = _scripts()
    for handler in handlers:
        _call(handler, scene)
    if handlers:  # what they changed is evaluated as well
        engine.frame_set(number, 0.0)


def _scripts() -> list[Callable[..., Any]]:
    """What others than this add-on have Blender call before a frame is rendered."""
    import bpy

    ours = f"{_ADD_ON}."
    handlers = bpy.app.handlers.render_pre
    return [x for x in handlers if not getattr(x, "__module__", "").startswith(ours)]


def _call(handler: Callable[..., Any], scene: Any) -> None:
    """As Blender does: with one argument or two; an error is reported, no more."""
    code = getattr(handler, "__code__", None)
    arguments = [scene] if code and code.co_argcount == 1 else [scene, None]
    try:
        handler(*arguments)
    except Exception:  # of somebody else's code
        traceback.print_exc()
