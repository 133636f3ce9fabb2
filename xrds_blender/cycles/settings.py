"""Names of Cycles' passes, and what each render needs, set on the evaluated scene."""

from __future__ import annotations

import math
from typing import Any

from xrds_core.accumulation.sample_subsets import SampleSubset

from ..internals.borrowed import Borrowed
from ..planning.settings import Denoising

LOOKS_EVERY = 16
"""Samples after which Cycles looks again at a pixel's noise: its `adaptive_step`."""


def set_sampling(
    borrowed: Borrowed, scene: Any, samples: int | None, seed: int | None
) -> None:
    """Set seed and fixed samples per pixel; None keeps the scene's own."""
    if seed is not None:
        # counting on from the file's seed may leave what Cycles can hold
        borrowed.set(scene.cycles, seed=seed % 2**31, use_animated_seed=False)
    if samples is not None:
        borrowed.set(
            scene.cycles,
            samples=samples,
            use_adaptive_sampling=False,
            time_limit=0.0,
            use_layer_samples="IGNORE",
            sample_offset=0,
            use_sample_subset=False,
        )


def set_repeatable(borrowed: Borrowed, scene: Any) -> None:
    """One sample that no render before it in the session has a say in.

    Cycles' usual patterns come from a table or a sequence that is laid out for the
    most samples that a session was asked for; Sobol-Burley's are computed.
    """
    set_sampling(borrowed, scene, 1, 0)
    borrowed.set(
        scene.cycles,
        sampling_pattern="TABULATED_SOBOL",
        scrambling_distance=1.0,
        auto_scrambling_distance=False,
    )


def set_samples(
    borrowed: Borrowed,
    scene: Any,
    samples: int | None,
    seed: int | None,
    subset: SampleSubset | None,
    is_even: bool = True,
) -> None:
    """Set samples and seed, None leaving the scene's own, or a part of a sequence.

    If not `is_even` the scene's noise threshold stays: pixels stop at it.
    """
    if subset is None:
        set_sampling(borrowed, scene, samples, seed)
        return
    set_sampling(borrowed, scene, subset.whole, subset.seed)
    if not is_even:
        borrowed.set(scene.cycles, use_adaptive_sampling=True)
    if subset.length != subset.whole:
        borrowed.set(
            scene.cycles,
            use_sample_subset=True,
            sample_offset=subset.offset,
            sample_subset_length=subset.length,
        )


def stops_at(cycles: Any, samples: int) -> tuple[float, int]:
    """The noise threshold and the least samples of a pixel, also if Cycles finds them.

    `samples` are the most of one. The formulas are those of Cycles'
    `intern/cycles/scene/integrator.cpp`.
    """
    threshold = cycles.adaptive_threshold or max(0.001, 1.0 / samples)
    least = cycles.adaptive_min_samples or math.ceil(16.0 / threshold**0.3)
    return threshold, max(4, least)


def first_look(least: int) -> int:
    """After how many samples Cycles first looks whether a pixel may stop.

    `least` are the fewest samples of one.
    """
    return (least + LOOKS_EVERY + 1) // LOOKS_EVERY * LOOKS_EVERY


def set_share(borrowed: Borrowed, scene: Any, samples: int, share: float) -> None:
    """Let a pixel stop at a `share` of what the file's noise threshold asks for.

    `samples` are the most that the file allows: an automatic threshold follows them.
    """
    threshold, least = stops_at(scene.cycles, samples)
    borrowed.set(
        scene.cycles,
        adaptive_threshold=threshold / math.sqrt(share),
        adaptive_min_samples=max(1, int(least * share)),
    )


def has_subsets(scene: Any) -> bool:
    """Whether this Blender's Cycles can take a part of a sequence; from 4.4 on."""
    return hasattr(scene.cycles, "use_sample_subset")


def subset_of_file(cycles: Any, samples: int) -> tuple[int, int]:
    """The first sample that a file has Cycles take of `samples`, and how many."""
    if not getattr(cycles, "use_sample_subset", True):
        return 0, samples
    offset = getattr(cycles, "sample_offset", 0)
    if not hasattr(cycles, "sample_subset_length"):  # before Blender 4.4
        return offset, samples
    return offset, max(1, min(cycles.sample_subset_length, samples - offset))


def set_blue_noise(borrowed: Borrowed, scene: Any) -> None:
    """Spread the noise so that a denoiser leaves least of it, where Cycles can.

    Blender does so by default from 4.3 on, but leaves files of older versions with the
    classic pattern, which costs 0.1 to 1 dB after denoising at 8 samples or less.
    """
    import bpy

    if bpy.app.version >= (4, 3):
        borrowed.set(scene.cycles, sampling_pattern="AUTOMATIC")


def set_denoising(
    borrowed: Borrowed,
    scene: Any,
    layer: Any,
    denoise: bool,
    denoiser: Denoising | None = None,
) -> None:
    """Switch the denoiser; `denoiser` None keeps the scene's own mode."""
    borrowed.set(scene.cycles, use_denoising=denoise)
    if denoise:
        # The same denoiser as in the training set, whatever the scene uses.
        borrowed.set(
            scene.cycles,
            denoiser="OPENIMAGEDENOISE",
            denoising_input_passes="RGB_ALBEDO_NORMAL",
        )
        if denoiser is not None:
            borrowed.set(
                scene.cycles,
                denoising_quality=denoiser.quality.upper(),
                denoising_prefilter=denoiser.prefilter,
            )
        borrowed.set(layer.cycles, use_denoising=True)


def set_box_filter(borrowed: Borrowed, scene: Any, scale: int) -> None:
    """Make every low-resolution pixel the mean of the full ones under it."""
    # Dicing is counted in pixels: the mesh is to be that of the full picture.
    borrowed.set(
        scene.cycles,
        pixel_filter_type="BOX",
        filter_width=1.0,
        dicing_rate=scene.cycles.dicing_rate / scale,
    )


ALBEDO, NORMAL, DEPTH = "Denoising Albedo", "Denoising Normal", "Denoising Depth"
GUIDE_PASSES = ((ALBEDO, "RGB", "COLOR"), (NORMAL, "XYZ", "VECTOR"))
COMBINED, NOISY = "Combined", "Noisy Image"
FIRST_HIT, MOTION = "Depth", "Vector"
SAMPLE_COUNT = "Debug Sample Count"
# Light that guides are rendered without, and what was made of it: these passes come
# from the low-resolution render.
_LIGHTS = ("Diffuse", "Glossy", "Transmission", "Volume")
LIGHT_PASSES = frozenset(
    [f"{light} {bounce}" for light in _LIGHTS for bounce in ("Direct", "Indirect")]
    + [
        f"{kind}{bounce}"
        for kind in ("Diff", "Gloss", "Trans")
        for bounce in ("Dir", "Ind")
    ]
    + ["VolumeDir", "VolumeInd", "AO", "Ambient Occlusion"]
    + ["Shadow Catcher", "Noisy Shadow Catcher", "Noisy Image"]
)
# What the same things decide that decide albedo and normal.
_KEPT = {ALBEDO, NORMAL, DEPTH, COMBINED, "Depth", "Position", "Normal", "UV"}
_KEPT |= {"IndexOB", "IndexMA", "Object Index", "Material Index"}
_KEPT |= {"DiffCol", "GlossCol", "TransCol"}
_KEPT |= {"Diffuse Color", "Glossy Color", "Transmission Color"}
# What names things cannot be averaged either.
_OF_FIRST_SAMPLE = {"Depth", "Position", "IndexOB", "IndexMA"}
_OF_FIRST_SAMPLE |= {"Object Index", "Material Index"}


def is_of_first_sample(name: str) -> bool:
    """Whether a pass is not a mean over samples, as depth and cryptomattes."""
    return name in _OF_FIRST_SAMPLE or name.startswith("Crypto")


def is_light(name: str) -> bool:
    """Whether a pass holds light, which guides are rendered without."""
    return name in LIGHT_PASSES or name.startswith("Combined_")


def is_lasting(name: str) -> bool:
    """Whether a pass changes only when guides do, or is made anew with the picture."""
    return name in _KEPT or is_light(name) or name.startswith("Crypto")
