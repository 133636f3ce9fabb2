"""Non-local means over several frames: what Arnold's `noice` is, in small.

A pixel becomes the mean of those around it, in its own frame and the ones beside, whose
surroundings look alike: by noisy colour and its variance, and by albedo and normal.
Neither cameras nor motion are known to it: what moves is found by looking alike, within
the search window. After Rousselle, Manzi and Zwicker, "Robust Denoising using Feature
and Color Information" (2013), with guides cleaned by Open Image Denoise; the radii are
noice's defaults
(https://docs.arnoldrenderer.com/display/A5KTN/Denoiser+Attributes).
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch.nn.functional import avg_pool2d

from .rivals import clean_guides

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from torch import Tensor

    from xrds_core.accumulation.frame import Frame
    from xrds_core.arrays import Array

REACH = 1
"""Frames looked at before and after."""
SEARCH_RADIUS = 9
PATCH_RADIUS = 3
_VARIANCE_RADIUS = 2  # a difference of two halves tells little of a single pixel
# how alike: k of the paper's equations 3 and 6, and tau, the least variance of a
# feature; the paper's 0.45 and 0.001 leave 4 dB more error in the house at 16 samples
_COLOUR, _FEATURE, _LEAST = 1.0, 0.6, 0.01
_TINY = 1e-10

Slices = tuple[slice, ...]


def nl_means(frames: Mapping[int, Frame], number: int) -> Array:
    """Return the radiance (H, W, 3) of a frame, denoised with its neighbours.

    Every frame has half buffers. A neighbour that is not there is left out.
    """
    own = _Looked(frames[number])
    total, weights = torch.zeros_like(own.colour), torch.zeros_like(own.colour[:, :1])
    for beside in range(number - REACH, number + REACH + 1):
        if beside not in frames:
            continue
        other = own if beside == number else _Looked(frames[beside])
        for here, there in _shifts(own.colour.shape[-2:]):
            weight = own.alike(other, here, there)
            total[here] += weight * other.colour[there]
            weights[here] += weight
    return (total / weights)[0].movedim(0, -1).numpy()


class _Looked:
    """Colour, variance and features of a frame, each (1, C, H, W)."""

    def __init__(self, frame: Frame) -> None:
        assert frame.halves is not None
        assert frame.radiance is not None
        one, two = frame.halves.radiance
        share = np.asarray(frame.halves.share())
        share = share[..., None] if share.ndim else share
        self.colour = _planes(frame.radiance)
        noise = _planes((share * (1 - share) * (one - two) ** 2).astype(np.float32))
        self.variance = _mean(noise, _VARIANCE_RADIUS)
        guides = clean_guides(frame).values()
        self.features = _planes(np.concatenate(list(guides), axis=-1))

    def alike(self, other: _Looked, here: Slices, there: Slices) -> Tensor:
        """Weights (1, 1, H, W) of another frame's pixels at those of this one."""
        own, its = self.variance[here], other.variance[there]
        apart = (self.colour[here] - other.colour[there]) ** 2
        apart = apart - (own + torch.minimum(own, its))
        apart = apart / (_TINY + _COLOUR**2 * (own + its))
        colour = _mean(apart.mean(1, keepdim=True), PATCH_RADIUS).clamp_min(0)
        features = (self.features[here] - other.features[there]) ** 2
        feature = features.amax(1, keepdim=True) / (_FEATURE**2 * _LEAST)
        return torch.exp(-torch.maximum(colour, feature))


def _planes(array: Array) -> Tensor:
    return torch.from_numpy(np.ascontiguousarray(np.moveaxis(array, -1, 0)))[None]


def _mean(planes: Tensor, radius: int) -> Tensor:
    """The mean of the pixels around each."""
    return avg_pool2d(planes, 2 * radius + 1, 1, radius, count_include_pad=False)


def _shifts(size: tuple[int, int]) -> Iterator[tuple[Slices, Slices]]:
    """Pixels, and those so far beside them, for each place in the search window."""
    steps = range(-SEARCH_RADIUS, SEARCH_RADIUS + 1)
    for shift in product(steps, steps):
        ends = list(zip(shift, size, strict=True))
        here = [slice(max(-x, 0), n - max(x, 0)) for x, n in ends]
        there = [slice(max(x, 0), n - max(-x, 0)) for x, n in ends]
        yield (slice(None), slice(None), *here), (slice(None), slice(None), *there)
