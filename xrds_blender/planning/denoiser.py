"""Who denoises, and how: Cycles in its modes, or XRDS in its qualities."""

from __future__ import annotations

from enum import StrEnum


class Denoiser(StrEnum):
    """Cycles' OpenImageDenoise as QUALITY-PREFILTER, or ours as XRDS-QUALITY."""

    HIGH_ACCURATE = "HIGH-ACCURATE"
    HIGH_FAST = "HIGH-FAST"
    HIGH_NONE = "HIGH-NONE"
    BALANCED_ACCURATE = "BALANCED-ACCURATE"
    BALANCED_FAST = "BALANCED-FAST"
    BALANCED_NONE = "BALANCED-NONE"
    FAST_ACCURATE = "FAST-ACCURATE"
    FAST_FAST = "FAST-FAST"
    FAST_NONE = "FAST-NONE"
    XRDS_BEST = "XRDS-BEST"
    XRDS_HIGH = "XRDS-HIGH"
    XRDS_MEDIUM = "XRDS-MEDIUM"
    XRDS_BALANCED = "XRDS-BALANCED"
    XRDS_FAST = "XRDS-FAST"

    @property
    def is_ours(self) -> bool:
        """Whether XRDS denoises, in this process."""
        return self.value.startswith("XRDS-")

    @property
    def quality(self) -> str:
        """HIGH, BALANCED or FAST, as Cycles says it; best to fast of ours."""
        first, _, second = self.value.partition("-")
        return second.lower() if self.is_ours else first

    @property
    def prefilter(self) -> str:
        """How Cycles treats the guides: ACCURATE, FAST or NONE; empty for ours."""
        return "" if self.is_ours else self.value.partition("-")[2]


CYCLES_DENOISERS = tuple(mode for mode in Denoiser if not mode.is_ours)
OUR_DENOISERS = tuple(mode for mode in Denoiser if mode.is_ours)
DEFAULT_DENOISER = Denoiser.HIGH_ACCURATE
"""Blender's own default."""
LOW_DENOISERS = (
    Denoiser.HIGH_ACCURATE,
    Denoiser.HIGH_FAST,
    Denoiser.BALANCED_ACCURATE,
)
"""Those worth trying on the low-resolution picture."""
