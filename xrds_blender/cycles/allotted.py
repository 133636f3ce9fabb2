"""Cycles' samples of one layer, more of them where the picture needs more.

The frame is sampled evenly first, in two halves. What they show tells which rectangles
take the other samples; each is a render of its own in the same session, and all take
parts of one sample sequence, so that no sample is wasted.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np

from xrds_core.allocation import Half, Rectangle, allot
from xrds_core.arrays import Array
from xrds_core.stdout import muted

from . import live
from .borrowed import Borrowed
from .layer_session import LayerSession
from .low_camera import Region
from .pass_names import ALBEDO, COMBINED, NOISY, NORMAL
from .samples import Samples, read_samples
from .settings import LARGEST_SEED, set_denoising, set_sampling, set_subset

MOST = 4
"""How many times its share a pixel gets at the most."""
RECTANGLES = (24, 256)
"""Least and most: below it too little is gained, above it no more."""
# Of one part's render, beside its samples: starting, and reading the result.
PART_SECONDS, PART_SECONDS_PER_PIXEL = 0.003, 5e-9
SAMPLE_SECONDS = 1e-6
OVERHEAD = 0.03
SEED_STEP = 104729
Report = Callable[[float], object]


@dataclass
class _Sums:
    """Sums over the samples: (H, W, 10) of picture, albedo and normal, and counts."""

    total: Array
    counts: Array

    @classmethod
    def of(cls, width: int, height: int) -> Self:
        total = np.zeros((height, width, 10), np.float32)
        return cls(total, np.zeros((height, width), np.float32))

    @property
    def mean_count(self) -> float:
        return float(self.counts.mean())

    def add(self, samples: Samples, count: int, at: Rectangle) -> None:
        rows, columns = slice(at.y, at.y + at.height), slice(at.x, at.x + at.width)
        start = 0
        for image in (samples.picture, samples.albedo, samples.normal):
            end = start + image.shape[2]
            self.total[rows, columns, start:end] += image * np.float32(count)
            start = end
        self.counts[rows, columns] += count

    @property
    def picture(self) -> Array:
        return self.total[..., :4] / self.counts[..., None]

    def mean(self) -> Samples:
        mean = self.total / self.counts[..., None]
        parts = (mean[..., :4], mean[..., 4:7], mean[..., 7:])
        return Samples(*(np.ascontiguousarray(part) for part in parts))


class AllottedLayer(LayerSession):
    """One view layer, sampled as much as each part of it needs."""

    def sample(
        self, samples: int, seed: int | None, exposure: float, report: Report
    ) -> tuple[Samples, float, float]:
        """Return the means, and seconds of sync and of sampling.

        `samples` per pixel are the mean over the frame, 4 at least. `exposure` is the
        view's, in stops; `report` gets the share that is done. Raises Cancelled when
        the user stops it. The result holds the means so far.
        """
        self._seconds = [0.0, 0.0]
        width, height = self._size
        whole = Rectangle(0, 0, width, height)
        sums = _Sums.of(width, height)
        half = samples // 4
        halves = []
        try:
            for offset in (0, half):
                part = self._part(whole, half, seed, samples, offset)
                sums.add(part, half, whole)
                halves.append(Half(part.picture[..., :3], part.albedo, part.normal))
                live.show(sums.picture)
                report(sums.mean_count / samples)
            parts = allot(
                halves,
                2 * half,
                samples,
                MOST * samples,
                exposure,
                self._rectangles(samples),
            )
            for step in _steps(parts, samples, 2 * half, seed, self._own_seed(seed)):
                with _quietly():
                    sums.add(self._part(*step), step.count, step.place)
                report(sums.mean_count / samples)
        finally:  # stopped by the user, too
            if halves:
                self._write(sums.mean())
        return sums.mean(), *self._seconds

    def _rectangles(self, samples: int) -> int:
        """As many parts as add OVERHEAD to the seconds of samples, on two cores.

        Clocks are not asked: the same scene is to give the same picture again.
        """
        pixels = self._size[0] * self._size[1]
        each = PART_SECONDS + PART_SECONDS_PER_PIXEL * pixels
        count = OVERHEAD * SAMPLE_SECONDS * pixels * samples / each
        return int(np.clip(count, *RECTANGLES))

    def _own_seed(self, seed: int | None) -> int:
        """Of what is no part of the frame's sequence; another one in every frame."""
        base = self._scene.cycles.seed if seed is None else seed
        return (base + SEED_STEP * (1 + abs(self._scene.frame_current))) % LARGEST_SEED

    def _part(
        self, place: Rectangle, count: int, seed: int | None, whole: int, offset: int
    ) -> Samples:
        """Take `count` samples of a sequence of `whole`, from `offset` on."""
        window = Region(
            self.region.x + place.x, self.region.y + place.y, place.width, place.height
        )
        with Borrowed() as borrowed:
            set_sampling(borrowed, self._scene, whole, seed)
            if count < whole:
                set_subset(borrowed, self._scene, offset, count)
            set_denoising(borrowed, self._scene, self._layer_eval, False)
            borrowed.set(self._render, use_border=True)
            clock = self._run((self.width, self.height), window, exact=False)
        for n, seconds in enumerate((clock.sync, clock.render)):
            self._seconds[n] += seconds
        return read_samples(self._corner_reader(self.views[0], window), ())

    def _write(self, mean: Samples) -> None:
        view = self.views[0]
        light = NOISY if NOISY in self.pass_names() else COMBINED
        pictures = {light: mean.picture, ALBEDO: mean.albedo, NORMAL: mean.normal}
        self.put_back({(view, name): image for name, image in pictures.items()})


class _Step(NamedTuple):
    place: Rectangle
    count: int
    seed: int | None
    whole: int
    offset: int


def _steps(
    parts: Sequence[tuple[Rectangle, int]],
    samples: int,
    taken: int,
    seed: int | None,
    own_seed: int,
) -> list[_Step]:
    """All parts go on in the frame's sequence, and then begin one of their own.

    Blue noise is laid out for a whole sequence, in a session for its longest so far:
    part of a longer one is worse to denoise, so the shorter ones come first.
    """
    left = samples - taken
    steps = [_Step(p, min(more, left), seed, samples, taken) for p, more in parts]
    own = sorted((more - left, p) for p, more in parts if more > left)
    return steps + [_Step(p, more, own_seed, more, 0) for more, p in own]


def _quietly() -> AbstractContextManager[None]:
    """Without a window Blender prints twenty lines for every part."""
    import bpy

    return muted() if bpy.app.background else nullcontext()


def sample_allotted(
    engine: Any,
    depsgraph: Any,
    samples: int,
    seed: int | None,
    report: Report = lambda _: None,
) -> tuple[dict[str, Samples], dict[str, float]]:
    """Render without Cycles' denoiser; samples by view, and seconds by stage.

    As `sample_layer`, for a single view, with `samples` per pixel as the mean over the
    frame. No pass of the result is Cycles' own, and only light and guides are whole.
    """
    exposure = depsgraph.scene_eval.view_settings.exposure
    with AllottedLayer(engine, depsgraph, noisy=True) as layer:
        mean, sync, beauty = layer.sample(samples, seed, exposure, report)
        view = layer.views[0]
    return {view: mean}, {"sync": sync, "beauty": beauty}
