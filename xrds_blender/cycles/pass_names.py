"""Names of Cycles' passes, up to Blender 4.5 and from 5.0 on, and what they hold."""

from __future__ import annotations

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
