"""What training is judged by: whole windows, as they were rendered and lit anew.

Lit anew, demodulation is exact but for the noise of the guides: what a network loses
there is texture that it blurs. Both sets are the same at every validation.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
import torch
from torch import Tensor

from ..baselines import bicubic
from ..front_end import demodulated_base, inverse_transfer
from ..metrics import psnr
from .data import Batch, Variation, draw
from .windows import WindowSet

SETS = {"rendered": Variation(), "shaded": Variation(shaded=1.0)}
METHODS = ("xrds", "bicubic", "demodulated")


@dataclass
class Scores:
    """PSNR in dB of every window, at the exposure of its low-resolution picture."""

    psnr: dict[str, dict[str, list[float]]] = field(
        default_factory=lambda: {s: {m: [] for m in METHODS} for s in SETS}
    )
    """By set and method."""

    def means(self) -> dict[str, dict[str, float]]:
        """Mean PSNR by set and method."""
        return {
            name: {method: float(np.mean(values)) for method, values in rows.items()}
            for name, rows in self.psnr.items()
        }

    def gains(self, name: str) -> np.ndarray:
        """dB over the better of bicubic and demodulated, for each window of a set."""
        xrds, *others = (np.array(self.psnr[name][method]) for method in METHODS)
        return xrds - np.maximum(*others)

    def gain(self) -> float:
        """The mean gain over all windows of both sets: what weights are chosen by."""
        return float(np.mean([self.gains(name) for name in SETS]))


def validate(
    forward: Callable[[Batch], Tensor],
    windows: WindowSet,
    count: int,
    scale: int,
    guides: str,
) -> Scores:
    """Score `forward` on `count` windows spread over the split."""
    scores = Scores()
    with torch.inference_mode():
        for name, variation in SETS.items():
            for batch in batches(windows, count, scale, guides, variation):
                reference = to_picture(batch.reference)
                for method, picture in pictures(forward, batch).items():
                    scores.psnr[name][method].append(psnr(picture, reference))
    return scores


def batches(
    windows: WindowSet, count: int, scale: int, guides: str, variation: Variation
) -> Iterator[Batch]:
    """Whole windows, the same ones and the same renders of them each time."""
    count = min(count, len(windows))
    for i in range(count):
        window = windows[i * len(windows) // count]
        yield draw(window, scale, guides, variation, np.random.default_rng(i))


def pictures(forward: Callable[[Batch], Tensor], batch: Batch) -> dict[str, np.ndarray]:
    """The picture of every method, linear at the exposure of the batch."""
    low, albedo = to_picture(batch.radiance), batch.guides[0, :3].permute(1, 2, 0)
    scale = batch.reference.shape[-1] // batch.radiance.shape[-1]
    return {
        "xrds": to_picture(forward(batch).cpu()),
        "bicubic": bicubic(low, scale),
        "demodulated": demodulated_base(low, albedo.numpy(), scale),
    }


def to_picture(t: Tensor) -> np.ndarray:
    """(1, 3, H, W) in the transfer domain to linear (H, W, 3)."""
    return inverse_transfer(t.float(), 1.0)[0].permute(1, 2, 0).numpy()
