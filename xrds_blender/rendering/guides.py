"""Where the guides of a picture come from: rendered, cached, or both."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from xrds_core.accumulation.sample_subsets import SampleSubset
from xrds_core.arrays import Array
from xrds_core.errors import warn

from ..cycles.low_resolution import Beauty, Guides, Probe
from ..cycles.passes import CyclesPasses
from ..cycles.settings import ALBEDO, NORMAL, is_lasting
from ..planning.plan import GUIDE_CACHE, Decision, Facts, Plan
from ..planning.request import Request
from ..scene.guide_key import NotFollowed, guide_key
from . import guide_cache
from .guide_cache import CachedGuides, GuideName


@dataclass(frozen=True)
class _Look:
    """What a look into the cache was for, and its cost; its text is for the user."""

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

    `decision` says afterwards where they came from, and `name`, where it is known,
    what they show: guides of the same name hold each other's samples. `subset` says
    which samples are new, where frames of a shot continue one sequence.
    """

    def __init__(
        self,
        passes: CyclesPasses,
        depsgraph: Any,
        request: Request,
        chosen: Plan,
        facts: Facts,
        report: Callable[[set[str], str], None],
        subset: SampleSubset | None = None,
    ) -> None:
        self._passes, self._graph, self._request = passes, depsgraph, request
        self._report = report
        self._chosen, self._facts = chosen, facts
        self._subset = subset
        self.name: GuideName | None = None
        folder = request.guide_cache
        self._folder = None if folder is None else Path(folder)
        self.decision = Decision(GUIDE_CACHE, "off", "as requested")

    def guides(self, low: dict[str, Beauty] | None = None) -> dict[str, Guides]:
        """Guides by view; the render result then holds their passes.

        `low` is the picture by view, which an empty scene's guides are made of.
        """
        if low is not None and not self._chosen.render_guides:
            self.decision = Decision(GUIDE_CACHE, "off", "there are no guides to cache")
            return self._of_background(low)
        if GUIDE_CACHE not in self._request.savings:
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
        cached = guide_cache.CACHE.get(key, probe.values, self._folder, size)
        has_hole = guide_cache.CACHE.holes > holes
        look = _Look(key, probe, has_hole, time.perf_counter() - started)
        missing = self._missing(0 if cached is None else cached.samples)
        if not missing:
            assert cached is not None
            self._passes.put_back(cached.passes)
            self._report_hit(cached.samples, look)
            return _guides(cached, {"sync": 0.0, "guides": look.seconds})
        return self._add(look, cached, missing)

    def _of_background(self, low: dict[str, Beauty]) -> dict[str, Guides]:
        """What Cycles writes where it sees nothing: its light as albedo, no normal."""
        scale, region = self._request.settings.scale, self._passes.region
        guides = {}
        for view, beauty in low.items():
            top, left = beauty.offset
            rows = slice(top, top + region.height)
            columns = slice(left, left + region.width)

            def large(x: Array, rows: slice = rows, columns: slice = columns) -> Array:
                return x.repeat(scale, 0).repeat(scale, 1)[rows, columns]

            albedo, alpha = large(beauty.radiance), large(beauty.alpha)
            normal = np.zeros_like(albedo)
            seconds = {"sync": 0.0, "guides": 0.0}
            guides[view] = Guides(albedo, normal, alpha, None, None, seconds)
            self._passes.put_back({(view, ALBEDO): albedo, (view, NORMAL): normal})
        return guides

    def _key(self) -> str:
        names = sorted(self._passes.pass_names())
        light = [name for name in names if not is_lasting(name)]
        if light:
            raise NotFollowed(f"the pass {', '.join(light)}")
        passes, scene = self._passes, self._facts.scene
        how = sorted(asdict(self._chosen.guides).items())
        if self._subset is not None:
            # Depth and index may be empty: guides of single frames are others
            names.append("continued")
        frame = passes.frame, passes.region, passes.views, names, how
        return guide_key(self._graph, scene, frame)

    def _missing(self, cached: int) -> int:
        """Samples to render beside those that are there."""
        requested = self._chosen.guide_samples
        if cached < requested:
            return requested - cached
        return max(0, min(requested, self._request.guide_limit - cached))

    def _render(self, samples: int, cached: int = 0) -> dict[str, Guides]:
        seed = None if self._request.seed is None else self._request.seed + 1
        if cached:  # samples of the same seed would be the same samples
            first = self._graph.scene_eval.cycles.seed if seed is None else seed
            seed = first + cached
        return self._passes.guides_by_view(
            samples,
            seed=seed,
            how=self._chosen.guides,
            subset=self._subset and replace(self._subset, length=samples),
        )

    def _add(
        self, look: _Look, cached: CachedGuides | None, samples: int
    ) -> dict[str, Guides]:
        """Render samples, add those cached, and cache the result."""
        rendered = self._render(samples, 0 if cached is None else cached.samples)
        seconds = dict(next(iter(rendered.values())).seconds)
        seconds["guides"] += look.seconds
        alphas = {view: guides.alpha for view, guides in rendered.items()}
        passes = self._passes.data_passes()
        guides = CachedGuides(samples, passes, alphas, look.probe.values)
        reason = self._why_missed(look)
        value = f"cached {samples} samples"
        if cached is not None:
            guides = cached.merged(guides)
            self._passes.put_back(guides.passes)
            reason = f"{samples} more samples of the same view"
            value = f"accumulated {guides.samples} samples"
        try:
            guide_cache.CACHE.put(look.key, guides, self._folder)
        except OSError as error:  # the picture is worth more than the cache
            reason = (
                f"in memory only: cannot write to {self._folder} ({error.strerror})"
            )
            warn(f"guides are cached {reason}")
        self.decision = Decision(GUIDE_CACHE, value, f"{reason}; {look}")
        return _guides(guides, seconds)

    def _why_missed(self, look: _Look) -> str:
        if not look.has_hole:
            return "no cached guides match this camera, geometry and materials"
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


def _guides(cached: CachedGuides, seconds: dict[str, float]) -> dict[str, Guides]:
    return {
        view: Guides(
            cached.passes[view, ALBEDO],
            cached.passes[view, NORMAL],
            alpha,
            None,
            cached.samples,
            seconds,
        )
        for view, alpha in cached.alphas.items()
    }
