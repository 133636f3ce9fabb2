"""One view layer inside one `RenderEngine.render()`: its settings, sizes and passes.

Arrays are float32 (height, width, channels), scene-linear, row 0 on top; Blender's
rows are turned in `session` alone. The user's scene is never touched: samples,
bounces and camera are set on the evaluated scene, sizes on the pipeline's own copy
of the render settings, and all of it is given back.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Self

from xrds_core.arrays import Array

from ..internals import spare_passes
from ..internals.borrowed import Borrowed, PipelineSettings
from . import session
from .low_resolution import CameraFrame, LowGrid, Region, is_exact, widen
from .samples import Reader, read_geometry
from .settings import COMBINED, DEPTH, GUIDE_PASSES, NOISY, is_light, set_box_filter
from .view import border_start, frame_size


class LayerSession:
    """Runs Cycles at any size and reads and writes passes; a context manager.

    Raises Cancelled when the user stops the render and SceneError when this Blender
    keeps its render settings in an unknown way. On exit every setting is as before.
    `noisy` and `depth` ask for what the file's own passes may not give, `geometry` for
    passes of `samples`.
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
        self._layer_name = depsgraph.view_layer_eval.name
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
        self.frame = CameraFrame(
            self.width, self.height, render.pixel_aspect_x, render.pixel_aspect_y
        )
        self.views = [view.name for view in result.views] or [""]

    def _find_region(self) -> Region:
        width, height = self._size
        if not self._render.use_border:
            return Region(0, 0, width, height)
        x, bottom = border_start(self._render)
        return Region(x, self.height - bottom - height, width, height)

    def __enter__(self) -> Self:
        self._pipeline = PipelineSettings(self._render, self._scene)
        self._keeps_session = self._render.use_persistent_data
        # Else Cycles frees the dependency graph after its first sync.
        self._pipeline.set(use_persistent_data=True)
        session.prepare(self._engine, self._depsgraph)
        self._scene = self._depsgraph.scene_eval
        for name, letters in self._wanted_passes():
            spare_passes.add(self._engine, self._layer_name, name, letters)
        return self

    def __exit__(self, _: object, error: BaseException | None, __: object) -> None:
        try:
            if error is not None or not self._keeps_session:
                session.free(self._engine)
        finally:
            self._borrowed.give_back()
            self._pipeline.give_back()

    @property
    def _layer_eval(self) -> Any:
        """Found anew: a render that evaluates other frames makes it anew."""
        return self._depsgraph.view_layer_eval

    def _wanted_passes(self) -> list[tuple[str, str]]:
        wanted = [(name, letters) for name, letters, _ in GUIDE_PASSES]
        return wanted + self._extra

    def _layer(self) -> Any:
        return self._engine.get_result().layers[self._layer_name]

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
        passes = {(view, n): self._read(n, view) for n in names for view in self.views}
        return {key: pixels for key, pixels in passes.items() if pixels is not None}

    def put_back(self, passes: dict[tuple[str, str], Array]) -> None:
        """Write passes that were read before into the result again."""
        for (view, name), pixels in passes.items():
            session.write_pass(self._layer(), name, view, pixels)

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
        self,
        size: tuple[int, int],
        window: Region,
        *,
        exact: bool,
        is_part: bool = False,
    ) -> session.StageClock:
        """Render `window` of a frame of `size` into the lower left of the result.

        Without a border in the file that is all of it, unless it `is_part`.
        """
        depth = self._pipeline.depth
        with Borrowed() as borrowed:
            try:
                borrowed.set(self._render, resolution_percentage=100)
                width, height = size
                self._pipeline.set(resolution_x=width, resolution_y=height)
                if self._render.use_border or is_part:
                    # A quarter pixel in, so that truncation finds the same pixel.
                    borrowed.set(
                        self._render,
                        use_border=True,
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

    def _corner_reader(self, view: str, window: Region) -> Reader:
        """What a smaller render left of a pass of this view."""

        def read(name: str) -> Array | None:
            pixels = self._read(name, view)
            return None if pixels is None else self._read_corner(pixels, window)

        return read

    def geometry(self, view: str) -> tuple[Array, Array | None]:
        """Depth (H, W) and vectors (H, W, 4) or None, of the last full-size render."""
        return read_geometry(lambda name: self._read(name, view), self._geometry)

    def _light_passes(self, view: str) -> Iterator[tuple[str, Array]]:
        for name in self.pass_names():
            if is_light(name):
                pixels = self._read(name, view)
                if pixels is not None:
                    yield name, pixels
