"""First-order regression of low-resolution radiance on the guides.

How much of the picture the guides explain differs from place to place: nearly all of it
on textured walls, nothing on car paint. A linear model of the log radiance in the
guides, fitted around every low-resolution pixel, finds out [1]_ [2]_; in the log domain
its prediction stays positive.

Shape letters: B batch, h w low-resolution pixels, H W output pixels.

References
----------
.. [1] He, K., Sun, J. and Tang, X. (2010). Guided Image Filtering.
.. [2] Bitterli, B. et al. (2016). Nonlinearly Weighted First-Order Regression for
   Denoising Monte Carlo Renderings.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional as F

# Added to albedo before its logarithm or a division by it: bounds both on black.
ALBEDO_EPSILON = 0.02
# Added to radiance, in units of k e x, before its logarithm.
RADIANCE_FLOOR = 0.02
# Variance of the log radiance, unexplained by a fit, that doubles its ridge; by scale.
NOISE = 0.0125
# What a denoiser took away, of what it left, counts up to this: fireflies are not fit.
GRAIN_LIMIT = 1.0
# Log of the factor that a pixel may be changed by when its texture is restored.
RESTORED_LIMIT = 1.5
LEAST_MEAN = 1e-30  # so that black over black is black
# Low-resolution rows that are explained at once, so that their dozens of planes stay in
# the processor's caches, and how far from a row lies what it depends on.
BAND, REACH = 96, 12


class Feature(NamedTuple):
    """A guide, or one component of it, that the radiance is regressed on."""

    full: Tensor  # (B, 3 or 1, H, W)
    low: Tensor  # (B, 3 or 1, h, w), of the area means of the guide
    ridge: float  # variance below which it explains nothing, without noise
    slope: tuple[float, float]  # range of its slope


FEATURES = 4


class Explained(NamedTuple):
    """Low-resolution radiance and what the guides explain of it."""

    low: Tensor  # (B, 3, h, w), with the texture that a denoiser took away
    grain: Tensor  # (B, 3, h, w), what is left of that: see `find_grain`
    factor: Tensor  # (B, 3, H, W), positive
    slopes: Tensor  # (B, 4, h, w)

    def rows(self, first: int, count: int, scale: int) -> Explained:
        """Some of its low-resolution rows."""
        low, full = (slice(n * first, n * (first + count)) for n in (1, scale))
        spans = low, low, full, low
        parts = zip(self, spans, strict=True)
        return Explained(*(part[..., span, :] for part, span in parts))


def explain(radiance: Tensor, noisy: Tensor, guides: Tensor, scale: int) -> Explained:
    """Restore the radiance and regress it on the guides.

    Parameters
    ----------
    radiance : (B, 3, h, w) Tensor
        Linear radiance, in units of k e x.
    noisy : (B, 3, h, w) Tensor
        The same before denoising.
    guides : (B, 6, H, W) Tensor
        Albedo in [0, 1] and normal.
    scale : int
        Output pixels per low-resolution pixel along one axis.

    Returns
    -------
    explained : Explained
        The restored radiance, and what the guides explain of it.
    """
    height = radiance.shape[-2]
    bands = []
    for top in range(0, height, BAND):
        first, last = max(top - REACH, 0), min(top + BAND + REACH, height)
        rows = slice(first, last)
        explained = explain_band(
            radiance[..., rows, :],
            noisy[..., rows, :],
            guides[..., first * scale : last * scale, :],
            scale,
        )
        bands.append(explained.rows(top - first, min(BAND, height - top), scale))
    return (
        bands[0]
        if len(bands) == 1
        else Explained(*(torch.cat(parts, dim=2) for parts in zip(*bands, strict=True)))
    )


def explain_band(
    radiance: Tensor, noisy: Tensor, guides: Tensor, scale: int
) -> Explained:
    """Restore and regress all rows at once, which `explain` does band by band."""
    features = find_features(guides, scale)
    low = restore(radiance, find_grain(radiance, noisy), features, scale)
    grain = find_grain(low, noisy)
    return Explained(low, grain, *regress(low, grain, features, scale))


def find_features(guides: Tensor, scale: int) -> list[Feature]:
    """Log albedo and the three components of the normal."""
    albedo, normal = guides[:, :3] + ALBEDO_EPSILON, guides[:, 3:6]
    low_albedo, low_normal = (F.avg_pool2d(x, scale) for x in (albedo, normal))
    components = zip(normal.split(1, dim=1), low_normal.split(1, dim=1), strict=True)
    return [
        Feature(albedo.log(), low_albedo.log(), 0.005, (0.0, 1.0)),
        *(Feature(full, low, 0.01, (-3.0, 3.0)) for full, low in components),
    ]


def find_grain(radiance: Tensor, noisy: Tensor) -> Tensor:
    """Return what a denoiser took away, relative to what it left, within bounds.

    Parameters
    ----------
    radiance, noisy : (B, 3, h, w) Tensor
        After and before denoising; linear, in units of k e x.

    Returns
    -------
    grain : (B, 3, h, w) Tensor
    """
    ratio = (noisy + RADIANCE_FLOOR) / (radiance + RADIANCE_FLOOR)
    return (ratio - 1).clamp(-1.0, GRAIN_LIMIT)


def restore(
    radiance: Tensor, grain: Tensor, features: list[Feature], scale: int
) -> Tensor:
    """Restore the texture that a denoiser at low resolution has mistaken for noise.

    The grain still has that texture. The mean around every pixel stays.

    Parameters
    ----------
    radiance : (B, 3, h, w) Tensor
        Linear radiance, in units of k e x.
    grain : (B, 3, h, w) Tensor
        What the denoiser took away: see `find_grain`.
    features : list of Feature
        The guides.
    scale : int
        Output pixels per low-resolution pixel along one axis.

    Returns
    -------
    restored : (B, 3, h, w) Tensor
        Radiance with what the guides explain of its grain.
    """
    slopes = blur(fit(grain, features, NOISE * scale)).split(1, dim=1)
    terms = (
        slope * (feature.low - blur(feature.low))
        for slope, feature in zip(slopes, features, strict=True)
    )
    texture = sum(terms, torch.zeros_like(radiance))
    restored = radiance * texture.clamp(-RESTORED_LIMIT, RESTORED_LIMIT).exp()
    return restored * (blur(radiance) / blur(restored).clamp(min=LEAST_MEAN))


def regress(
    radiance: Tensor, grain: Tensor, features: list[Feature], scale: int
) -> tuple[Tensor, Tensor]:
    """Return what the guides explain of the radiance, and the slopes of the fit.

    The slopes are common to the colour channels, so grey stays grey. To first order log
    radiance and grain add up to the log of the noisy radiance, without the bias of a
    logarithm of noise.

    Parameters
    ----------
    radiance : (B, 3, h, w) Tensor
        Linear radiance, in units of k e x.
    grain : (B, 3, h, w) Tensor
        What a denoiser took away: see `find_grain`.
    features : list of Feature
        The guides.
    scale : int
        Output pixels per low-resolution pixel along one axis.

    Returns
    -------
    factor : (B, 3, H, W) Tensor
        albedo^a exp(n . w), positive, with the slopes a and w.
    slopes : (B, 4, h, w) Tensor
        a and w.
    """
    target = (radiance + RADIANCE_FLOOR).log() + grain
    slopes = blur(fit(target, features, NOISE * scale))
    enlarged = F.interpolate(slopes, scale_factor=scale, mode="bilinear")
    terms = (
        slope * feature.full
        for slope, feature in zip(enlarged.split(1, dim=1), features, strict=True)
    )
    return sum(terms, torch.zeros_like(enlarged[:, :1])).exp(), slopes


def fit(target: Tensor, features: list[Feature], noise: float) -> Tensor:
    """Fit the slopes of a target by each feature.

    Where a feature has three channels, they are samples of one variable: each channel
    of the target goes with its own.

    Parameters
    ----------
    target : (B, 3, h, w) Tensor
        What is regressed.
    features : list of Feature
        What it is regressed on.
    noise : float
        Unexplained variance that doubles the ridge.

    Returns
    -------
    slopes : (B, features, h, w) Tensor
    """
    count = len(features)
    x = [*(feature.low for feature in features), target]
    pairs = [(i, j) for i in range(count + 1) for j in range(i, count + 1)]
    sums = blur(torch.cat([*mean_products(x, pairs), *x], dim=1))
    channels = [1] * len(pairs) + [plane.shape[1] for plane in x]
    blurred = sums.split(channels, dim=1)
    moments, means = blurred[: len(pairs)], blurred[len(pairs) :]
    covariance = {
        pair: moment - product
        for pair, moment, product in zip(
            pairs, moments, mean_products(means, pairs), strict=True
        )
    }

    def ridged(unexplained: Tensor | float) -> list[Tensor]:
        diagonal = {
            (i, i): covariance[i, i] + feature.ridge * (1 + unexplained / noise)
            for i, feature in enumerate(features)
        }
        return solve(covariance | diagonal, count)

    # what is left to chance sets how far chance may have made up the slopes
    terms = (slope * covariance[i, count] for i, slope in enumerate(ridged(0.0)))
    variance = covariance[count, count]
    slopes = ridged((variance - sum(terms, torch.zeros_like(variance))).clamp(min=0))
    clamped = (
        slope.clamp(*feature.slope)
        for slope, feature in zip(slopes, features, strict=True)
    )
    return torch.cat(list(clamped), dim=1)


def mean_products(
    x: Sequence[Tensor], pairs: Sequence[tuple[int, int]]
) -> list[Tensor]:
    """Means over the channels of x[i] x[j], of one or three each: (B, 1, h, w)."""
    means = [mean(planes) for planes in x]
    return [
        mean(x[i] * x[j]) if x[i].shape[1] == x[j].shape[1] else means[i] * means[j]
        for i, j in pairs
    ]


def mean(x: Tensor) -> Tensor:
    """(B, C, h, w) to (B, 1, h, w)."""
    if x.shape[1] == 1:
        return x
    # adding planes is several times faster than torch's mean over few of them
    planes = x.split(1, dim=1)
    return sum(planes[1:], planes[0]) / len(planes)


def solve(matrix: dict[tuple[int, int], Tensor], size: int) -> list[Tensor]:
    """Solve a positive definite system at every pixel.

    Elimination works on whole planes: a batched solver would call LAPACK once for each
    pixel.

    Parameters
    ----------
    matrix : dict of (int, int) to Tensor
        The planes [i, j], i <= j, of the system and, as j = `size`, of its right side.
    size : int
        Number of unknowns.

    Returns
    -------
    solution : list of Tensor
        A plane for each unknown.
    """
    rows = dict(matrix)
    for k in range(size):
        for i in range(k + 1, size):
            factor = rows[k, i] / rows[k, k]
            for j in range(i, size + 1):
                rows[i, j] = rows[i, j] - factor * rows[k, j]
    solution: list[Tensor] = []
    for k in reversed(range(size)):
        known = zip(range(k + 1, size), reversed(solution), strict=True)
        rest = sum((rows[k, j] * x for j, x in known), torch.zeros_like(rows[k, k]))
        solution.append((rows[k, size] - rest) / rows[k, k])
    return solution[::-1]


def blur(x: Tensor) -> Tensor:
    """Every plane of (B, C, h, w) through a 5 x 5 tent, edge clamped."""
    for axis in (2, 3):
        ends = [x.narrow(axis, i, 1) for i in (0, x.shape[axis] - 1)]
        padded = torch.cat((*2 * ends[:1], x, *2 * ends[1:]), dim=axis)
        taps = [padded.narrow(axis, k, x.shape[axis]) for k in range(5)]
        x = taps[0] + taps[4]
        x = x.add_(taps[1], alpha=2).add_(taps[3], alpha=2).add_(taps[2], alpha=3)
        x = x.div_(9)
    return x
