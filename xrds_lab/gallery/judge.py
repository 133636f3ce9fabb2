"""The rule: no block of a picture may be worse than the frame alone.

Both have the same samples of their own; two references of independent noise judge
them. The mean of (x - R)(x - S) is the squared error of x without the noise of R and S.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from xrds_core.accumulation.local_filters import block_means
from xrds_core.arrays import Array

from ..metrics import squared_error, to_srgb

BLOCK = 32  # pixels
UNSEEN = 1e-5
"""Squared error that nobody sees, 50 dB; added on both sides before blocks compare."""
BARE = 1e-7
"""The same where what is not seen counts as well."""
LOSS, WORST_LOSS, SHARE = 1.0, 2.0, 0.01
"""The rule: at most SHARE of the blocks lose more than LOSS dB, none WORST_LOSS."""
_OPAQUE = 0.9999


@dataclass(frozen=True)
class Verdict:
    """A picture against the frame alone: gains in dB, of the frame and of its blocks.

    `share` of the blocks lose more than LOSS; `place` is the (row, column) in pixels of
    the worst one. `bare_worst` and `bare_share` count invisible errors, too.
    """

    gain: float
    worst: float
    share: float
    bare_worst: float
    bare_share: float
    psnr: float
    psnr_alone: float
    place: tuple[int, int]

    @property
    def passed(self) -> bool:
        """Whether it keeps the rule."""
        return keeps_rule(self.gain, self.worst, self.share)


def keeps_rule(gain: float, worst: float, share: float) -> bool:
    """Whether a picture keeps the rule; gains in dB, of the frame and of its blocks."""
    return share <= SHARE and worst >= -WORST_LOSS and round(gain, 2) >= 0.0


def compare(picture: Array, alone: Array, references: Sequence[Array]) -> Verdict:
    """Judge display values (H, W, C) against those of the frame alone."""
    ours, theirs = (squared_error(x, references) for x in (picture, alone))
    seen = block_gains(ours, theirs, UNSEEN)
    bare = block_gains(ours, theirs, BARE)
    row, column = np.unravel_index(int(seen.argmin()), seen.shape)
    return Verdict(
        gain=float(_decibels(theirs.mean(), ours.mean(), BARE)),
        worst=float(seen.min()),
        share=float((seen < -LOSS).mean()),
        bare_worst=float(bare.min()),
        bare_share=float((bare < -LOSS).mean()),
        psnr=_psnr(ours),
        psnr_alone=_psnr(theirs),
        place=(int(row) * BLOCK, int(column) * BLOCK),
    )


def block_gains(ours: Array, theirs: Array, unseen: float) -> Array:
    """Gain in dB of each block, from squared errors (H, W) of both pictures."""
    return _decibels(*(block_means(x, BLOCK) for x in (theirs, ours)), unseen)


def _decibels(before: Any, after: Any, unseen: float) -> Any:
    """Errors below 0 are noise around 0."""
    before, after = (np.maximum(x, 0.0) + unseen for x in (before, after))
    return 10.0 * np.log10(before / after)


def _psnr(error: Array) -> float:
    return float(-10.0 * np.log10(max(float(error.mean()), BARE)))


def judge(
    picture: Array, alone: Array, references: Sequence[Array]
) -> dict[str, Verdict]:
    """Verdicts on colour and, where a reference has holes, alpha.

    Radiance and alpha (H, W, 4), as stored: colours over black.
    """
    shown, single, *truth = (to_srgb(x[..., :3]) for x in (picture, alone, *references))
    verdicts = {"colour": compare(shown, single, truth)}
    if min(float(r[..., 3].min()) for r in references) < _OPAQUE:
        shown, single, *truth = (x[..., 3:] for x in (picture, alone, *references))
        verdicts["alpha"] = compare(shown, single, truth)
    return verdicts


def unsteadiness(before: Array, now: Array, after: Array) -> float:
    """How much three pictures jump, in sRGB: what does not run on evenly.

    The median over pixels of the second difference, so that what moves in a part of
    the picture does not count; of pictures of a camera that stands still.
    """
    first, second, third = (to_srgb(x[..., :3]) for x in (before, now, after))
    return float(np.median(np.abs(first - 2 * second + third)))
