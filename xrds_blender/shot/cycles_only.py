"""Cycles alone, exactly as its own engine would render."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..cycles import session
from ..cycles.once import render_once
from ..cycles.pass_names import COMBINED
from ..frame.picture import Picture, peak_memory
from .methods import Method, Report
from .sampling import Sampled


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
        )

    def begin_finishing(self, engine: Any) -> Report:
        return lambda _: True
