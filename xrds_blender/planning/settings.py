"""How a frame is rendered: the one record of it, that everything else is keyed by."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import NamedTuple


class Network(NamedTuple):
    """What a weights file is for."""

    preset: str
    scale: int


class Mode(StrEnum):
    """What makes the picture; automatic is one of the others, for the scene at hand."""

    AUTOMATIC = "automatic"
    FULL_SIZE = "full_size"
    X2 = "x2"
    X4 = "x4"
    X8 = "x8"
    CYCLES_ONLY = "cycles_only"

    @property
    def scale(self) -> int:
        """Enlargement along each side."""
        return int(self.value[1:]) if self.is_enlarged else 1

    @property
    def is_enlarged(self) -> bool:
        """Whether a network makes the picture."""
        return self.value.startswith("x")

    @classmethod
    def of(cls, scale: int) -> Mode:
        """The mode of XRDS at a scale; raises ValueError where there is none."""
        return cls.FULL_SIZE if scale == 1 else cls(f"x{scale}")


MODES: tuple[Mode, ...] = tuple(mode for mode in Mode if mode is not Mode.AUTOMATIC)
"""In the order of the panel; of equally good ones the first is the best."""
SCALES = tuple(mode.scale for mode in MODES if mode is not Mode.CYCLES_ONLY)


class Denoising(StrEnum):
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

    @classmethod
    def ours(cls, quality: str) -> Denoising:
        """XRDS' own of a quality, best to fast; raises ValueError for others."""
        return cls(f"XRDS-{quality.upper()}")

    @property
    def is_ours(self) -> bool:
        """Whether XRDS denoises, in this process."""
        return self.value.startswith("XRDS-")

    @property
    def quality(self) -> str:
        """High, balanced or fast, as Cycles has it too; best to fast of ours."""
        first, _, second = self.value.partition("-")
        return (second if self.is_ours else first).lower()

    @property
    def prefilter(self) -> str:
        """How Cycles treats the guides: ACCURATE, FAST or NONE; empty for ours."""
        return "" if self.is_ours else self.value.partition("-")[2]


CYCLES_DENOISING = tuple(each for each in Denoising if not each.is_ours)
OUR_DENOISING = tuple(each for each in Denoising if each.is_ours)
QUALITIES = tuple(each.quality for each in OUR_DENOISING)
DEFAULT_DENOISING = Denoising.HIGH_ACCURATE
"""Blender's own default."""
LOW_DENOISING = (
    Denoising.HIGH_ACCURATE,
    Denoising.HIGH_FAST,
    Denoising.BALANCED_ACCURATE,
)
"""Those worth trying on the low-resolution picture."""


def counted(number: int | None, what: str) -> str:
    """A number of things, as 1 frame or 2 frames."""
    return f"1 {what}" if number == 1 else f"{number} {what}s"


@dataclass(frozen=True)
class Settings:
    """How a frame is rendered.

    `samples` per pixel, low-resolution ones where a network enlarges; None leaves
    Cycles' own. `denoising` is ours or Cycles'; where Cycles is alone, ours leaves what
    the scene has, and None is no denoising at all. `preset` names the network and
    `guide_samples` are per full-size pixel: both are for enlargements. In a shot,
    samples of `temporal_radius` frames before and after are reused, and `share` is how
    much of the samples a frame takes; with a noise threshold, of those it asks for.
    Under a still camera they `begin` after so many of the shot's; None is by its place.
    `strength` is how much neighbours count, 0 to 1; None leaves the scene's own.
    """

    mode: Mode = Mode.FULL_SIZE
    samples: int | None = None
    denoising: Denoising | None = Denoising.XRDS_HIGH
    preset: str = "fast"
    guide_samples: int = 4
    temporal_radius: int = 0
    share: float = 1.0
    begin: int | None = None
    strength: float | None = None

    @property
    def scale(self) -> int:
        """Enlargement along each side."""
        return self.mode.scale

    @property
    def own_samples(self) -> int | None:
        """Samples per pixel of its own; None where it takes the file's."""
        return None if self.samples is None else self.count(self.samples)

    def count(self, of_file: int) -> int:
        """Samples per pixel, of a file that has so many."""
        return max(1, round((self.samples or of_file) * self.share))

    @property
    def is_enlarged(self) -> bool:
        """Whether a network makes the picture."""
        return self.mode.is_enlarged

    @property
    def is_cycles_only(self) -> bool:
        """Whether Cycles makes the picture by itself."""
        return self.mode is Mode.CYCLES_ONLY

    @property
    def network(self) -> Network:
        """The network that an enlargement needs."""
        return Network(self.preset, self.scale)

    @property
    def cycles_denoising(self) -> Denoising | None:
        """The mode of Cycles that is requested; None leaves what the scene has."""
        requested = self.denoising
        return None if requested is None or requested.is_ours else requested

    @property
    def quality(self) -> str:
        """Of our denoiser, one of QUALITIES; that of Cycles' mode in its place."""
        return "high" if self.denoising is None else self.denoising.quality

    @property
    def family(self) -> Settings:
        """All but how many samples, and nothing that the mode does not use."""
        if self.is_enlarged:
            return replace(
                self, samples=None, temporal_radius=0, share=1.0, strength=None
            )
        return Settings(self.mode, None, self.denoising, "", 0)

    @property
    def kind(self) -> str:
        """What makes the picture, in words."""
        if self.is_enlarged:
            return "super-resolution"
        return "Cycles only" if self.is_cycles_only else "full size"

    @property
    def label(self) -> str:
        """In a few words, as the panel and the command print it."""
        samples = counted(self.samples, "sample")
        if self.mode is Mode.FULL_SIZE:
            return f"full size, {samples}, {self.quality} denoising"
        if self.is_cycles_only:
            return f"Cycles only, {samples}, OIDN {self.denoising}"
        return (
            f"{self.preset} x{self.scale}, {samples}, "
            f"{self.guide_samples} guide samples, OIDN {self.denoising}"
        )


def low_size(width: int, height: int, scale: int) -> tuple[int, int]:
    """Width and height of the small render."""
    return -(-width // scale), -(-height // scale)
