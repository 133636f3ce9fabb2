"""Cycles run by hand on an engine object of our own, one session for several passes.

Cycles writes into the render result of the engine that its session was made with.
One session serves every pass: `reset` makes it take the new size and settings, and
only what the dependency graph calls updated is synced again. The graph still calls
everything updated when a render starts, so `prepare` lets it forget that; the second
sync and its BVH then cost next to nothing.
"""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from xrds_core.accumulation.passes import contiguous
from xrds_core.errors import Cancelled

from ..internals import spare_passes
from .settings import COMBINED, NOISY

if TYPE_CHECKING:
    from xrds_core.arrays import Array


def functions() -> Any:
    """The functions module of the Cycles add-on that comes with Blender."""
    import addon_utils

    if not addon_utils.check("cycles")[1]:
        addon_utils.enable("cycles", default_set=False)
    from cycles import engine

    return engine


def has_denoiser() -> bool:
    """Whether this build of Blender holds OpenImageDenoise."""
    import _cycles

    return bool(_cycles.with_openimagedenoise)


def samples_on_card(scene: Any) -> bool:
    """Whether Cycles renders a scene on a graphics card."""
    import bpy

    if scene.cycles.device != "GPU":
        return False
    cycles = bpy.context.preferences.addons.get("cycles")
    return cycles is not None and bool(cycles.preferences.has_active_device())


def prepare(engine: Any, depsgraph: Any) -> None:
    """Hand the graph's updates to a session kept from the frame before, then forget.

    To be called before anything is set on evaluated data: should the graph hold
    changes not yet evaluated, those are made now.
    """
    import bpy

    if getattr(engine, "session", None):
        functions().reset(engine, bpy.data, depsgraph)
    handlers = bpy.app.handlers
    # Nothing changed, so nobody is to hear of it.
    held = [
        (listeners, list(listeners))
        for listeners in (handlers.depsgraph_update_pre, handlers.depsgraph_update_post)
    ]
    try:
        for listeners, _ in held:
            listeners.clear()
        depsgraph.update()
    finally:
        for listeners, before in held:
            listeners[:] = before


def run(engine: Any, depsgraph: Any, *, exact: bool = True) -> StageClock:
    """Render the current settings with the engine's session, made when missing.

    A session lays its blue noise for the most samples it has been asked for: with
    fewer the picture is right but worse to denoise (by up to 4 dB of what the denoiser
    gains). So `exact` starts a new session then; albedo and normals do not care.
    """
    import bpy

    cycles = functions()
    samples = samples_of(depsgraph)
    with StageClock() as clock:
        if getattr(engine, "session", None) and (
            (exact and samples < engine.most_samples) or not _tagged(depsgraph)
        ):
            free(engine)
        if not getattr(engine, "session", None):
            cycles.create(engine, bpy.data)
            engine.most_samples = 0
        engine.most_samples = max(samples, engine.most_samples)
        cycles.reset(engine, bpy.data, depsgraph)
        with _noise_in_sight(engine, depsgraph):
            cycles.render(engine, depsgraph)
            # With tiles the pixels lie in a file until this call.
            cycles.render_frame_finish(engine)
    return clock


def _is_watched() -> bool:
    """Whether there is a window to show pictures in."""
    import bpy

    return not bpy.app.background


@contextmanager
def _noise_in_sight(engine: Any, depsgraph: Any) -> Iterator[None]:
    """Let the samples be seen in a window while they are taken.

    Where nothing is denoised, but the result has a pass for the noisy picture, Cycles
    puts the samples there and shows the other one, which stays black.
    """
    if not _is_watched() or depsgraph.scene_eval.cycles.use_denoising:
        yield
        return
    name = depsgraph.view_layer_eval.name  # Cycles may free it as it renders
    with spare_passes.aside(engine, name, NOISY) as is_aside:
        yield
    if is_aside:
        result = engine.get_result()
        layer, size = result.layers[name], (result.resolution_x, result.resolution_y)
        for view in [view.name for view in result.views] or [""]:
            picture = read_pass(layer, COMBINED, view, size)
            if picture is not None:
                write_pass(layer, NOISY, view, picture)


def samples_of(depsgraph: Any) -> int:
    """Samples per pixel that Cycles will take: a view layer may have its own."""
    cycles, layer = depsgraph.scene_eval.cycles, depsgraph.view_layer_eval
    if layer.samples == 0 or cycles.use_layer_samples == "IGNORE":
        return cycles.samples
    if cycles.use_layer_samples == "BOUNDED":
        return min(layer.samples, cycles.samples)
    return layer.samples


def _tagged(depsgraph: Any) -> bool:
    """Tag the evaluated scene as updated; False if this Blender does not do so.

    Without any update Cycles skips its sync and would keep bounces, filter and film.
    """
    depsgraph.scene_eval.update_tag()
    return any(True for _ in depsgraph.updates)


def is_stopped(engine: Any) -> bool:
    """Whether the user has stopped the render."""
    return bool(engine.test_break())


def stop_if_cancelled(engine: Any) -> None:
    """Raise Cancelled if the user has stopped the render."""
    if is_stopped(engine):
        raise Cancelled


def write_combined(engine: Any, layer_name: str, pictures: dict[str, Array]) -> None:
    """Make pictures (height, width, 4), by view, the Combined pass of a layer."""
    result = engine.get_result()
    for view, picture in pictures.items():
        write_pass(result.layers[layer_name], COMBINED, view, picture)
    engine.update_result(result)


def free(engine: Any) -> None:
    """End the engine's session if it has one."""
    if getattr(engine, "session", None):
        # not `functions`: Blender ends what it keeps as it switches Cycles off
        from cycles import engine as cycles

        cycles.free(engine)  # takes the attribute away
    engine.session = None


def allocate(engine: Any) -> None:
    """Make room for the result's pixels; Blender has none where nothing is rendered."""
    result = engine.get_result()
    size = result.resolution_x, result.resolution_y
    engine.end_result(engine.begin_result(0, 0, *size))


def read_pass(layer: Any, name: str, view: str, size: tuple[int, int]) -> Array | None:
    """Pixels (height, width, channels), row 0 on top; None if there is no such pass.

    `size` is the width and height of the whole render result.
    """
    render_pass = layer.passes.find_by_name(name, view)
    if render_pass is None:
        return None
    import numpy as np

    width, height = size
    pixels = np.empty(width * height * render_pass.channels, np.float32)
    render_pass.rect.foreach_get(pixels)
    return pixels.reshape(height, width, render_pass.channels)[::-1]


def write_pass(layer: Any, name: str, view: str, pixels: Array) -> None:
    """Replace the pixels (height, width, channels), row 0 on top, of a whole pass."""
    import numpy as np

    render_pass = layer.passes.find_by_name(name, view)
    if render_pass is not None:
        flipped = contiguous(pixels[::-1].astype(np.float32, copy=False))
        render_pass.rect.foreach_set(flipped.ravel())


# What Cycles says once the scene is there; a frame in tiles is read back and denoised
# after its last sample.
_RENDERING = ("Sample ", "Rendered ", "Finish", "Reading full buffer", "Denoising")
_PEAK = re.compile(r"Mem:[\d.]+M, Peak:([\d.]+)M")
_SAMPLE = re.compile(r"Sample (\d+)/")


class StageClock:
    """Times one Cycles render: `sync` (scene and BVH) and `render` seconds.

    `peak` is the largest memory in bytes that Cycles reported, `samples` the most that
    it said it had taken; 0 when it reported none.
    """

    def __init__(self) -> None:
        self._start = self._end = 0.0
        self._sync = self._status = 0.0
        self._syncing = True
        self.peak = self.samples = 0

    def __enter__(self) -> StageClock:
        import bpy

        self._start = self._status = time.perf_counter()
        if bpy.app.background:
            bpy.app.handlers.render_stats.append(self._hear)
        return self

    def __exit__(self, *_: object) -> None:
        import bpy

        self._end = time.perf_counter()
        if bpy.app.background:
            bpy.app.handlers.render_stats.remove(self._hear)

    def _hear(self, line: str, *_: Any) -> None:
        """Add the time since the last line to what Cycles did until now.

        With several views it syncs, samples, and syncs again.
        """
        now = time.perf_counter()
        if self._syncing:
            self._sync += now - self._status
        if match := _PEAK.search(line):
            self.peak = max(self.peak, int(float(match[1]) * 2**20))
        status = line.rpartition("|")[2].strip()
        if match := _SAMPLE.match(status):
            self.samples = max(self.samples, int(match[1]))
        self._status = now
        self._syncing = not status.startswith(_RENDERING)

    @property
    def sync(self) -> float:
        return self._sync

    @property
    def render(self) -> float:
        return self._end - self._start - self._sync
