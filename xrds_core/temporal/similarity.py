"""Similarity weights: how far the neighbours show what the frame itself shows.

The neighbours' mean L and the frame's own mean m differ by the error of L and by the
noise of m. `noise` estimates how much of (m - L) squared is noise; the rest, averaged
over a few pixels, is the squared error of L, whatever its cause: no list of what may
move or change is needed. The smaller this error E is against V, the variance of the
frame's own light, the more the neighbours count: V / (V + E) minimises the squared
error. E is multiplied by a penalty, since a denoiser removes most of V and nothing of
E.

Guides have little noise and show errors at once. Light that changes where guides do
not, as a moving shadow, is hidden by the frame's own noise; there the neighbours are
compared with each other.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .half_floats import floats
from .noise import guides_of

if TYPE_CHECKING:
    from .frame import Stored

# Penalties: factors on errors seen in guides, and on light that changes, against the
# noise of light. They are divided by the frame's samples per pixel, since a denoiser
# removes less noise the more samples there are, down to a least one: that of guides is
# high, as errors of many neighbours add up where waves or glass show something else.
_GUIDES, _LEAST_GUIDES = 512.0, 32.0
_CHANGES, _LEAST_CHANGES = 256.0, 4.0
# (samples per pixel up to, pixels across): over how many pixels errors of guides are
# averaged. Half buffers of few samples say little about one pixel.
_GUIDE_AREAS = ((4.0, 9), (np.inf, 5))
# Squared, summed over the channels: below this albedo the ratio of light to albedo is
# taken from the whole frame.
_DARKEST_ALBEDO = 0.02
MARGIN = 12
"""Pixels on each side of a pixel that influence its weight."""


def light_for_albedo(frame: Stored) -> float:
    """Return the squared error of light's square root per squared error of albedo.

    A relative error of albedo is the same relative error of light, and half as much of
    its square root. The mean over a frame.
    """
    assert frame.noise is not None
    light = float(floats(frame.noise.brightness[::7]).mean(dtype=np.float64)) ** 2 / 4
    albedo = guides_of(floats(frame.picture[::7, 3:]))[:, :3]
    squares = float(np.square(albedo).sum(axis=-1).mean(dtype=np.float64))
    return light / (squares + _DARKEST_ALBEDO)


def penalties(samples: float) -> tuple[np.float32, np.float32]:
    """Return those of errors seen in guides, and of light that changes."""
    guides = max(_GUIDES / samples, _LEAST_GUIDES)
    changes = max(_CHANGES / samples, _LEAST_CHANGES)
    return np.float32(guides), np.float32(changes)


def guide_area(samples: float) -> int:
    """Return over how many pixels across errors of guides are averaged."""
    return next(area for most, area in _GUIDE_AREAS if samples <= most)
