"""What a render is asked for, and what it returns."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from xrds_core.errors import UsageError

from .plan import Decision

if TYPE_CHECKING:
    from .cycles_session import Array

SCALES = (1, 2, 4, 8)
STAGES = ("total", "sync", "beauty", "denoise", "guides", "network", "write")


@dataclass(frozen=True)
class RenderJob:
    """Everything that can be chosen about one render.

    `samples` and `seed` None leave Cycles' own; `exposure` None is found in the
    picture; `weights` is a folder of presets or a file in place of the shipped;
    `memory_limit` in bytes and `threads` are the network's. Raises UsageError on
    values out of range.
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
    threads: int | None = None

    def __post_init__(self) -> None:
        if self.scale not in SCALES:
            known = ", ".join(map(str, SCALES))
            raise UsageError(f"scale {self.scale} is not one of {known}")
        for name in ("samples", "guide_samples", "threads"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise UsageError(f"{name} {value} is below 1")

    @property
    def is_plain(self) -> bool:
        """Whether Cycles renders alone."""
        return self.plain or self.scale == 1

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
            memory_limit=here.memory_limit,
            weights=here.weights,
            threads=here.threads,
        )


@dataclass(frozen=True)
class Picture:
    """A rendered region: arrays float32, scene-linear, row 0 on top.

    `radiance` (H, W, 3) is premultiplied by `alpha` (H, W); `albedo` and `normal`
    (H, W, 3) and `low_resolution` (h, w, 3) are None for a plain render. `seconds` by
    stage: total, sync, beauty, denoise, guides, network, write; Cycles does not tell
    denoising from sampling, so `beauty` holds both and `denoise` is 0. `peak_memory`
    is the largest in bytes that the process has taken so far; `device` is what the
    network ran on, empty for a plain render.
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
