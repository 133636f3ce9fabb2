"""What a render is asked for, and what it returns."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from xrds_core.errors import UsageError, XRDSError

from ..planning.denoiser import CYCLES_DENOISERS, Denoiser
from ..planning.plan import SAVINGS, Decision, Facts, Plan, decide, full_size, plain

if TYPE_CHECKING:
    from xrds_core.arrays import Array

SCALES = (1, 2, 4, 8)
PRESETS = ("fast", "balanced", "paper")
QUALITIES = ("best", "high", "medium", "balanced", "fast")
_SAMPLES = 1 << 24  # the most that Cycles takes
_RANGES = {
    "samples": (1, _SAMPLES),
    "guide_samples": (1, _SAMPLES),
    "guide_limit": (0, _SAMPLES),
    "seed": (0, 2**31 - 1),
    "threads": (1, 1024),
    "temporal_radius": (0, 1000),
    "memory_limit": (0, 2**63 - 1),
    "exposure": (1e-30, 1e30),
}


@dataclass(frozen=True)
class RenderJob:
    """Everything that can be chosen about one render.

    `samples` and `seed` None leave Cycles' own; `exposure` None is found in the
    picture; `weights` is a folder of weights files or one file in place of the shipped
    ones; `memory_limit` in bytes and `threads` are the network's; `savings` names what
    the plan may leave out where the scene does not need it. `guide_cache` is a folder
    for guides beside those in memory; each render of the same view adds its samples to
    them until they are `guide_limit`.
    `denoiser` is a mode of Cycles' denoiser or its name, None the scene's own;
    `denoise` is the quality of ours, one of QUALITIES.
    `stop_keeps` leaves what there is in the result when the user stops the render.
    `temporal_radius` is how many frames before and after lend their samples, in a shot.
    With `time_budget` (seconds a frame) or `quality` (PSNR in dB) scale, samples,
    guides, network and denoiser are chosen anew for the scene.
    Raises UsageError on values out of range.
    """

    scale: int = 2
    samples: int | None = None
    guide_samples: int = 4
    preset: str = "fast"
    device: str = "auto"
    exposure: float | None = None
    seed: int | None = None
    plain: bool = False
    memory_limit: int | None = None
    weights: str | Path | None = None
    savings: tuple[str, ...] = SAVINGS
    guide_cache: str | Path | None = None
    guide_limit: int = 0
    denoiser: Denoiser | str | None = None
    denoise: str = "high"
    temporal_radius: int = 0
    time_budget: float | None = None
    quality: float | None = None
    threads: int | None = None
    stop_keeps: bool = False

    def __post_init__(self) -> None:
        if self.scale not in SCALES:
            known = ", ".join(map(str, SCALES))
            raise UsageError(f"scale {self.scale} is not one of {known}")
        for name, (least, most) in _RANGES.items():
            value = getattr(self, name)
            if value is not None and not least <= value <= most:
                raise UsageError(
                    f"{name} is {value}; it must be from {least} to {most}"
                )
        unknown = set(self.savings) - set(SAVINGS)
        if unknown:
            known = ", ".join(SAVINGS)
            raise UsageError(
                f"unknown savings {', '.join(sorted(unknown))}; choose from {known}"
            )
        if self.denoiser is not None:
            # The class is frozen; a name is as good as the mode it names.
            object.__setattr__(self, "denoiser", _denoiser(self.denoiser))
        if self.denoise not in QUALITIES:
            known = ", ".join(QUALITIES)
            raise UsageError(f"denoise {self.denoise!r} is not one of {known}")
        if self.time_budget is not None and not self.time_budget > 0:
            raise UsageError(f"time budget {self.time_budget} s must be above 0")
        if self.time_budget is not None and self.quality is not None:
            raise UsageError("give a time budget or a quality, not both")

    @property
    def is_picked(self) -> bool:
        """Whether what is rendered is still to be chosen."""
        return self.time_budget is not None or self.quality is not None

    @property
    def is_enlarged(self) -> bool:
        """Whether a network makes the picture."""
        return not self.plain and self.scale > 1

    def plan(self, facts: Facts | None = None) -> Plan:
        """What is decided for this job; at full size it rests on no facts."""
        if self.plain:
            return plain("as requested")
        if self.scale == 1:
            return full_size(self.denoise)
        assert facts is not None
        return decide(facts, self.savings)


def _denoiser(name: str) -> Denoiser:
    try:
        found = Denoiser(name)
        if found.is_ours:
            raise ValueError(name)
        return found
    except ValueError as error:
        known = ", ".join(CYCLES_DENOISERS)
        raise UsageError(f"denoiser {name!r} is not one of {known}") from error


class NetworkFailed(XRDSError):
    """The network failed; what Cycles rendered for it is kept.

    `radiance` (h, w, 3), premultiplied, and `alpha` (h, w): low resolution, as
    `Picture.low_resolution`; of a shot, of the frame `number`.
    """

    number: int | None = None

    def __init__(self, message: str, radiance: Array, alpha: Array) -> None:
        super().__init__(message)
        self.radiance, self.alpha = radiance, alpha


@dataclass(frozen=True)
class Temporal:
    """What neighbouring frames lent to a picture.

    `frames`: the numbers of those whose samples went in, its own too; `mean_samples`
    per pixel after accumulation; `rejected`: the share of the neighbours' samples that
    were left out.
    """

    radius: int
    frames: tuple[int, ...]
    mean_samples: float
    rejected: float


@dataclass(frozen=True)
class Picture:
    """A rendered region: arrays float32, scene-linear, row 0 on top.

    `radiance` (H, W, 3) is premultiplied by `alpha` (H, W); `albedo` and `normal`
    (H, W, 3) and `low_resolution` (h, w, 3) are None for a plain render. `seconds` by
    stage: total, sync, beauty, denoise, guides, network, write; Cycles does not tell
    its own denoising from sampling, so `beauty` holds both then. `peak_memory`
    is the largest in bytes that the process has taken so far; `device` is what the
    network ran on, empty for a plain render; `job` what was rendered, as a time budget
    chose it.
    """

    radiance: Array
    alpha: Array
    albedo: Array | None = None
    normal: Array | None = None
    low_resolution: Array | None = None
    seconds: dict[str, float] = field(default_factory=dict)
    plan: tuple[Decision, ...] = ()
    peak_memory: int = 0
    device: str = ""
    job: RenderJob | None = None
    temporal: Temporal | None = None

    @classmethod
    def of(cls, pixels: Array, **rest: Any) -> Picture:
        """The picture of radiance and alpha in one array (H, W, 4)."""
        import numpy as np  # here: Blender starts faster without it

        radiance, alpha = pixels[..., :3], pixels[..., 3]
        return cls(np.ascontiguousarray(radiance), np.ascontiguousarray(alpha), **rest)
