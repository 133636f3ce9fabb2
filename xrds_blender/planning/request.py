"""What a render is to be, as the panel, the command and scripts describe it."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from xrds_core.denoising.light_passes import NONE, Wanted
from xrds_core.errors import UsageError

from .plan import SAVINGS, Facts, Plan, cycles_only, decide, full_size
from .settings import CYCLES_DENOISING, QUALITIES, SCALES, Denoising, Mode, Settings

MOST_SAMPLES = 1 << 24
"""That Cycles takes."""
_RANGES = {
    "samples": (1, MOST_SAMPLES),
    "guide_samples": (1, MOST_SAMPLES),
    "guide_limit": (0, MOST_SAMPLES),
    "seed": (0, 2**31 - 1),
    "threads": (1, 1024),
    "temporal_radius": (0, 1000),
    "strength": (0, 1),
    "memory_limit": (0, 2**63 - 1),
    "exposure": (1e-30, 1e30),
}


@dataclass(frozen=True)
class Machine:
    """What the network and our denoiser run on.

    `device` as `xrds info` lists them, or auto; `memory_limit` in bytes; `weights` is a
    folder of weights files or one file, in the place of the shipped ones. Raises
    UsageError for a device that has no such name.
    """

    device: str = "auto"
    memory_limit: int | None = None
    threads: int | None = None
    weights: str | Path | None = None

    def __post_init__(self) -> None:
        if not re.fullmatch(r"auto|cpu|metal|(cuda|xpu)(:\d+)?", self.device):
            raise UsageError(
                f"device {self.device!r} is not among auto, cpu, cuda, cuda:1, metal"
            )


@dataclass(frozen=True)
class Request:
    """A render as requested.

    `seed` None leaves Cycles' own; `exposure` None is found in the picture; `savings`
    names what the plan may leave out where the scene does not need it. `guide_cache` is
    a folder for guides beside those in memory; each render of the same view adds its
    samples to them until they are `guide_limit`. `finish_stopped` leaves what there is
    in the result when the user stops the render. A shot that is to have the
    `same_picture` as the file's own settings takes fewer samples where that is sooner;
    one with a `deadline` takes as many as fit into these seconds, as a frame with a
    `time_budget` does. `passes` are the parts of the light that are finished as well,
    as in `Wanted`, and `light_aovs` further ones.
    """

    settings: Settings = field(default_factory=Settings)
    machine: Machine = field(default_factory=Machine)
    seed: int | None = None
    exposure: float | None = None
    savings: tuple[str, ...] = SAVINGS
    guide_cache: str | Path | None = None
    guide_limit: int = 0
    finish_stopped: bool = False
    same_picture: bool = True
    deadline: float | None = None
    time_budget: float | None = None
    passes: tuple[str, ...] = (NONE,)
    light_aovs: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        unknown = set(self.savings) - set(SAVINGS)
        if unknown:
            known = ", ".join(SAVINGS)
            raise UsageError(
                f"unknown savings {', '.join(sorted(unknown))}; choose from {known}"
            )
        if self.deadline is not None and not self.deadline > 0:
            raise UsageError(f"deadline {self.deadline} s must be above 0")
        if self.time_budget is not None and not self.time_budget > 0:
            raise UsageError(f"time budget {self.time_budget} s must be above 0")
        for record in (self, self.settings, self.machine):
            for name in _RANGES.keys() & vars(record).keys():
                _check_range(name, getattr(record, name))

    @property
    def light(self) -> Wanted:
        """The parts of the light that are wanted."""
        return Wanted(self.passes, self.light_aovs)

    def with_settings(self, **changes: Any) -> Request:
        """The same with other settings."""
        return replace(self, settings=replace(self.settings, **changes))

    def in_shot(self, frames: int) -> Request:
        """The same for a shot of so many frames: their time budgets are a deadline."""
        if self.time_budget is None:
            return self
        return replace(self, deadline=self.time_budget * frames, time_budget=None)

    def plan(self, facts: Facts | None = None) -> Plan:
        """What is decided for it; at full size it rests on no facts."""
        if self.settings.is_cycles_only:
            return cycles_only("as requested")
        if self.settings.mode is Mode.FULL_SIZE:
            return full_size(self.settings.quality)
        assert facts is not None
        return decide(facts, self.savings)


def render_request(
    scale: int = 1,
    *,
    plain: bool = False,
    denoise: str = "high",
    denoiser: str | None = None,
    **others: Any,
) -> Request:
    """The request of what scripts and the command call their choices.

    `plain` is Cycles alone; `denoise` the quality of our denoiser, one of QUALITIES;
    `denoiser` a mode of Cycles', for `plain` and for the low-resolution picture;
    `others` are fields of Settings, Machine and Request by their names. Raises
    UsageError on what is out of range, TypeError on unknown names.
    """
    if scale not in SCALES:
        raise UsageError(f"scale {scale} is not one of {', '.join(map(str, SCALES))}")
    if denoise not in QUALITIES:
        raise UsageError(f"denoise {denoise!r} is not one of {', '.join(QUALITIES)}")
    mode = Mode.CYCLES_ONLY if plain else Mode.of(scale)
    denoising = Denoising.ours(denoise)
    if denoiser is not None:
        cycles = _of_cycles(denoiser)
        denoising = denoising if mode is Mode.FULL_SIZE else cycles
    settings = Settings(mode, denoising=denoising, **_taken(others, Settings))
    machine = Machine(**_taken(others, Machine))
    unknown = others.keys() - {each.name for each in fields(Request)}
    if unknown:
        raise TypeError(f"a render has no {', '.join(sorted(unknown))}")
    return Request(settings, machine, **others)


CHOICES = frozenset(
    {"scale", "plain", "denoise", "denoiser"}
    | {each.name for kind in (Settings, Machine, Request) for each in fields(kind)}
) - {"settings", "machine", "mode", "denoising"}
"""The names that `render_request` takes."""


def _taken(choices: dict[str, Any], record: Any) -> dict[str, Any]:
    """Take the fields of a record out of the choices."""
    names = {each.name for each in fields(record)} & choices.keys()
    return {name: choices.pop(name) for name in names}


def _of_cycles(name: str) -> Denoising:
    if name not in CYCLES_DENOISING:
        known = ", ".join(CYCLES_DENOISING)
        raise UsageError(f"denoiser {name!r} is not one of {known}")
    return Denoising(name)


def _check_range(name: str, value: float | None) -> None:
    least, most = _RANGES[name]
    if value is not None and not least <= value <= most:
        raise UsageError(f"{name} is {value}; it must be from {least} to {most}")
