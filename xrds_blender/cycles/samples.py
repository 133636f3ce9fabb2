"""Cycles' noisy samples of one layer at full size, with what a denoiser asks for."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import Any

import numpy as np

from xrds_core.accumulation.passes import Passes, contiguous
from xrds_core.accumulation.sample_subsets import SampleSubset
from xrds_core.arrays import Array
from xrds_core.denoising.light_passes import LightPart, light_of

from ..internals import spare_passes
from ..internals.borrowed import Borrowed
from ..planning.settings import Denoising
from . import live, session
from .session import StageClock
from .settings import (
    ALBEDO,
    COMBINED,
    DEPTH,
    FIRST_HIT,
    GUIDE_PASSES,
    MOTION,
    NOISY,
    NORMAL,
    SAMPLE_COUNT,
    set_blue_noise,
    set_denoising,
    set_samples,
)

GEOMETRY = ((FIRST_HIT, "Z"), (MOTION, "XYZW"))
"""Passes for reprojection into another frame."""
PATH_LENGTH = (DEPTH, "Z")
"""Beside the first hit's depth: to what mirrors and glass show."""
LATE_DEPTH = (DEPTH, "Z")
"""In the place of the first hit's depth where a sequence is continued: that one is
written by its first sample alone."""
COUNTS = (SAMPLE_COUNT, "X")
"""Pass with how many samples each pixel took, where Cycles decides that."""
Reader = Callable[[str], Array | None]
"""Pixels (H, W, channels) of a pass by name, None where there is none."""


def sample_layer(
    engine: Any,
    depsgraph: Any,
    *,
    samples: int | None = None,
    seed: int | None = None,
    subset: SampleSubset | None = None,
    is_even: bool = True,
    geometry: Sequence[tuple[str, str]] = (),
    light: Sequence[LightPart] = (),
) -> tuple[dict[str, Passes], session.StageClock]:
    """Render without Cycles' denoiser; the result holds Cycles' own passes.

    Parameters
    ----------
    engine : bpy.types.RenderEngine
        The engine that renders.
    depsgraph : bpy.types.Depsgraph
        The evaluated scene.
    samples, seed : int, optional
        None leaves the scene's own.
    subset : SampleSubset, optional
        A part of a longer sequence, in the place of samples and seed.
    is_even : bool
        Whether all pixels of a subset take as many samples; if not, the scene's noise
        threshold stays.
    geometry : sequence of (str, str)
        Those of GEOMETRY that are wanted, or LATE_DEPTH, and COUNTS.
    light : sequence of LightPart
        AOVs and light passes that are wanted.

    Returns
    -------
    samples : dict of str to Passes
        By view.
    clock : StageClock
        What it took.

    Raises
    ------
    Cancelled
        If the user stops it.
    """
    layer_name = depsgraph.view_layer_eval.name
    clock = render_once(
        engine,
        depsgraph,
        samples=samples,
        seed=seed,
        noisy=True,
        subset=subset,
        is_even=is_even,
        geometry=geometry,
    )
    by_view = samples_in(engine, layer_name, {name for name, _ in geometry}, light)
    live.show(next(iter(by_view.values())).picture)
    return by_view, clock


def samples_in(
    engine: Any,
    layer_name: str,
    wanted: Collection[str] = (),
    light: Sequence[LightPart] = (),
) -> dict[str, Passes]:
    """Read the samples in the result by view; `wanted` are names of `geometry`."""
    result = engine.get_result()
    views = [view.name for view in result.views] or [""]
    layer, size = result.layers[layer_name], (result.resolution_x, result.resolution_y)

    def reader(view: str) -> Reader:
        return lambda name: session.read_pass(layer, name, view, size)

    return {view: read_samples(reader(view), wanted, light) for view in views}


def read_samples(
    read: Reader, wanted: Collection[str], light: Sequence[LightPart] = ()
) -> Passes:
    """What `read` gives of a noisy render; `wanted` are names of `geometry`."""
    # Without its denoiser Cycles leaves Combined black where there is Noisy Image.
    noisy = read(NOISY)
    picture = read(COMBINED) if noisy is None else noisy
    albedo, normal = read(ALBEDO), read(NORMAL)
    assert picture is not None
    assert albedo is not None
    assert normal is not None
    geometry = {*wanted} - {SAMPLE_COUNT}
    depth, vector = read_geometry(read, geometry) if geometry else (None, None)
    counts = read(SAMPLE_COUNT) if SAMPLE_COUNT in wanted else None
    if counts is not None:  # all 0 where this Blender's pass has another name
        counts = contiguous(counts[..., 0]) if counts.any() else None
    path = read(DEPTH) if {DEPTH, FIRST_HIT} <= {*wanted} else None
    if path is not None:
        path = contiguous(path[..., 0])
    return Passes(
        radiance=contiguous(picture[..., :3]),
        alpha=contiguous(picture[..., 3]),
        albedo=contiguous(albedo),
        normal=contiguous(normal),
        depth=depth,
        vector=vector,
        counts=counts,
        path_length=path,
        parts=_read_light(read, light),
    )


def _read_light(read: Reader, parts: Sequence[LightPart]) -> dict[str, Array]:
    """Return the light of passes (H, W, 3), by the part's name, and their colours."""

    def pixels(channels: tuple[str, ...]) -> Array:
        colour = read(channels[0].rpartition(".")[0])
        assert colour is not None
        return colour[..., :3]

    return light_of(parts, pixels)


def read_geometry(read: Reader, wanted: Collection[str]) -> tuple[Array, Array | None]:
    """Depth (H, W) and vectors (H, W, 4) where they are among `wanted`."""
    is_late = DEPTH in wanted and FIRST_HIT not in wanted
    depth = read(DEPTH if is_late else FIRST_HIT)
    assert depth is not None
    depth = contiguous(depth[..., 0])
    if is_late:
        depth = np.where(depth > 0.0, depth, np.float32(np.inf))  # 0 is the sky
    vector = read(MOTION) if MOTION in wanted else None
    return depth, None if vector is None else contiguous(vector)


def render_once(
    engine: Any,
    depsgraph: Any,
    *,
    samples: int | None = None,
    seed: int | None = None,
    denoiser: Denoising | None = None,
    noisy: bool = False,
    subset: SampleSubset | None = None,
    is_even: bool = True,
    geometry: Sequence[tuple[str, str]] = (),
) -> StageClock:
    """Render into the engine's result, exactly as Cycles' own engine would.

    Parameters
    ----------
    engine : bpy.types.RenderEngine
        The engine that renders.
    depsgraph : bpy.types.Depsgraph
        The evaluated scene.
    samples, seed : int, optional
        None leaves the scene's own.
    denoiser : Denoising, optional
        None leaves the scene's own.
    noisy : bool
        Whether to switch Cycles' denoiser off, add the passes that guide another one,
        and take samples by the pattern that suits it.
    subset : SampleSubset, optional
        A part of a longer sequence, in the place of samples and seed.
    is_even : bool
        Whether all pixels of a subset take as many samples; if not, the scene's noise
        threshold stays.
    geometry : sequence of (str, str)
        Further passes, as in `sample_layer`.

    Returns
    -------
    clock : StageClock
        What it took.

    Raises
    ------
    Cancelled
        If the user stops it.
    """
    keeps_session = engine.path_resolve("render").use_persistent_data
    scene, layer = depsgraph.scene_eval, depsgraph.view_layer_eval
    guides = [(name, letters) for name, letters, _ in GUIDE_PASSES]
    for name, letters in (*geometry, *(guides if noisy else ())):
        spare_passes.add(engine, layer.name, name, letters)
    with Borrowed() as borrowed:
        set_samples(borrowed, scene, samples, seed, subset, is_even)
        if noisy:
            set_blue_noise(borrowed, scene)
            set_denoising(borrowed, scene, layer, False)
        elif denoiser is not None and session.has_denoiser():
            set_denoising(borrowed, scene, layer, True, denoiser)
        live.samples()
        try:
            clock = session.run(engine, depsgraph)
        finally:
            if not keeps_session:
                borrowed.forget()  # Cycles frees the evaluated scene as it syncs
                session.free(engine)
    session.stop_if_cancelled(engine)
    return clock
