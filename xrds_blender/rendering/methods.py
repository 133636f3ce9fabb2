"""What makes pictures of frames: one object of a method serves a whole shot.

Every method samples a frame, by itself or as a neighbour of others, and finishes its
picture from these samples. A still is a frame without neighbours.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, ClassVar, Protocol

from xrds_core.accumulation.accumulate import Accumulated
from xrds_core.accumulation.passes import Passes
from xrds_core.arrays import Array
from xrds_core.frame_source import FrameSource, Neighbourhood
from xrds_core.shot import Shot

from ..cycles import session
from ..cycles.samples import render_once
from ..cycles.settings import COMBINED
from ..planning.request import Request
from . import stages
from .pace.more import More, Part
from .picture import Picture, peak_memory
from .sampling import Sampled

Report = Callable[[float], bool]
"""Takes how far a stage is, from 0 to 1; False once the user has stopped it."""


class Finishing(Protocol):
    """What makes pictures of frames: `FullSize`."""

    def accumulate(
        self, own: Sampled, others: Sequence[Sampled], view: str
    ) -> Accumulated:
        """One view with the samples of its neighbours."""

    def finish(self, own: Sampled, others: Sequence[Sampled], view: str) -> Picture:
        """The picture of one view."""

    def radiance(
        self,
        own: Sampled,
        others: Sequence[Sampled],
        view: str,
        region: tuple[slice, slice],
    ) -> Array:
        """Rows and columns of the picture of one view, (H, W, 3), denoised alone."""

    def as_by_cycles(self, radiance: Array, albedo: Array, normal: Array) -> Array:
        """Samples by themselves, denoised as Cycles does in a new file."""


class Pace(Protocol):
    """What chooses the samples of each frame of one shot, in the order of time."""

    def request(self, request: Request, number: int) -> Request:
        """The request of the next frame that is sampled, the one of this number."""

    def takes(self, method: Finishing, frame: Sampled) -> bool:
        """Note a frame that was sampled; False where it is to be sampled again."""

    prepares: ClassVar[bool]
    """Whether `prepare` takes long enough to be done beside the samples of a frame."""

    def prepare(
        self, method: Finishing, own: Sampled, others: Sequence[Sampled]
    ) -> Any:
        """What `complete` takes that needs no render, perhaps in another thread."""

    def complete(
        self,
        method: Finishing,
        own: Sampled,
        others: Sequence[Sampled],
        more: More,
        prepared: Any,
    ) -> Sampled:
        """A frame with all that it is finished from; `more` renders more samples.

        `prepared` is what `prepare` has returned. Raises Cancelled when the user stops
        their render.
        """


class Method:
    """Cycles alone, full size or super-resolution.

    Raises XRDSError, when it is made, where what it needs cannot be loaded.
    """

    last_stage = (stages.DENOISE, 2, 2)
    """The last stage: its name, its number and how many there are."""

    def __init__(self, request: Request) -> None:
        self.request, self.settings = request, request.settings
        self.pace: Pace | None = None

    def begin_shot(
        self, scene: Any, shot: Shot, *, layers: int = 1, beside: Pace | None = None
    ) -> None:
        """Choose what says how many samples the frames of a shot take: `pace`.

        Where several view `layers` render in turn, `beside` is that of another one:
        they share a deadline.
        """

    def sample(
        self,
        engine: Any,
        depsgraph: Any,
        place: int | None = None,
        between: bool = False,
    ) -> Sampled:
        """Render the frame that the dependency graph is at.

        The result then holds its passes. `place` is as in `sampling_of`; what other
        frames show as well may be missing of one that lies `between` two. Raises
        Cancelled when the user stops it; what there is then is kept as the
        request says.
        """
        raise NotImplementedError

    def lacks(self, own: Sampled, others: Sequence[Sampled]) -> bool:
        """Whether what is missing of a frame is not shown by others after all."""
        return False

    @property
    def prepares(self) -> bool:
        """Whether `prepare` takes long enough to be done beside a frame's samples."""
        return self.pace is not None and self.pace.prepares

    def prepare(self, own: Sampled, others: Sequence[Sampled]) -> Any:
        """What `complete` takes that needs no render, perhaps in another thread."""
        return None

    def complete(
        self, own: Sampled, others: Sequence[Sampled], more: More, prepared: Any
    ) -> Sampled:
        """The frame with all that it is finished from; `more` renders more samples.

        `prepared` is what `prepare` has returned. Raises Cancelled when the user stops
        their render.
        """
        return own

    def begin_finishing(self, engine: Any) -> Report:
        """Show the last stage; returns what shows how far it is."""
        stages.begin(engine, *self.last_stage)
        return stages.reporter(engine)

    def finish(
        self,
        own: Sampled,
        others: Sequence[Sampled],
        view: str,
        report: Report | None = None,
    ) -> Picture:
        """The picture of one view, with the samples of its neighbours.

        Its seconds are of finishing alone. Raises Cancelled where `report` says so.
        """
        raise NotImplementedError

    def light_passes(self, own: Sampled, view: str) -> dict[str, Array]:
        """Light passes of a low-resolution render by name, enlarged as they are."""
        return {}

    def stopped(self, own: Sampled) -> dict[str, Array]:
        """What the user sees of a frame that was stopped, by view, (H, W, 4).

        The frame's own samples, denoised as quickly as can be.
        """
        return {}


class CyclesOnly(Method):
    """What Cycles renders is the picture."""

    def sample(
        self,
        engine: Any,
        depsgraph: Any,
        place: int | None = None,
        between: bool = False,
    ) -> Sampled:
        name = depsgraph.view_layer_eval.name  # Cycles may free it as it renders
        number = depsgraph.scene_eval.frame_current
        clock = render_once(
            engine,
            depsgraph,
            samples=self.settings.samples,
            seed=self.request.seed,
            denoiser=self.settings.cycles_denoising,
        )
        result = engine.get_result()
        layer, size = result.layers[name], (result.resolution_x, result.resolution_y)
        views = [view.name for view in result.views] or [""]
        pictures = {v: session.read_pass(layer, COMBINED, v, size) for v in views}
        return Sampled(number, pictures, {"sync": clock.sync, "beauty": clock.render})

    def finish(
        self,
        own: Sampled,
        others: Sequence[Sampled],
        view: str,
        report: Report | None = None,
    ) -> Picture:
        return Picture.of(
            own.views[view],
            seconds={},
            plan=self.request.plan().decisions,
            peak_memory=peak_memory(),
            settings=self.settings,
        )

    def begin_finishing(self, engine: Any) -> Report:
        return lambda _: True


class MethodFrames(FrameSource[Sampled]):
    """Frames that a method samples and judges, whoever asks Cycles for them."""

    method: Method

    @property
    def prepares(self) -> bool:
        return self.method.prepares

    def prepare(self, frame: Neighbourhood[Sampled]) -> Any:
        return self.method.prepare(frame.own, list(frame.neighbours.values()))

    def complete(
        self, frame: Neighbourhood[Sampled], prepared: Any
    ) -> tuple[Sampled, Sampled]:
        """The frame with more samples, or sampled again, where it lacks them.

        It lends the samples that it has got as well, but what was accumulated on it is
        its own.
        """
        own, others = frame.own, list(frame.neighbours.values())
        if self.method.lacks(own, others):
            again = replace(self.sample_again(frame.number), strength=own.strength)
            return again, again
        more = partial(self.more, frame.number)
        whole = self.method.complete(own, others, more, prepared)
        lent = own if whole.views is own.views else replace(whole, gathered={})
        return whole, lent

    def sample_again(self, number: int) -> Sampled:
        """Sample a frame, with all that others may show as well."""
        raise NotImplementedError

    def more(
        self, number: int, part: Part
    ) -> tuple[dict[str, Passes], dict[str, float]]:
        """Render more samples of a frame, as `More` does."""
        raise NotImplementedError
