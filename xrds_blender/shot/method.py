"""How the frames of a shot are sampled and finished: at full size, or above scale 1."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from xrds_core.arrays import Array
from xrds_core.temporal.vectors import Movement

from ..frame import progress
from ..frame.denoisers import load_denoiser
from ..frame.enlarging import enlarged_lights
from ..frame.job import Picture, RenderJob
from ..frame.networks import load_upscaler
from ..frame.stopping import enlarged, quick
from .enlarged import sample_enlarged
from .enlarged_finishing import finish_alone, finish_enlarged, lacks_guides
from .finishing import finish
from .sampling import Keep, Sampled, sample_frame

Report = Callable[[float], bool]
"""Takes how far a stage is, from 0 to 1; False once the user has stopped it."""


class FullSize:
    """Samples at full size, denoised; one object serves a whole shot.

    `keep` takes each frame that is sampled. Raises XRDSError where the denoiser cannot
    be loaded.
    """

    def __init__(self, job: RenderJob, keep: Keep | None = None) -> None:
        self._job, self._keep = job, keep
        self._denoiser = load_denoiser(job)
        self._movement = Movement()

    def sample(
        self,
        engine: Any,
        depsgraph: Any,
        place: int | None = None,
        between: bool = False,
    ) -> Sampled:
        """Render the frame that the dependency graph is at, as `sample_frame`.

        What other frames tell as well may be missing of one that lies `between` two.
        """
        return sample_frame(engine, depsgraph, self._job, place, self._keep)

    def lacks(self, own: Sampled, lenders: Sequence[Sampled]) -> bool:
        """Whether what is missing of a frame is not told by others after all."""
        return False

    def finish(
        self,
        own: Sampled,
        lenders: Sequence[Sampled],
        view: str,
        report: Report | None = None,
    ) -> Picture:
        """The picture of one view, with what other frames and views lend to it."""
        others = own.lenders(view, lenders)
        return finish(
            own.views[view], others, self._job, self._denoiser, self._movement, report
        )

    def stopped(self, own: Sampled) -> dict[str, Array]:
        """What the user sees of a frame that was stopped, by view, (H, W, 4).

        The frame's own samples, denoised as quickly as can be.
        """
        job = quick(self._job)
        denoiser = load_denoiser(job)
        alone = {
            view: finish(each, (), job, denoiser, Movement())
            for view, each in own.views.items()
        }
        return {view: np.dstack((p.radiance, p.alpha)) for view, p in alone.items()}

    def light_passes(
        self, own: Sampled, view: str, more: Mapping[str, Array] | None = None
    ) -> dict[str, Array]:
        """What the render result lacks of a view, by name, beside the picture.

        Light passes of a low-resolution render and `more` of its size, enlarged
        without a network.
        """
        return {}

    def begin_finishing(self, engine: Any) -> Report:
        """Show the last stage; returns what shows how far it is."""
        progress.begin(engine, progress.DENOISE, 2, 2)
        return progress.reporter(engine)


class Enlarged(FullSize):
    """Light at low resolution, guides at full size, and the network."""

    def __init__(self, job: RenderJob) -> None:
        self._upscaler = load_upscaler(job)
        super().__init__(job)

    def sample(
        self,
        engine: Any,
        depsgraph: Any,
        place: int | None = None,
        between: bool = False,
    ) -> Sampled:
        return sample_enlarged(engine, depsgraph, self._job, place, between)

    def lacks(self, own: Sampled, lenders: Sequence[Sampled]) -> bool:
        return any(
            lacks_guides(each, own.lenders(view, lenders))
            for view, each in own.views.items()
        )

    def finish(
        self,
        own: Sampled,
        lenders: Sequence[Sampled],
        view: str,
        report: Report | None = None,
    ) -> Picture:
        return finish_enlarged(
            own.views[view],
            own.lenders(view, lenders),
            self._job,
            self._denoiser,
            self._upscaler,
            self._movement,
            report,
        )

    def stopped(self, own: Sampled) -> dict[str, Array]:
        denoiser = load_denoiser(quick(self._job))
        low = {view: finish_alone(each, denoiser) for view, each in own.views.items()}
        shape = next(iter(own.views.values())).shape
        return enlarged(low, self._job.scale, shape)

    def light_passes(
        self, own: Sampled, view: str, more: Mapping[str, Array] | None = None
    ) -> dict[str, Array]:
        each, place = own.views[view], own.views[view].place
        lights = place.others | dict(more or {})
        return enlarged_lights(lights, self._job.scale, place.offset, each.shape)

    def begin_finishing(self, engine: Any) -> Report:
        progress.begin(engine, progress.NETWORK, 3)
        return progress.reporter(engine)


def method_of(job: RenderJob, keep: Keep | None = None) -> FullSize:
    """The method of a job; raises XRDSError where its parts cannot be loaded.

    Frames are kept at full size alone.
    """
    return FullSize(job, keep) if job.scale == 1 else Enlarged(job)
