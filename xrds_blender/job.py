"""What a render is asked for, and what it returns."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from xrds_core.errors import UsageError, XRDSError

from .budget import DENOISERS
from .plan import OMISSIONS, Decision, Facts, Plan, decide, plain

if TYPE_CHECKING:
    from .cycles_session import Array

SCALES = (1, 2, 4, 8)
STAGES = ("total", "sync", "beauty", "denoise", "guides", "network", "write")


@dataclass(frozen=True)
class RenderJob:
    """Everything that can be chosen about one render.

    `samples` and `seed` None leave Cycles' own; `exposure` None is found in the
    picture; `weights` is a folder of presets or a file in place of the shipped;
    `memory_limit` in bytes and `threads` are the network's; `keep` names omissions of
    the plan that are not to be made. `guide_cache` is a folder for guides beside those
    in memory; each render of the same view adds its samples to them until they are
    `guide_limit`.
    `denoiser` is one of budget.DENOISERS, None the scene's own. With `time_budget`
    (seconds a frame) or `quality` (PSNR in dB) scale, samples, guides, network and
    denoiser are chosen anew for the scene.
    Raises UsageError on values out of range.
    """

    scale: int = 2
    samples: int | None = None
    guide_samples: int = 4
    guides: str = "fast"
    preset: str = "fast"
    device: str = "auto"
    exposure: float | None = None
    seed: int | None = None
    plain: bool = False
    memory_limit: int | None = None
    weights: str | Path | None = None
    keep: tuple[str, ...] = ()
    guide_cache: str | Path | None = None
    guide_limit: int = 0
    denoiser: str | None = None
    time_budget: float | None = None
    quality: float | None = None
    threads: int | None = None

    def __post_init__(self) -> None:
        if self.scale not in SCALES:
            known = ", ".join(map(str, SCALES))
            raise UsageError(f"scale {self.scale} is not one of {known}")
        for name in ("samples", "guide_samples", "threads"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise UsageError(f"{name} {value} is below 1")
        unknown = set(self.keep) - set(OMISSIONS)
        if unknown:
            known = ", ".join(OMISSIONS)
            raise UsageError(f"cannot keep {sorted(unknown)}; there are {known}")
        if self.denoiser not in {None, *DENOISERS}:
            known = ", ".join(DENOISERS)
            raise UsageError(f"denoiser {self.denoiser!r} is not one of {known}")
        if self.time_budget is not None and not self.time_budget > 0:
            raise UsageError(f"time budget {self.time_budget} s is not above 0")
        if self.time_budget is not None and self.quality is not None:
            raise UsageError("give a time budget or a quality, not both")

    @property
    def is_picked(self) -> bool:
        """Whether what is rendered is still to be chosen."""
        return self.time_budget is not None or self.quality is not None

    @property
    def denoising(self) -> dict[str, str | None]:
        """Quality and prefilter of the denoiser, None for the scene's own."""
        quality, _, prefilter = (self.denoiser or "").partition("-")
        return {"quality": quality or None, "prefilter": prefilter or None}

    @property
    def is_plain(self) -> bool:
        """Whether Cycles renders alone."""
        return self.plain or self.scale == 1

    def plan(self, facts: Facts | None = None) -> Plan:
        """What is decided for this job; plain ones rest on no facts."""
        if self.is_plain:
            reason = "asked for" if self.plain else "scale 1 leaves nothing to enlarge"
            return plain(reason)
        assert facts is not None
        return decide(facts, self.keep)

    @classmethod
    def of(cls, settings: Any) -> RenderJob:
        """The job that a scene's `xrds` settings and the preferences describe."""
        from .preferences import machine

        here = machine()
        return cls(
            scale=int(settings.scale),
            guide_samples=settings.guide_samples,
            guides=settings.guides,
            preset=settings.preset,
            device=here.device if settings.device == "auto" else settings.device,
            exposure=settings.exposure if settings.use_exposure else None,
            plain=settings.plain,
            time_budget=settings.time_budget if settings.use_time_budget else None,
            memory_limit=here.memory_limit,
            weights=here.weights,
            threads=here.threads,
        )


class NetworkFailed(XRDSError):
    """The network gave no picture; what Cycles rendered for it is kept.

    `radiance` (h, w, 3), premultiplied, and `alpha` (h, w): low resolution, as
    `Picture.low_resolution`.
    """

    def __init__(self, message: str, radiance: Array, alpha: Array) -> None:
        super().__init__(message)
        self.radiance, self.alpha = radiance, alpha


@dataclass(frozen=True)
class Picture:
    """A rendered region: arrays float32, scene-linear, row 0 on top.

    `radiance` (H, W, 3) is premultiplied by `alpha` (H, W); `albedo` and `normal`
    (H, W, 3) and `low_resolution` (h, w, 3) are None for a plain render. `seconds` by
    stage: total, sync, beauty, denoise, guides, network, write; Cycles does not tell
    denoising from sampling, so `beauty` holds both and `denoise` is 0. `peak_memory`
    is the largest in bytes that the process has taken so far; `device` is what the
    network ran on, empty for a plain render; `job` what was rendered, as a time budget
    chose it.
    """

    radiance: Array
    alpha: Array
    albedo: Array | None
    normal: Array | None
    low_resolution: Array | None
    seconds: dict[str, float] = field(default_factory=dict)
    plan: tuple[Decision, ...] = ()
    peak_memory: int = 0
    device: str = ""
    job: RenderJob | None = None
