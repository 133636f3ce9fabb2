"""Noise of some samples taken out of albedo and normal by Open Image Denoise.

The picture keeps what noise its guides have, on metal and glass above all. Guides of
very few samples go through a small network instead (`guide_filter`): it takes a quarter
of the seconds, and they are few where seconds are.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Array
from ..errors import XRDSError
from .guide_filter import FEW_SAMPLES

if TYPE_CHECKING:
    from ..denoising import Denoiser
    from ..progress import Callback

NOISY_SAMPLES = 16
"""Guides of fewer samples per pixel are denoised: at 4 the picture gains 0.05 to 0.8
dB, at 8 still 0.06 on the mean, and no scene loses more than 0.02."""

KEPT_BYTES = 512 << 20
"""Of denoised guides, kept for the next picture of the same ones."""

Quiet = Callable[[Array, Array], tuple[Array, Array]]


@dataclass
class _Kept:
    """The guides denoised last, known by a checksum of what they were made of.

    A view that is rendered again has the same guides, and they take longer than the
    network.
    """

    checksum: bytes = b""
    guides: tuple[Array, Array] | None = None

    def of(self, checksum: bytes) -> tuple[Array, Array] | None:
        """Those of a checksum, if they are kept."""
        return self.guides if self.checksum == checksum else None

    def keep(self, checksum: bytes, guides: tuple[Array, Array]) -> None:
        """Keep guides in place of others, but not too large ones."""
        small = sum(guide.nbytes for guide in guides) <= KEPT_BYTES
        self.checksum, self.guides = (checksum, guides) if small else (b"", None)


_KEPT = _Kept()


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
    device = "cpu" if device == "cpu" else "auto"
    denoiser = _denoiser(device, memory_limit)
    if denoiser is None:
        return None
    alive = None if progress is None else lambda _: progress(0.0)

    def quiet(albedo: Array, normal: Array) -> tuple[Array, Array]:
        checksum = _checksum(albedo, normal, device)
        found = _KEPT.of(checksum)
        if found is None:
            found = denoiser.guides(albedo, normal, progress=alive)
            _KEPT.keep(checksum, found)
        return found

    return quiet


def _checksum(albedo: Array, normal: Array, device: str) -> bytes:
    result = hashlib.sha256(f"{albedo.shape} {device}".encode())
    for guide in (albedo, normal):
        result.update(np.ascontiguousarray(guide).data)
    return result.digest()


@lru_cache(maxsize=1)
def _denoiser(device: str, memory_limit: int | None) -> Denoiser | None:
    from ..denoising import Denoiser

    try:
        return Denoiser("high", device, memory_limit=memory_limit)
    except XRDSError:
        return None
