"""Errors between two pictures, as every table of the project reports them.

All functions take scene-linear float arrays (height, width, 3), the picture first and
the reference second. `exposure` is the scene's view exposure in stops; the display
transform is the plain sRGB curve, so that no figure depends on a tone mapper.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from xrds_core.arrays import Array
from xrds_core.errors import PictureError

RELMSE_EPSILON = 0.01  # the published tables of Monte Carlo denoising use this value
LEAST_ERROR = 1e-7  # squared, 70 dB: below it two references tell noise alone
TRIMMED_FRACTION = 0.001  # of pixels: a few fireflies rule the raw RelMSE


def to_srgb(linear: Array, exposure: float = 0.0) -> Array:
    """Display values in [0, 1]: 2^exposure, clip, sRGB curve (IEC 61966-2-1)."""
    light = np.clip(np.asarray(linear, np.float32) * 2.0**exposure, 0.0, 1.0)
    bent = 1.055 * np.power(np.maximum(light, 0.0031308), 1 / 2.4) - 0.055
    return np.where(light <= 0.0031308, 12.92 * light, bent).astype(np.float32)


def psnr(picture: Array, reference: Array, exposure: float = 0.0) -> float:
    """Peak signal-to-noise ratio in dB of the display values; inf when equal.

    Raises PictureError when the shapes differ or a value is not finite.
    """
    _check(picture, reference)
    shown = to_srgb(picture, exposure), to_srgb(reference, exposure)
    error = float(np.mean(np.square(shown[0] - shown[1], dtype=np.float64)))
    return float("inf") if error == 0.0 else float(-10.0 * np.log10(error))


def relmse(picture: Array, reference: Array, trim: float = 0.0) -> float:
    """Mean of (x - r)^2 / (r^2 + 0.01) over pixels and channels, scene-linear.

    `trim` is the fraction of the worst pixels left out (see TRIMMED_FRACTION).
    Raises PictureError when the shapes differ or a value is not finite.
    """
    _check(picture, reference)
    truth = np.asarray(reference, np.float64)
    error = (picture - truth) ** 2 / (truth**2 + RELMSE_EPSILON)
    pixels = np.sort(error.mean(axis=2), axis=None)
    return float(pixels[: max(1, pixels.size - round(trim * pixels.size))].mean())


def flip(picture: Array, reference: Array, exposure: float = 0.0) -> float:
    """Mean LDR-FLIP (Andersson et al. 2020) of the display values, 0 is equal.

    Raises PictureError for bad arrays, ImportError without `flip-evaluator`.
    """
    import flip_evaluator

    _check(picture, reference)
    shown = [to_srgb(x, exposure) for x in (reference, picture)]
    return float(flip_evaluator.evaluate(*shown, "LDR", applyMagma=False)[1])


def all_metrics(
    picture: Array, reference: Array, exposure: float = 0.0
) -> dict[str, float]:
    """The standard row of a table: psnr, relmse, relmse_trimmed and flip."""
    return {
        "psnr": psnr(picture, reference, exposure),
        "relmse": relmse(picture, reference),
        "relmse_trimmed": relmse(picture, reference, TRIMMED_FRACTION),
        "flip": flip(picture, reference, exposure),
    }


def metrics_of_pair(
    picture: Array, pair: tuple[Array, Array], clean: Array, exposure: float = 0.0
) -> dict[str, float]:
    """The standard row, by two references of independent noise.

    Where both are one reference this is `all_metrics`. FLIP is told by a `clean` one.
    """
    for reference in pair:
        _check(picture, reference)
    one, two = (np.asarray(x, np.float64) for x in pair)
    shown, *true = (to_srgb(x, exposure) for x in (picture, *pair))
    error = float(squared_error(shown, true).mean())
    relative = (picture - one) * (picture - two)
    relative /= ((one + two) / 2) ** 2 + RELMSE_EPSILON
    pixels = np.sort(relative.mean(axis=2), axis=None)
    kept = max(1, pixels.size - round(TRIMMED_FRACTION * pixels.size))
    return {
        "psnr": float(-10.0 * np.log10(max(error, LEAST_ERROR))),
        "relmse": float(pixels.mean()),
        "relmse_trimmed": float(pixels[:kept].mean()),
        "flip": flip(picture, clean, exposure),
    }


def squared_error(picture: Array, pair: Sequence[Array]) -> Array:
    """(H, W) of (H, W, C), mean over channels, by two references of independent noise.

    The mean of (x - r)(x - s) is the squared error of x without the noise of r and s;
    single pixels may be negative.
    """
    first, second = (np.subtract(picture, x, dtype=np.float64) for x in pair)
    return np.asarray((first * second).mean(axis=-1))


def _check(picture: Array, reference: Array) -> None:
    if picture.shape != reference.shape or reference.shape[2:] != (3,):
        raise PictureError(
            f"cannot compare a picture of shape {picture.shape} with a reference of "
            f"shape {reference.shape}: both must be (height, width, 3)"
        )
    for name, pixels in (("picture", picture), ("reference", reference)):
        bad = pixels.size - int(np.isfinite(pixels).sum())
        if bad:
            raise PictureError(
                f"{bad} values of the {name} are NaN or infinite; "
                "clean it before comparing"
            )
