"""The Cycles renders inside one `RenderEngine.render()`: beauty and guides.

Arrays are float32 (height, width, channels), scene-linear, row 0 on top; Blender's
rows are turned in `session` alone. The user's scene is never touched: samples,
bounces and camera are set on the evaluated scene, sizes on the pipeline's own copy
of the render settings, and all of it is given back.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import nullcontext
from typing import Any

import numpy as np

from xrds_core.arrays import Array
from xrds_core.temporal.samples import Portion

from ..planning.denoiser import Denoiser
from ..planning.plan import GuideRender
from . import session
from .borrowed import Borrowed, PipelineSettings
from .guide_settings import guide_settings
from .low_camera import Frame, LowGrid, Region, is_exact, widen
from .low_samples import LowPlace, LowSamples
from .pass_names import ALBEDO, COMBINED, DEPTH, GUIDE_PASSES, NOISY, NORMAL, is_light
from .rendered import Beauty, Guides, InProcess
from .samples import read_geometry, read_samples
from .settings import set_box_filter, set_denoising, set_portion, set_sampling
from .size import border_start, frame_size

# The tiny whole frame that a border render takes its exposure from.
OVERVIEW_SIDE, OVERVIEW_SAMPLES = 96, 8


class CyclesPasses:
    """Cycles renders of one view layer; a context manager inside `render()`.

    Any number of `beauty` and `guides` calls, in any order. Raises Cancelled when the
    user stops the render and SceneError when this Blender keeps its render settings
    in an unknown way. On exit every setting is as before. `noisy` and `depth` ask for
    what the file's own passes may not give, `geometry` for passes of `samples`.
    """

    def __init__(
        self,
        engine: Any,
        depsgraph: Any,
        *,
        noisy: bool = False,
        depth: bool = False,
        geometry: Sequence[tuple[str, str]] = (),
    ) -> None:
        self._engine, self._depsgraph = engine, depsgraph
        self._scene = depsgraph.scene_eval
        self._layer_eval = depsgraph.view_layer_eval
        self._layer_name = self._layer_eval.name
        # The method of this name hides the property, so it is asked for by path.
        self._render = engine.path_resolve("render")
        self._borrowed = Borrowed()
        self._extra = [(DEPTH, "Z")] * depth + [(NOISY, "RGBA")] * noisy
        self._extra += geometry
        self._geometry = {name for name, _ in geometry}
        self.peak_memory = 0
        render, result = self._render, engine.get_result()
        self.width, self.height = frame_size(render)
        self._size = result.resolution_x, result.resolution_y
        self.region = self._find_region()
        self.frame = Frame(
            self.width, self.height, render.pixel_aspect_x, render.pixel_aspect_y
        )
        self.views = [view.name for view in result.views] or [""]

    def _find_region(self) -> Region:
        width, height = self._size
        if not self._render.use_border:
            return Region(0, 0, width, height)
        x, bottom = border_start(self._render)
        return Region(x, self.height - bottom - height, width, height)

    def __enter__(self) -> CyclesPasses:
        self._pipeline = PipelineSettings(self._render, self._scene)
        self._keeps_session = self._render.use_persistent_data
        # Else Cycles frees the dependency graph after its first sync.
        self._pipeline.set(use_persistent_data=True)
        session.prepare(self._engine, self._depsgraph)
        self._scene = self._depsgraph.scene_eval
        self._layer_eval = self._depsgraph.view_layer_eval
        for name, letters in self._wanted_passes():
            session.add_pass(self._engine, self._layer_name, name, letters)
        return self

    def __exit__(self, _: object, error: BaseException | None, __: object) -> None:
        try:
            if error is not None or not self._keeps_session:
                session.free(self._engine)
        finally:
            self._borrowed.give_back()
            self._pipeline.give_back()

    def _wanted_passes(self) -> list[tuple[str, str]]:
        wanted = [(name, letters) for name, letters, _ in GUIDE_PASSES]
        return wanted + self._extra

    def _layer(self) -> Any:
        return self._engine.get_result().layers[self._layer_name]

    def beauty(
        self,
        scale: int,
        samples: int | None = None,
        *,
        denoise: bool = True,
        seed: int | None = None,
        denoiser: Denoiser | None = None,
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
        denoiser: Denoiser | None = None,
        in_process: InProcess | None = None,
    ) -> dict[str, Beauty]:
        """As `beauty`, for every view by name (one without stereo)."""
        if denoise and in_process is not None:
            low = self.low_samples(scale, samples, seed=seed)
            return {view: each.denoised(in_process) for view, each in low.items()}
        denoise = denoise and session.has_denoiser()
        grid = self._grid(scale)
        with Borrowed() as borrowed:
            set_sampling(borrowed, self._scene, samples, seed)
            set_denoising(borrowed, self._scene, self._layer_eval, denoise, denoiser)
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
        portion: Portion | None = None,
    ) -> dict[str, LowSamples]:
        """Render as `beauties`, and leave the noise in.

        `portion` is of a longer sequence, in the place of samples and seed. Depth and
        vectors are there as far as `geometry` asked for them.
        """
        grid = self._grid(scale)
        with Borrowed() as borrowed:
            self._set_samples(borrowed, samples, seed, portion)
            set_denoising(borrowed, self._scene, self._layer_eval, False)
            clock = self._run_low(borrowed, grid)
        seconds = {"sync": clock.sync, "beauty": clock.render, "denoise": 0.0}
        return {view: self._read_low(view, grid, seconds) for view in self.views}

    def border_exposure(self) -> float | None:
        """The exposure of the whole frame, where a border cuts a part out of it.

        From a tiny picture of all of it, so that parts fit together. None without a
        border: the picture itself then has it.
        """
        if not self._render.use_border:
            return None
        from xrds_core.front_end import auto_exposure

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

    def hold_still(self) -> None:
        """Render without motion blur, to be called before the first pass."""
        self._borrowed.set(self._scene.render, use_motion_blur=False)

    def pass_names(self) -> list[str]:
        """All passes of the result, each once whatever its views."""
        return list(dict.fromkeys(item.name for item in self._layer().passes))

    def data_passes(self) -> dict[tuple[str, str], Array]:
        """All passes by (view, name) but the picture and its light, as they are now."""
        return self._passes(
            n for n in self.pass_names() if n != COMBINED and not is_light(n)
        )

    def all_passes(self) -> dict[tuple[str, str], Array]:
        """Copies of all passes by (view, name), as they are now."""
        return self._passes(self.pass_names())

    def _passes(self, names: Iterable[str]) -> dict[tuple[str, str], Array]:
        found = {(view, n): self._read(n, view) for n in names for view in self.views}
        return {key: pixels for key, pixels in found.items() if pixels is not None}

    def put_back(self, passes: dict[tuple[str, str], Array]) -> None:
        """Write passes that were read before into the result again."""
        for (view, name), pixels in passes.items():
            session.write_pass(self._layer(), name, view, pixels)

    def guides(
        self,
        samples: int,
        *,
        full: bool = False,
        seed: int | None = None,
    ) -> Guides:
        """Render albedo and normal at full size with the file's own filter.

        Only mirror and glass bounces are followed, which is all that albedo and normal
        need; `full` keeps every bounce and gives the noisy radiance too.
        Beauty and full guides in order of rising samples share one sync of the scene.
        """
        return self.guides_by_view(samples, full=full, seed=seed)[self.views[0]]

    def guides_by_view(
        self,
        samples: int,
        *,
        full: bool = False,
        seed: int | None = None,
        how: GuideRender | None = None,
        portion: Portion | None = None,
    ) -> dict[str, Guides]:
        """As `guides`, for every view by name; `how` names what may be left out.

        `portion` is of a longer sequence, in the place of samples and seed.
        """
        how = how or GuideRender(shadows=False)
        settings = nullcontext() if full else guide_settings(self._depsgraph, how)
        with Borrowed() as borrowed, settings:
            self._set_samples(borrowed, samples, seed, portion)
            set_denoising(borrowed, self._scene, self._layer_eval, False)
            clock = self._run((self.width, self.height), self.region, exact=full)
        seconds = {"sync": clock.sync, "guides": clock.render}
        return {
            view: self._read_guides(view, full, samples, seconds) for view in self.views
        }

    def probe_guides(self, scale: int, samples: int) -> dict[str, float]:
        """Seconds (sync, guides) of guides at 1/scale of the size; no pixels."""
        settings = guide_settings(self._depsgraph, GuideRender(shadows=False))
        with Borrowed() as borrowed, settings:
            set_sampling(borrowed, self._scene, samples, None)
            set_denoising(borrowed, self._scene, self._layer_eval, False)
            clock = self._run_low(borrowed, self._grid(scale), exact=False)
        return {"sync": clock.sync, "guides": clock.render}

    def _set_samples(
        self,
        borrowed: Borrowed,
        samples: int | None,
        seed: int | None,
        portion: Portion | None,
    ) -> None:
        if portion is None:
            set_sampling(borrowed, self._scene, samples, seed)
        else:
            set_portion(borrowed, self._scene, portion)

    def _cameras(self) -> list[Any]:
        import bpy

        ids = self._depsgraph.ids
        return [item for item in ids if isinstance(item, bpy.types.Camera)]

    def _grid(self, scale: int) -> LowGrid:
        """The low-resolution pixels of the region."""
        window = self.region if scale == 1 else self.region.low(scale)
        exact = scale == 1 or is_exact(self._scene.camera.data)
        return LowGrid(self.frame, scale, window, exact)

    def _run_low(
        self, borrowed: Borrowed, grid: LowGrid, *, exact: bool = True
    ) -> session.StageClock:
        if grid.scale > 1:
            set_box_filter(borrowed, self._scene, grid.scale)
            for camera in self._cameras():
                widen(borrowed, camera, self.frame, grid.scale)
        size = self.frame.low_size(grid.scale)
        return self._run(size, grid.rendered(self._size), exact=exact)

    def _run(
        self, size: tuple[int, int], window: Region, *, exact: bool
    ) -> session.StageClock:
        """Render `window` of a frame of `size` into the lower left of the result."""
        depth = self._pipeline.depth
        with Borrowed() as borrowed:
            try:
                borrowed.set(self._render, resolution_percentage=100)
                width, height = size
                self._pipeline.set(resolution_x=width, resolution_y=height)
                if self._render.use_border:
                    # A quarter pixel in, so that truncation finds the same pixel.
                    borrowed.set(
                        self._render,
                        border_min_x=(window.x + 0.25) / width,
                        border_max_x=min(1.0, (window.x + window.width + 0.25) / width),
                        border_min_y=(height - window.y - window.height + 0.25)
                        / height,
                        border_max_y=min(1.0, (height - window.y + 0.25) / height),
                    )
                clock = session.run(self._engine, self._depsgraph, exact=exact)
            finally:
                self._pipeline.give_back(keep=depth)
        self.peak_memory = max(self.peak_memory, clock.peak)
        session.stop_if_cancelled(self._engine)
        return clock

    def _read(self, name: str, view: str) -> Array | None:
        return session.read_pass(self._layer(), name, view, self._size)

    def _radiance(self, view: str, denoised: bool) -> Array:
        """Radiance and alpha; undenoised Cycles leaves Combined black beside Noisy."""
        pixels = None if denoised else self._read(NOISY, view)
        if pixels is None:
            pixels = self._read(COMBINED, view)
        assert pixels is not None
        return pixels

    def _read_corner(self, pixels: Array, window: Region) -> Array:
        """What a smaller render left in the lower left of the result."""
        return pixels[-window.height :, : window.width]

    def _read_beauty(
        self, view: str, grid: LowGrid, denoised: bool, seconds: dict[str, float]
    ) -> Beauty:
        rendered = grid.rendered(self._size)

        def low(pixels: Array) -> Array:
            return grid.resample(self._read_corner(pixels, rendered), rendered)

        picture = low(self._radiance(view, denoised))
        noisy = self._read(NOISY, view) if denoised else None
        return Beauty(
            picture[..., :3].copy(),
            picture[..., 3].copy(),
            None if noisy is None else low(noisy)[..., :3],
            grid.offset(self.region),
            seconds,
            {name: low(pixels) for name, pixels in self._light_passes(view)},
        )

    def _read_low(
        self, view: str, grid: LowGrid, seconds: dict[str, float]
    ) -> LowSamples:
        window = grid.rendered(self._size)

        def read(name: str) -> Array | None:
            pixels = self._read(name, view)
            return None if pixels is None else self._read_corner(pixels, window)

        others = {
            name: grid.resample(self._read_corner(pixels, window), window)
            for name, pixels in self._light_passes(view)
        }
        samples = read_samples(read, self._geometry)
        offset = grid.offset(self.region)
        place = LowPlace(grid, window, offset, others, dict(seconds))
        return LowSamples(samples, place)

    def geometry(self, view: str) -> tuple[Array, Array | None]:
        """Depth (H, W) and vectors (H, W, 4) or None, of the last full-size render."""
        return read_geometry(lambda name: self._read(name, view), self._geometry)

    def _light_passes(self, view: str) -> Iterator[tuple[str, Array]]:
        for name in self.pass_names():
            if is_light(name):
                pixels = self._read(name, view)
                if pixels is not None:
                    yield name, pixels

    def _read_guides(
        self,
        view: str,
        full: bool,
        samples: int,
        seconds: dict[str, float],
    ) -> Guides:
        albedo, normal = self._read(ALBEDO, view), self._read(NORMAL, view)
        assert albedo is not None
        assert normal is not None
        depth = self._read(DEPTH, view)
        radiance = self._radiance(view, False)
        return Guides(
            albedo,
            normal,
            radiance[..., 3].copy(),
            None if depth is None else depth[..., 0],
            radiance[..., :3].copy() if full else None,
            samples,
            seconds,
        )
