"""Noise of some samples taken out of albedo and normal by Open Image Denoise.

The picture keeps what noise its guides have, on metal and glass above all. Guides of
very few samples go through a small network instead (`guide_filter`): it takes a quarter
of the seconds, and they are few where seconds are.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING

from .arrays import Array
from .errors import XRDSError
from .guide_filter import FEW_SAMPLES

if TYPE_CHECKING:
    from .denoising import Denoiser
    from .progress import Callback

NOISY_SAMPLES = 16
"""Guides of fewer samples per pixel are denoised: at 4 the picture gains 0.05 to 0.8
dB, at 8 still 0.06 on the mean, and no scene loses more than 0.02."""

Quiet = Callable[[Array, Array], tuple[Array, Array]]


def is_noisy(samples: int | None) -> bool:
    """Whether guides of so many samples are denoised; None are as many as is wished."""
    return samples is not None and FEW_SAMPLES <= samples < NOISY_SAMPLES


def remover(
    samples: int | None,
    device: str,
    memory_limit: int | None = None,
    progress: Callback | None = None,
) -> Quiet | None:
    """What takes the noise out of albedo and normal (H, W, 3) of so many samples.

    None where there is none to take out so, or the library is missing. `progress` is
    called with 0 as long as it works; False cancels.
    """
    if not is_noisy(samples):
        return None
    denoiser = _denoiser("cpu" if device == "cpu" else "auto", memory_limit)
    if denoiser is None:
        return None
    alive = None if progress is None else lambda _: progress(0.0)
    return lambda albedo, normal: denoiser.guides(albedo, normal, progress=alive)


@lru_cache(maxsize=1)
def _denoiser(device: str, memory_limit: int | None) -> Denoiser | None:
    from .denoising import Denoiser

    try:
        return Denoiser("high", device, memory_limit=memory_limit)
    except XRDSError:
        return None
