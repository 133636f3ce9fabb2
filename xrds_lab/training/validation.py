"""What training is judged by: whole windows, as they were rendered and lit anew.

Lit anew, demodulation is exact but for the noise of the guides: what a network loses
there is texture that it blurs. Both sets are the same at every validation.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from xrds_core.arrays import Array
from xrds_core.superres.front_end import demodulated_base, inverse_transfer

from ..baselines import bicubic
from ..metrics import psnr
from .crop import Batch
from .data import Variation, draw
from .windows import WindowSet

SETS = {"rendered": Variation(), "shaded": Variation(shaded=1.0)}
SHOWN = (0.0, 0.5, 1.0)  # of the windows of a set, first to last
METHODS = ("xrds", "bicubic", "demodulated")

Pictures = dict[str, Array]


@dataclass(frozen=True)
class Score:
    """PSNR in dB of each method on one window, at its low-resolution exposure."""

    set_name: str
    index: int
    psnr: dict[str, float]

    @property
    def gain(self) -> float:
        """dB over the better of bicubic and demodulated."""
        return self.psnr["xrds"] - max(self.psnr["bicubic"], self.psnr["demodulated"])


def summary(scores: Sequence[Score]) -> dict[str, Any]:
    """What the statistics keep: weights are chosen by `gain`, the mean over all."""
    by_set = {name: [s for s in scores if s.set_name == name] for name in SETS}
    return {
        "gain": mean([s.gain for s in scores]),
        "gains": {name: mean([s.gain for s in some]) for name, some in by_set.items()},
        "worst": {name: min(s.gain for s in some) for name, some in by_set.items()},
        "psnr": {
            name: {method: mean([s.psnr[method] for s in some]) for method in METHODS}
            for name, some in by_set.items()
        },
    }


def mean(values: Sequence[float]) -> float:
    """The mean as a plain float."""
    return float(np.mean(values))


def in_order(scores: Iterable[Score]) -> list[Score]:
    """Sorted by set and window, whichever process scored them."""
    return sorted(scores, key=lambda s: (s.set_name, s.index))


class Validation:
    """The windows to score: `count` spread over the split, the same ones each time."""

    def __init__(self, windows: WindowSet, count: int, scale: int) -> None:
        count = min(count, len(windows))
        self._windows = windows
        self._chosen = [i * len(windows) // count for i in range(count)]
        self._scale = scale
        self.places = [(name, i) for name in SETS for i in range(count)]

    def batch(self, set_name: str, index: int) -> Batch:
        """One whole window; which renders and which light follows from the index."""
        window = self._windows[self._chosen[index]]
        random = np.random.default_rng(index)
        return draw(window, self._scale, SETS[set_name], random)

    def score(self, forward: Callable[[Batch], Tensor], name: str, index: int) -> Score:
        """Enlarge one window by every method."""
        row = pictures(forward, self.batch(name, index))
        psnrs = {method: psnr(row[method], row["reference"]) for method in METHODS}
        return Score(name, index, psnrs)

    def samples(self, forward: Callable[[Batch], Tensor]) -> list[Pictures]:
        """All pictures of some windows of each set, to look at."""
        last = len(self._chosen) - 1
        shown = sorted({round(last * part) for part in SHOWN})
        places = [(name, index) for name in SETS for index in shown]
        return [pictures(forward, self.batch(*place)) for place in places]


def pictures(forward: Callable[[Batch], Tensor], batch: Batch) -> Pictures:
    """All pictures of a window, linear at the exposure of the batch."""
    low, albedo = to_picture(batch.radiance), batch.guides[0, :3].permute(1, 2, 0)
    scale = batch.reference.shape[-1] // batch.radiance.shape[-1]
    with torch.inference_mode():
        output = forward(batch).cpu()
    return {
        "low-resolution": low,
        "bicubic": bicubic(low, scale),
        "demodulated": demodulated_base(low, albedo.numpy(), scale),
        "xrds": to_picture(output),
        "reference": to_picture(batch.reference),
    }


def to_picture(t: Tensor) -> Array:
    """(1, 3, H, W) in the transfer domain to linear (H, W, 3)."""
    return inverse_transfer(t.float(), 1.0)[0].permute(1, 2, 0).numpy()
