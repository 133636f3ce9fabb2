"""Cycles' denoiser (OpenImageDenoise) in its modes."""

from __future__ import annotations

from enum import StrEnum


class Denoiser(StrEnum):
    """Quality and prefilter of the guides, as Cycles names them."""

    HIGH_ACCURATE = "HIGH-ACCURATE"
    HIGH_FAST = "HIGH-FAST"
    HIGH_NONE = "HIGH-NONE"
    BALANCED_ACCURATE = "BALANCED-ACCURATE"
    BALANCED_FAST = "BALANCED-FAST"
    BALANCED_NONE = "BALANCED-NONE"
    FAST_ACCURATE = "FAST-ACCURATE"
    FAST_FAST = "FAST-FAST"
    FAST_NONE = "FAST-NONE"

    @property
    def quality(self) -> str:
        """HIGH, BALANCED or FAST."""
        return self.value.partition("-")[0]

    @property
    def prefilter(self) -> str:
        """ACCURATE, FAST or NONE."""
        return self.value.partition("-")[2]


DEFAULT_DENOISER = Denoiser.HIGH_ACCURATE
"""Blender's own default."""
LOW_DENOISERS = (
    Denoiser.HIGH_ACCURATE,
    Denoiser.HIGH_FAST,
    Denoiser.BALANCED_ACCURATE,
)
"""Those worth trying on the low-resolution picture."""
