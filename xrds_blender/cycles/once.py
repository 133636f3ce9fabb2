"""One Cycles render of a layer as the file has it, at full size."""

from __future__ import annotations

from typing import Any

from xrds_core.temporal.sample_subsets import SampleSubset

from ..internals import spare_passes
from ..internals.borrowed import Borrowed
from ..planning.settings import Denoising
from . import live, session
from .clock import StageClock
from .pass_names import GUIDE_PASSES
from .settings import set_blue_noise, set_denoising, set_samples


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
) -> StageClock:
    """Render into the engine's result, exactly as Cycles' own engine would.

    `samples`, `seed` and `denoiser` None leave the scene's own. `noisy` switches
    Cycles' denoiser off, adds the passes that guide another one, and takes samples by
    the pattern that suits it. `subset` is of a
    longer sequence, in the place of samples and seed; it `is_even` as in `set_samples`.
    Raises Cancelled when the user stops it.
    """
    keeps_session = engine.path_resolve("render").use_persistent_data
    scene, layer = depsgraph.scene_eval, depsgraph.view_layer_eval
    if noisy:
        for name, letters, _ in GUIDE_PASSES:
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
