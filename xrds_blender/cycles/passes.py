"""The Cycles renders inside one `RenderEngine.render()`: beauty and guides.

Arrays are float32 (height, width, channels), scene-linear, row 0 on top.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from xrds_core.accumulation.passes import Passes
from xrds_core.accumulation.sample_subsets import SampleSubset
from xrds_core.denoising.light_passes import LightPart

from ..internals.borrowed import Borrowed
from ..planning.plan import GuideRender, guide_bounces
from ..planning.settings import Denoising
from ..scene.closures import of_tree
from . import live, session
from .layer_session import LayerSession
from .low_resolution import (
    Beauty,
    Guides,
    InProcess,
    LowGrid,
    LowPlace,
    LowSamples,
    Probe,
    Region,
)
from .samples import read_samples
from .settings import (
    ALBEDO,
    DEPTH,
    NOISY,
    NORMAL,
    set_blue_noise,
    set_denoising,
    set_repeatable,
    set_samples,
    set_sampling,
)

# The tiny whole frame that a border render takes its exposure from.
OVERVIEW_SIDE, OVERVIEW_SAMPLES = 96, 8
# What a probe of the guides is enlarged by, where it keeps this many pixels.
PROBE_SCALE, PROBE_PIXELS = 8, 4096


class CyclesPasses(LayerSession):
    """Cycles renders of one view layer; a context manager inside `render()`.

    Any number of `beauty` and `guides` calls, in any order.
    """

    def beauty(
        self,
        scale: int,
        samples: int | None = None,
        *,
        denoise: bool = True,
        seed: int | None = None,
        denoiser: Denoising | None = None,
        in_process: InProcess | None = None,
    ) -> Beauty:
        """Render the beauty at 1/scale of the size, filtered by a box of one pixel.

        Scale 1 keeps the scene's own filter: plain Cycles. `samples` None takes the
        scene's sampling, adaptive or not; `denoiser` None the scene's mode. Without a
        denoiser in this Blender the picture stays noisy. `in_process` denoises in
        Cycles' place.
        """
        return self.beauties(
            scale,
            samples,
            denoise=denoise,
            seed=seed,
            denoiser=denoiser,
            in_process=in_process,
        )[self.views[0]]

    def beauties(
        self,
        scale: int,
        samples: int | None = None,
        *,
        denoise: bool = True,
        seed: int | None = None,
        denoiser: Denoising | None = None,
        in_process: InProcess | None = None,
    ) -> dict[str, Beauty]:
        """Render what `beauty` does, for every view by name (one without stereo)."""
        if denoise and in_process is not None:
            low = self.low_samples(scale, samples, seed=seed)
            return {
                view: low_view.denoised(in_process) for view, low_view in low.items()
            }
        denoise = denoise and session.has_denoiser()
        grid = self._grid(scale)
        with Borrowed() as borrowed:
            set_sampling(borrowed, self._scene, samples, seed)
            if scale > 1:
                set_blue_noise(borrowed, self._scene)
            set_denoising(borrowed, self._scene, self._layer_eval, denoise, denoiser)
            live.samples(scale)
            clock = self._run_low(borrowed, grid)
        seconds = {"sync": clock.sync, "beauty": clock.render, "denoise": 0.0}
        return {
            view: self._read_beauty(view, grid, denoise, seconds) for view in self.views
        }

    def low_samples(
        self,
        scale: int,
        samples: int | None = None,
        *,
        seed: int | None = None,
        subset: SampleSubset | None = None,
    ) -> dict[str, LowSamples]:
        """Render at 1/scale of the size and leave the noise in; samples by view.

        `subset` is of a longer sequence, in the place of samples and seed. Depth and
        vectors are there as far as `geometry` asked for them.
        """
        grid = self._grid(scale)
        with Borrowed() as borrowed:
            set_samples(borrowed, self._scene, samples, seed, subset)
            set_blue_noise(borrowed, self._scene)
            set_denoising(borrowed, self._scene, self._layer_eval, False)
            live.samples(scale)
            clock = self._run_low(borrowed, grid)
        seconds = {"sync": clock.sync, "beauty": clock.render, "denoise": 0.0}
        low = {view: self._read_low(view, grid, seconds) for view in self.views}
        first = low[self.views[0]]
        live.show(first.samples.picture, scale, first.place.offset)
        return low

    def part_samples(
        self,
        region: Region,
        subset: SampleSubset,
        *,
        is_even: bool = True,
        light: Sequence[LightPart] = (),
    ) -> tuple[dict[str, Passes], session.StageClock]:
        """Render samples of a part of the frame, by view.

        If not `is_even` the scene's noise threshold stays: pixels stop at it. Counts
        are there where `geometry` asked for them, and so are the AOVs and light passes
        of `light`.
        """
        with Borrowed() as borrowed:
            set_samples(borrowed, self._scene, None, None, subset, is_even)
            set_blue_noise(borrowed, self._scene)
            set_denoising(borrowed, self._scene, self._layer_eval, False)
            live.samples()
            size = self.width, self.height
            is_part = region != self.region
            clock = self._run(size, region, exact=True, is_part=is_part)
        samples = {
            view: read_samples(self._corner_reader(view, region), self._geometry, light)
            for view in self.views
        }
        return samples, clock

    def stopped_samples(self, scale: int) -> dict[str, LowSamples]:
        """What `low_samples` has left in the result when the user stopped it."""
        grid, seconds = self._grid(scale), dict.fromkeys(("sync", "denoise"), 0.0)
        return {view: self._read_low(view, grid, seconds) for view in self.views}

    def border_exposure(self) -> float | None:
        """The exposure of the whole frame, where a border cuts a part out of it.

        From a tiny picture of all of it, so that parts fit together. None without a
        border: the picture itself then has it.
        """
        if not self._render.use_border:
            return None
        from xrds_core.superres.front_end import auto_exposure

        width, height = self._size
        scale = max(-(-self.width // width), -(-self.height // height))
        scale = max(scale, -(-max(self.width, self.height) // OVERVIEW_SIDE))
        low_width, low_height = self.frame.low_size(scale)
        whole = Region(0, 0, low_width, low_height)
        with Borrowed() as borrowed:
            set_sampling(borrowed, self._scene, OVERVIEW_SAMPLES, None)
            set_denoising(borrowed, self._scene, self._layer_eval, False)
            grid = LowGrid(self.frame, scale, whole, exact=True)
            self._run_low(borrowed, grid, exact=False)
        picture = self._read_corner(self._radiance(self.views[0], False), whole)
        return auto_exposure(np.ascontiguousarray(picture[..., :3]))

    def guides(self, samples: int, *, seed: int | None = None) -> Guides:
        """Render albedo and normal at full size with the file's own filter.

        Only mirror and glass bounces are followed, which is all that albedo and normal
        need.
        """
        return self.guides_by_view(samples, seed=seed)[self.views[0]]

    def guides_by_view(
        self,
        samples: int,
        *,
        seed: int | None = None,
        how: GuideRender | None = None,
        subset: SampleSubset | None = None,
    ) -> dict[str, Guides]:
        """Render what `guides` does, for every view; `how` names what may be left out.

        `subset` is of a longer sequence, in the place of samples and seed.
        """
        how = how or GuideRender(shadows=False)
        with Borrowed() as borrowed, guide_settings(self._depsgraph, how):
            set_samples(borrowed, self._scene, samples, seed, subset)
            set_blue_noise(borrowed, self._scene)
            set_denoising(borrowed, self._scene, self._layer_eval, False)
            live.guides()
            clock = self._run((self.width, self.height), self.region, exact=False)
        seconds = {"sync": clock.sync, "guides": clock.render}
        return {view: self._read_guides(view, samples, seconds) for view in self.views}

    def time_guides(self, scale: int, samples: int) -> dict[str, float]:
        """Seconds (sync, guides) of guides at 1/scale of the size; no pixels."""
        settings = guide_settings(self._depsgraph, GuideRender(shadows=False))
        with Borrowed() as borrowed, settings:
            set_sampling(borrowed, self._scene, samples, None)
            set_denoising(borrowed, self._scene, self._layer_eval, False)
            clock = self._run_low(borrowed, self._grid(scale), exact=False)
        return {"sync": clock.sync, "guides": clock.render}

    def probe(self, how: GuideRender) -> Probe:
        """Tiny guides of one sample: the same for the same scene.

        Every pixel looks along one ray through a random place of its block, so about
        one pixel in 64 of a large picture is looked at.
        """
        started = time.perf_counter()
        pixels = self.region.width * self.region.height
        grid = self._grid(max(1, min(PROBE_SCALE, math.isqrt(pixels // PROBE_PIXELS))))
        with Borrowed() as borrowed, guide_settings(self._depsgraph, how):
            set_repeatable(borrowed, self._scene)
            set_denoising(borrowed, self._scene, self._layer_eval, False)
            self._run_low(borrowed, grid, exact=False)
        window = grid.rendered(self._size)
        pictures = [self._radiance(view, False)[..., 3:] for view in self.views]
        pictures += [pixels for _, pixels in sorted(self.data_passes().items())]
        values = [self._read_corner(pixels, window).ravel() for pixels in pictures]
        seconds = time.perf_counter() - started
        return Probe(np.concatenate(values), window.width, window.height, seconds)

    def _read_beauty(
        self, view: str, grid: LowGrid, denoised: bool, seconds: dict[str, float]
    ) -> Beauty:
        place = self._place(view, grid, seconds)
        picture = self._read_corner(self._radiance(view, denoised), place.window)
        noisy = self._corner_reader(view, place.window)(NOISY) if denoised else None
        return place.beauty(picture, noisy)

    def _read_low(
        self, view: str, grid: LowGrid, seconds: dict[str, float]
    ) -> LowSamples:
        place = self._place(view, grid, seconds)
        read = self._corner_reader(view, place.window)
        return LowSamples(read_samples(read, self._geometry), place)

    def _place(self, view: str, grid: LowGrid, seconds: dict[str, float]) -> LowPlace:
        window = grid.rendered(self._size)
        others = {
            name: grid.resample(self._read_corner(pixels, window), window)
            for name, pixels in self._light_passes(view)
        }
        return LowPlace(grid, window, grid.offset(self.region), others, dict(seconds))

    def _read_guides(
        self, view: str, samples: int, seconds: dict[str, float]
    ) -> Guides:
        albedo, normal = self._read(ALBEDO, view), self._read(NORMAL, view)
        assert albedo is not None
        assert normal is not None
        depth = self._read(DEPTH, view)
        return Guides(
            albedo,
            normal,
            self._radiance(view, False)[..., 3].copy(),
            None if depth is None else depth[..., 0],
            samples,
            seconds,
        )


@contextmanager
def guide_settings(depsgraph: Any, guides: GuideRender) -> Iterator[None]:
    """Hold the settings of a guide render on the evaluated scene."""
    with Borrowed() as borrowed:
        _set_paths(borrowed, depsgraph.scene_eval, guides)
        changed = list(_set_lights(borrowed, depsgraph, guides))
        for item in changed:
            item.update_tag()
        try:
            yield
        finally:
            borrowed.give_back()
            # The next pass is to see the lights again.
            for item in changed:
                item.update_tag()


def _set_paths(borrowed: Borrowed, scene: Any, guides: GuideRender) -> None:
    """Follow light only as far as albedo and normal need it."""
    borrowed.set(
        scene.cycles,
        max_bounces=min(guides.bounces, guide_bounces(scene.cycles.max_bounces)),
        diffuse_bounces=0,
        volume_bounces=0,
        use_fast_gi=False,
        use_guiding=False,
    )
    if not guides.shadows:
        borrowed.set(scene.cycles, light_sampling_threshold=1.0)


def _set_lights(
    borrowed: Borrowed, depsgraph: Any, guides: GuideRender
) -> Iterator[Any]:
    """Switch light sampling off; yields what Cycles has to look at again."""
    import bpy

    for item in depsgraph.ids:
        if isinstance(item, bpy.types.World) and not guides.sample_world:
            if item.cycles.sampling_method != "NONE":
                borrowed.set(item.cycles, sampling_method="NONE")
                yield item
        elif isinstance(item, bpy.types.Material) and not guides.sample_emitters:
            if item.cycles.emission_sampling != "NONE" and _emits(item):
                borrowed.set(item.cycles, emission_sampling="NONE")
                yield item
        elif isinstance(item, bpy.types.Light) and not guides.lamps and item.energy:
            borrowed.set(item, energy=0.0)
            yield item


def _emits(material: Any) -> bool:
    return material.node_tree is not None and of_tree(material.node_tree).emits
