"""Render the demo scene by every method: XRDS, and Cycles with the same seconds."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from xrds_blender import render
from xrds_blender.frame.job import Picture, RenderJob
from xrds_blender.planning.plan import savings_but
from xrds_core import metrics

LOW_SAMPLES = 16  # per low-resolution pixel, the standard measure's
GUIDE_SAMPLES = 4
FIT_SAMPLES = (1, 3)  # of the plain renders that samples and fixed costs are fitted to
REFERENCE_SAMPLES = 512  # at most


@dataclass(frozen=True)
class Entry:
    """One method's picture and its seconds."""

    name: str
    label: str
    picture: Picture
    seconds: float
    """Wall clock of the whole call."""

    def errors(self, reference: Picture) -> dict[str, float]:
        """PSNR in dB of the sRGB values, RelMSE of the scene-linear ones."""
        shown, truth = self.picture.radiance, reference.radiance
        return {
            "seconds": round(self.seconds, 2),
            "psnr": round(metrics.psnr(shown, truth), 3),
            "relmse": round(metrics.relmse(shown, truth), 6),
        }


class Contest:
    """Renders one scene again and again; every call is timed as the user waits."""

    def __init__(self, scene: Any, preset: str, weights: Path | None) -> None:
        self.scene, self.preset, self.weights = scene, preset, weights
        self._fit: tuple[float, float] | None = None

    def warm_up(self) -> None:
        """Load Cycles, OIDN and torch, so that no method pays for being the first."""
        size = self.scene.render.resolution_percentage
        self.scene.render.resolution_percentage = 10
        for scale in (2, 4):
            self.xrds(scale)
        self.plain("warm-up", 1)
        self.scene.render.resolution_percentage = size

    def xrds(self, scale: int) -> Entry:
        """Render at `1 / scale` and let the network enlarge it."""
        job = RenderJob(
            scale=scale,
            samples=LOW_SAMPLES,
            guide_samples=GUIDE_SAMPLES,
            preset=self.preset,
            weights=self.weights,
            savings=savings_but("guide cache"),  # every entry is to pay for its own
        )
        return self._run(f"xrds_x{scale}", f"XRDS x{scale}", job)

    def plain(self, name: str, samples: int, label: str = "Cycles + OIDN") -> Entry:
        """Render with Cycles and OIDN as the file sets them, at full resolution."""
        job = RenderJob(plain=True, samples=samples)
        return self._run(name, f"{label}, {samples} spp", job)

    def plain_in(self, seconds: float, name: str) -> Entry:
        """Cycles and OIDN with as many samples as fit into `seconds`, one at least."""
        fixed, each = self.fit()
        samples = max(1, round((seconds - fixed) / each))
        return self.plain(name, samples)

    def reference(self, seconds: float) -> Entry:
        """Cycles and OIDN with as many samples as fit into the time that is left."""
        fixed, each = self.fit()
        samples = int((seconds - fixed) / each)
        samples = max(16, min(REFERENCE_SAMPLES, samples))
        return self.plain("reference", samples, "Reference")

    def fit(self) -> tuple[float, float]:
        """Seconds of a plain render without samples, and of one sample."""
        if self._fit is None:
            few, many = FIT_SAMPLES
            low, high = (self.plain("fit", n).seconds for n in FIT_SAMPLES)
            each = max(0.01, (high - low) / (many - few))
            self._fit = max(0.0, low - few * each), each
        return self._fit

    def _run(self, name: str, label: str, job: RenderJob) -> Entry:
        print(f"demo: {label}", file=sys.stderr, flush=True)
        start = time.perf_counter()
        picture = render(self.scene, **vars(job))
        seconds = time.perf_counter() - start
        if not np.isfinite(picture.radiance).all():
            raise FloatingPointError(f"{label} holds values that are not finite")
        return Entry(name, label, picture, seconds)
