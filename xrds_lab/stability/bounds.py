"""The bounds: one table, which the report prints and the document repeats.

A measured value fails above its limit. An exemption may state how far off it was at
the most, and why. A value without a limit is only reported.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fnmatch import fnmatchcase

PIXELS = "low-resolution pixels"


@dataclass(frozen=True)
class Bound:
    """The most that a value may be, and what the value is."""

    limit: float | None
    meaning: str


@dataclass(frozen=True)
class Exemption:
    """A bound that some weights do not hold: how far off at most, and the reason."""

    subject: str
    """As `fast x2 fp32`; * stands for anything."""
    limit: float
    reason: str


BOUNDS: dict[str, Bound] = {
    "range.scaling": Bound(
        1e-3, "largest relative difference after scaling light by 2^±7, 2^±20"
    ),
    "range.scaling_far": Bound(None, "the same by 2^±30, 2^±40"),
    "range.spread_faults": Bound(0, "values below 0 or not finite, light over 1e12"),
    "range.spread_error": Bound(
        1, "error of the dark half beside light 1e12 brighter, of bicubic's on it alone"
    ),
    "range.denormal_faults": Bound(0, "faults with light of 1e-45 to 1e-38"),
    "constant.value": Bound(5e-3, "largest relative error of a constant picture"),
    "black.all": Bound(0, "light in a picture of none under textured albedo"),
    "black.half": Bound(0, "light in the black half beyond one low pixel, of the mean"),
    "lit_pixel.away": Bound(0, "share of one lit pixel's light beyond its neighbours"),
    "lit_pixel.gain": Bound(None, "light of one lit pixel, of what was given"),
    "energy.smooth": Bound(1e-2, "relative error of the mean, smooth input"),
    "energy.textured": Bound(None, "relative error of the mean, textured albedo"),
    "invalid.faults": Bound(
        0, "faults after NaN, ±Inf, negative and extreme values in pixels, rows, passes"
    ),
    "invalid.reach": Bound(0, f"changed values beyond 160 {PIXELS}, exposure given"),
    "invalid.distance": Bound(16, f"{PIXELS} until a spoilt one changes less than 1 %"),
    "firefly.far_change": Bound(
        1e-2, "relative change beyond 3 low pixels from fireflies of 1e2 to 1e8"
    ),
    "firefly.light_beyond_two_pixels": Bound(
        1e-2, "share of what fireflies add that lies beyond two low pixels"
    ),
    "grey.chroma": Bound(1e-3, "largest chroma of a grey scene"),
    "colour.permutation": Bound(1e-2, "SMAPE after permuting the colour channels"),
    "guides.zero_normals": Bound(1, "dB below bicubic, normals 0"),
    "guides.long_normals": Bound(1, "dB below bicubic, normals of length 5"),
    "guides.noisy_normals": Bound(1, "dB below bicubic, random normals"),
    "guides.albedo_0": Bound(1, "dB below bicubic, albedo 0"),
    "guides.albedo_50": Bound(1, "dB below bicubic, albedo 50"),
    "guides.emitter_1e6": Bound(1, "dB below bicubic, albedo 1e6 in a ninth of it"),
    "guides.constant": Bound(1, "dB below bicubic, constant guides"),
    "guides.shifted": Bound(1, "dB below bicubic, guides off by one pixel"),
    "guides.another_frame": Bound(1, "dB below bicubic, guides of another frame"),
    "guides.faults": Bound(0, "faults under all of these"),
    "guides.ring": Bound(0.05, "deviation of an even wall around an emitter's albedo"),
    "shapes.faults": Bound(0, "faults over all sizes"),
    "shapes.memory": Bound(2.0, "GiB on top of the arrays, 8192 x 8192"),
    "shapes.large_faults": Bound(0, "faults in the picture of 8192 x 8192"),
    "tiles.difference": Bound(1e-5, "largest difference to the whole, log domain"),
    "tiles.seam": Bound(1.02, "gradient across seams, of the whole picture's there"),
    "tiles.border": Bound(1e-5, "largest difference of a border, log domain"),
    "same.runs": Bound(0, "values that differ between two runs"),
    "same.threads": Bound(1e-6, "one thread against several, of the brightest"),
    "precision.smape": Bound(3e-3, "mean SMAPE against fp32"),
    "precision.outliers": Bound(0, "values off by more than 0.02 and 5 % from fp32"),
}

STIFF = (
    "pinhole",
    "caustics",
    "bright_sky",
    "emitter",
    "glass_in_glass",
    "one_sample",
    "fog",
    "hair",
    "horizon",
    "blurred",
    "soft_alpha",
)
# For every scene, in place of the star.
BOUNDS |= {
    "stiff.*.faults": Bound(0, "values below 0 or not finite in a rendered scene"),
    "stiff.*.below_bicubic": Bound(1, "dB below bicubic"),
    "stiff.*.below_oidn": Bound(None, "dB below Cycles + OIDN of as many samples"),
    "stiff.*.seconds": Bound(None, "seconds of render, guides and network, of its own"),
    "stiff.*.brightest": Bound(8, "brightest value, of the low-resolution one's"),
    "shot.*.flicker": Bound(
        None, "flicker of still pixels, of OIDN's with as many samples"
    ),
    "shot.turntable.exposure": Bound(
        0.1, "range of the automatic exposure in stops, steady light"
    ),
    "shot.flickering.exposure": Bound(None, "the same, flickering light"),
    "samples.falling_psnr": Bound(
        0, "dB lost from 1 to 4, 16 and 64 samples, at the worst step"
    ),
    "load.memory": Bound(
        16, "KiB that memory grows by with each of 200 frames in one process"
    ),
    "load.data_blocks": Bound(0, "data-blocks and images that stay behind over them"),
    "load.slowing": Bound(
        1.1, "processor seconds of a later frame, of an earlier one's"
    ),
}

# Frames at full size that take their neighbours' samples.
BOUNDS |= {
    "accumulation.cut.ghost": Bound(
        0, "radiance that frames on either side of a cut add to the other's pixels"
    ),
    "accumulation.*.below_single": Bound(
        0, "dB that a frame with its neighbours' samples lies below the frame alone"
    ),
    "accumulation.*.excess": Bound(
        0.2, "error of a pixel (sRGB, mean of 3x3) beyond its error in the frame alone"
    ),
    "accumulation.fisheye.lent": Bound(
        0, "frames under a fisheye that took samples of others"
    ),
    "accumulation.nan.faults": Bound(
        0, "faults in the picture after NaN and infinities in one frame"
    ),
    "accumulation.nan.reach": Bound(
        0.01,
        "relative change of the light beyond 12 pixels from it, before denoising",
    ),
    "accumulation.missing.faults": Bound(0, "faults beside a frame that is missing"),
    "accumulation.missing.unfinished": Bound(
        0, "other frames that it leaves unfinished"
    ),
    "accumulation.passes.crashes": Bound(
        0, "frames with other passes that neither lend nor are refused in one line"
    ),
    "accumulation.long.memory": Bound(
        16, "KiB that memory grows by with each of 1000 frames"
    ),
}

_ONLY_GUIDES = (
    "the noise of two samples hides what moves in refractions; the guides show it, but "
    "comparing these as strictly costs things that stand still up to 0.3 dB"
)
_FAR_FEATURES = (
    "attention looks eight cells around, the bound three: features change a little "
    "there, by the same share however bright the firefly"
)
_SPOILT_FEATURES = (
    "a spoilt pixel changes the features of its attention windows by more than 1 % at "
    "some pixels; without a limit only beyond the receptive field"
)
_WEAK_FIREFLIES = (
    "the same small change beside the light of the weakest fireflies; 0.01 % for those "
    "of 1e4 and more"
)
_FAR_TILES = (
    "attention sees farther than the tiles' overlap, ever more weakly; no seam is "
    "measurable"
)
_BF16 = "the eight bits of bf16 round near values apart"
_PICTURE = (
    "the published network predicts the picture itself: zero padding darkens its rim, "
    "and nothing but training bounds the rest"
)
_PAPER = {
    "range.spread_error": 6e10,
    "range.denormal_faults": 3e4,
    "constant.value": 0.8,
    "black.half": 0.2,
    "lit_pixel.away": 1,
    "grey.chroma": 1.01,
    "colour.permutation": 3e-2,
    "firefly.far_change": 6e-2,
    "firefly.light_beyond_two_pixels": 0.15,
    "invalid.reach": 1e5,
    "invalid.distance": 200,
    "guides.ring": 0.8,
    "precision.smape": 5e-3,
}
"""How far `paper` is off at most; the bounds are those of networks with a base."""

EXEMPTIONS: dict[str, tuple[Exemption, ...]] = {
    "accumulation.water.below_single": (Exemption("full_size *", 1.6, _ONLY_GUIDES),),
    "accumulation.glass_ball.excess": (Exemption("full_size *", 0.5, _ONLY_GUIDES),),
    "accumulation.blinds.excess": (
        Exemption(
            "full_size *",
            0.35,
            "the stripes are narrower than the 7x7 pixels in which light is compared",
        ),
    ),
    "invalid.reach": (
        Exemption(
            "balanced x2 *",
            2e3,
            "two groups see farther than 160 pixels: values change there by 2e-6 of "
            "the mean",
        ),
    ),
    "invalid.distance": (
        Exemption("fast *", 48, _SPOILT_FEATURES),
        Exemption("balanced * fp32", 48, _SPOILT_FEATURES),
        Exemption("balanced * bf16", 160, _SPOILT_FEATURES),
    ),
    "firefly.far_change": (
        Exemption("fast *", 3e-2, _FAR_FEATURES),
        Exemption("balanced *", 3e-2, _FAR_FEATURES),
    ),
    "firefly.light_beyond_two_pixels": (
        Exemption("fast *", 4e-2, _WEAK_FIREFLIES),
        Exemption("balanced *", 1e-1, _WEAK_FIREFLIES),
    ),
    "colour.permutation": (
        Exemption(
            "balanced x2 *", 1.2e-2, "nothing but training makes the channels alike"
        ),
    ),
    "guides.shifted": tuple(
        Exemption(subject, 2, "kernels that follow edges of guides follow wrong ones")
        for subject in ("fast x4 *", "balanced x2 *", "balanced x4 *")
    ),
    "tiles.difference": (
        # a thousandth of the test picture's range
        Exemption("fast *", 2.8e-3, _FAR_TILES),
        Exemption("balanced *", 2.8e-3, _FAR_TILES),
        Exemption("* bf16", 2e-2, _BF16),
    ),
    "tiles.border": (
        Exemption("balanced * fp32", 5e-5, _FAR_TILES),
        Exemption("* bf16", 2e-2, _BF16),
    ),
    "same.threads": (
        Exemption("* bf16", 1e-3, "threads add up in another order, rounded to 8 bits"),
        Exemption(
            "paper x2 fp32", 2e-6, "threads add up in another order, layer on layer"
        ),
    ),
}

for _name, _most in _PAPER.items():
    EXEMPTIONS[_name] = (
        *EXEMPTIONS.get(_name, ()),
        Exemption("paper *", _most, _PICTURE),
    )


@dataclass(frozen=True)
class Check:
    """One value beside its bound: an entry of `results.json`."""

    name: str
    preset: str
    scale: int
    precision: str
    value: float
    bound: float | None
    passed: bool
    exception: str | None

    @property
    def holds(self) -> bool:
        """Whether it passes, or has a measured exception."""
        return self.passed or self.exception is not None


def bound(name: str) -> Bound:
    """Return the bound of a value; raises KeyError without one."""
    first, _, rest = name.partition(".")
    return BOUNDS.get(name) or BOUNDS[f"{first}.*.{rest.partition('.')[2]}"]


def is_bound(name: str) -> bool:
    """Return whether a value has an entry in the table."""
    first, _, rest = name.partition(".")
    return name in BOUNDS or f"{first}.*.{rest.partition('.')[2]}" in BOUNDS


def judge(name: str, value: float, preset: str, scale: int, precision: str) -> Check:
    """Return a value with its verdict; raises KeyError without such a bound."""
    limit = bound(name).limit
    known = math.isfinite(value)
    passed = known and (limit is None or value <= limit)
    subject = f"{preset} x{scale} {precision}"
    reasons = [
        x.reason
        for x in EXEMPTIONS.get(name, ())
        if fnmatchcase(subject, x.subject) and value <= x.limit
    ]
    exception = reasons[0] if reasons and not passed else None
    return Check(name, preset, scale, precision, value, limit, passed, exception)
