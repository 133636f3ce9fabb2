"""How a frame is packed in half floats, and the noise that its half buffers tell."""

from __future__ import annotations

import numpy as np

from tests.support.specification.filters import Array
from tests.support.specification.similarity import noise_of_guides
from xrds_core.accumulation.frame import Frame
from xrds_core.accumulation.noise import guides_of
from xrds_core.accumulation.noise import luminance as of

LARGEST_HALF = 65504.0
LIMIT = np.float32(4.0)  # of guides


def halves_of(x: Array, kept: Array | None = None) -> Array:
    """The nearest finite half floats; 0 for NaN, and where nothing is `kept`."""
    x = np.nan_to_num(np.clip(x, -LARGEST_HALF, LARGEST_HALF), nan=0.0)
    return (x if kept is None else np.where(kept, x, 0.0)).astype(np.float16)


def picture(frame: Frame) -> tuple[Array, Array]:
    """All passes (H W, C), and which pixels are invalid (H W)."""
    passes = _joined(frame, frame.radiance, frame.albedo, frame.normal)
    invalid = ~np.isfinite(passes).all(axis=-1)
    return halves_of(passes, ~invalid[:, None]), invalid


def light(frame: Frame) -> Array:
    """Brightness and difference (H W, 2) of half buffers; NaN counts as no light."""
    assert frame.halves is not None
    _, invalid = picture(frame)
    with np.errstate(all="ignore"):  # of infinities
        one, two = np.sqrt(np.fmax(of(_floats(frame.halves.radiance)), 0))
        share = _floats(frame.halves.share())
        spread = np.sqrt(share * (1 - share))
        both = np.stack([(one + two) / 2, (one - two) * spread], axis=-1)
    return halves_of(both.reshape(-1, 2), ~invalid[:, None])


def guides(frame: Frame) -> Array:
    """The standard deviation (H W) of the noise of guides; NaN is below all else."""
    _, invalid = picture(frame)
    passes = _joined(frame, frame.albedo, frame.normal)
    limited = np.fmax(guides_of(passes), -LIMIT).reshape(*frame.shape, -1)
    return halves_of(noise_of_guides(limited, frame.samples).ravel(), ~invalid)


def _joined(frame: Frame, *passes: Array | None) -> Array:
    given = [x for x in passes if x is not None]
    if frame.alpha is not None:
        given.append(frame.alpha[..., None])
    return _floats(np.concatenate(given, axis=-1)).reshape(-1, sum(map(_deep, given)))


def _deep(x: Array) -> int:
    return int(x.shape[-1])


def _floats(x: Array) -> Array:
    return np.asarray(x, np.float32)
