"""Where the guides of a picture come from: rendered, kept from before, or both."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from xrds_core.arrays import Array
from xrds_core.notices import warn
from xrds_core.temporal.sample_subsets import SampleSubset

from ..cycles.pass_names import ALBEDO, NORMAL, is_lasting
from ..cycles.passes import CyclesPasses
from ..cycles.rendered import Beauty, Guides, Probe
from ..planning.facts import Facts
from ..planning.plan import GUIDE_CACHE, Decision, Plan
from ..scene.guide_key import NotFollowed, guide_key
from . import guide_cache
from .guide_cache import CachedGuides, GuideName
from .job import RenderJob


@dataclass(frozen=True)
class _Look:
    """What a look into the cache was for, and what it took; its text tells a user."""

    key: str
    probe: Probe
    has_hole: bool
    seconds: float

    def __str__(self) -> str:
        cache, probe = guide_cache.CACHE, self.probe
        return (
            f"a probe of {probe.width}x{probe.height} pixels took {probe.seconds:.2f} s"
            f" ({cache.hits} of {cache.hits + cache.misses} looks found guides)"
        )


class GuideSource:
    """Guides of one frame.

    `decision` tells afterwards where they came from, and `name`, where it is known,
    what they show: guides of the same name hold each other's samples. `portion` says
    which samples are new, where frames of a shot continue one sequence.
    """

    def __init__(
        self,
        passes: CyclesPasses,
        depsgraph: Any,
        job: RenderJob,
        chosen: Plan,
        facts: Facts,
        report: Callable[[set[str], str], None],
        portion: SampleSubset | None = None,
    ) -> None:
        self._passes, self._graph, self._job = passes, depsgraph, job
        self._report = report
        self._chosen, self._facts = chosen, facts
        self._portion = portion
        self.name: GuideName | None = None
        self._folder = None if job.guide_cache is None else Path(job.guide_cache)
        self.decision = Decision(GUIDE_CACHE, "off", "as requested")

    def guides(self, low: dict[str, Beauty] | None = None) -> dict[str, Guides]:
        """Guides by view; the render result then holds their passes.

        `low` is the picture by view, which an empty scene's guides are made of.
        """
        if low is not None and not self._chosen.render_guides:
            self.decision = Decision(GUIDE_CACHE, "off", "there are no guides to keep")
            return self._of_background(low)
        if self._job.guides == "full" or GUIDE_CACHE not in self._job.savings:
            return self._render(self._chosen.guide_samples)
        started = time.perf_counter()
        try:
            key = self._key()
        except NotFollowed as reason:
            self.decision = Decision(
                GUIDE_CACHE, "not used", f"the cache cannot track {reason}"
            )
            return self._render(self._chosen.guide_samples)
        probe = self._passes.probe(self._chosen.guides)
        self.name = GuideName(key, probe.values)
        region = self._passes.region
        size = region.height, region.width
        holes = guide_cache.CACHE.holes
        kept = guide_cache.CACHE.get(key, probe.values, self._folder, size)
        has_hole = guide_cache.CACHE.holes > holes
        look = _Look(key, probe, has_hole, time.perf_counter() - started)
        missing = self._missing(0 if kept is None else kept.samples)
        if not missing:
            assert kept is not None
            self._passes.put_back(kept.passes)
            self._report_hit(kept.samples, look)
            return _guides(kept, {"sync": 0.0, "guides": look.seconds})
        return self._add(look, kept, missing)

    def _of_background(self, low: dict[str, Beauty]) -> dict[str, Guides]:
        """What Cycles writes where it sees nothing: its light as albedo, no normal."""
        scale, region = self._job.scale, self._passes.region
        guides = {}
        for view, beauty in low.items():
            rows, columns = beauty.offset
            rows, columns = (
                slice(rows, rows + region.height),
                slice(columns, columns + region.width),
            )

            def large(x: Array, rows: slice = rows, columns: slice = columns) -> Array:
                return x.repeat(scale, 0).repeat(scale, 1)[rows, columns]

            albedo, alpha = large(beauty.radiance), large(beauty.alpha)
            normal = np.zeros_like(albedo)
            seconds = {"sync": 0.0, "guides": 0.0}
            guides[view] = Guides(albedo, normal, alpha, None, None, None, seconds)
            self._passes.put_back({(view, ALBEDO): albedo, (view, NORMAL): normal})
        return guides

    def _key(self) -> str:
        names = sorted(self._passes.pass_names())
        light = [name for name in names if not is_lasting(name)]
        if light:
            raise NotFollowed(f"the pass {', '.join(light)}")
        passes, scene = self._passes, self._facts.scene
        how = sorted(asdict(self._chosen.guides).items())
        if self._portion is not None:
            # Depth and index may be empty: guides of single frames are others
            names.append("continued")
        frame = passes.frame, passes.region, passes.views, names, how
        return guide_key(self._graph, scene, frame)

    def _missing(self, kept: int) -> int:
        """Samples to render beside those that are there."""
        asked = self._chosen.guide_samples
        if kept < asked:
            return asked - kept
        return max(0, min(asked, self._job.guide_limit - kept))

    def _render(self, samples: int, kept: int = 0) -> dict[str, Guides]:
        seed = None if self._job.seed is None else self._job.seed + 1
        if kept:  # samples of the same seed would be the same samples
            first = self._graph.scene_eval.cycles.seed if seed is None else seed
            seed = first + kept
        return self._passes.guides_by_view(
            samples,
            full=self._job.guides == "full",
            seed=seed,
            how=self._chosen.guides,
            portion=self._portion and replace(self._portion, length=samples),
        )

    def _add(
        self, look: _Look, kept: CachedGuides | None, samples: int
    ) -> dict[str, Guides]:
        """Render samples, join them with those kept, and keep the result."""
        rendered = self._render(samples, 0 if kept is None else kept.samples)
        seconds = dict(next(iter(rendered.values())).seconds)
        seconds["guides"] += look.seconds
        alphas = {view: guides.alpha for view, guides in rendered.items()}
        passes = self._passes.data_passes()
        guides = CachedGuides(samples, passes, alphas, look.probe.values)
        reason = self._why_missed(look)
        value = f"kept {samples} samples"
        if kept is not None:
            guides = kept.merged(guides)
            self._passes.put_back(guides.passes)
            reason = f"{samples} more samples of the same view"
            value = f"gathered {guides.samples} samples"
        try:
            guide_cache.CACHE.put(look.key, guides, self._folder)
        except OSError as error:  # the picture is worth more than the guides kept
            reason = (
                f"in memory only: cannot write to {self._folder} ({error.strerror})"
            )
            warn(f"guides are kept {reason}")
        self.decision = Decision(GUIDE_CACHE, value, f"{reason}; {look}")
        return _guides(guides, seconds)

    def _why_missed(self, look: _Look) -> str:
        if not look.has_hole:
            return "no kept guides match this camera, geometry and materials"
        reason = (
            "nothing XRDS looks at has changed, but a probe render shows other guides"
        )
        self._report({"INFO"}, f"XRDS: {GUIDE_CACHE}: {reason}; they are rendered anew")
        return reason

    def _report_hit(self, samples: int, look: _Look) -> None:
        reason = "camera, geometry, materials and textures are unchanged"
        expected = self._facts.guide_seconds
        saving = None if expected is None else max(0.0, expected - look.seconds)
        self.decision = Decision(
            GUIDE_CACHE, f"used {samples} samples", f"{reason}; {look}", saving
        )


def _guides(kept: CachedGuides, seconds: dict[str, float]) -> dict[str, Guides]:
    return {
        view: Guides(
            kept.passes[view, ALBEDO],
            kept.passes[view, NORMAL],
            alpha,
            None,
            None,
            kept.samples,
            seconds,
        )
        for view, alpha in kept.alphas.items()
    }
