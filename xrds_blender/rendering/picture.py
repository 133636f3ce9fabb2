"""What a render returns, and what made it: for the log and as metadata of its files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from xrds_core.errors import XRDSError
from xrds_core.version import package_version

from ..planning.plan import GUIDE_CACHE, Decision
from ..planning.settings import Settings
from .stages import STAGES

if TYPE_CHECKING:
    from xrds_core.arrays import Array


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
    """What a picture has from neighbour frames.

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
    (H, W, 3) and `low_resolution` (h, w, 3) are None for Cycles alone. `seconds` by
    stage: total, load (what a first render waits for), sync, beauty, accumulate,
    denoise, again (what of the frame alone is denoised as well), guides, network,
    write; Cycles reports its denoising and sampling as one, so `beauty` holds both
    then. `peak_memory` is the largest in bytes that the process has taken so far;
    `device` is what the network ran on, empty for Cycles alone; `settings` are what it
    was rendered by, as a time budget chose them; `views` (H, W, 4) are all views of
    stereo by name; `parts` (H, W, 3) of its light by the names of their passes,
    `view_parts` those of all views.
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
    settings: Settings | None = None
    temporal: Temporal | None = None
    views: dict[str, Array] = field(default_factory=dict)
    parts: dict[str, Array] = field(default_factory=dict)
    view_parts: dict[str, dict[str, Array]] = field(default_factory=dict)

    @classmethod
    def of(cls, pixels: Array, **rest: Any) -> Picture:
        """The picture of radiance and alpha in one array (H, W, 4)."""
        import numpy as np  # here: Blender starts faster without it

        radiance, alpha = pixels[..., :3], pixels[..., 3]
        return cls(np.ascontiguousarray(radiance), np.ascontiguousarray(alpha), **rest)

    @property
    def pixels(self) -> Array:
        """Radiance and alpha in one array (H, W, 4)."""
        import numpy as np

        return np.dstack((self.radiance, self.alpha))


def joined(pictures: Mapping[str, Picture], sampled: Mapping[str, float]) -> Picture:
    """The first view's picture, with all views where there are several.

    Its seconds are those of `sampled`, of all views together, and of each view.
    """
    seconds = dict.fromkeys(STAGES, 0.0) | dict(sampled)
    for picture in pictures.values():
        for stage, spent in picture.seconds.items():
            seconds[stage] = seconds.get(stage, 0.0) + spent
    views, parts = {}, {}
    if len(pictures) > 1:
        views = {view: picture.pixels for view, picture in pictures.items()}
        parts = {view: picture.parts for view, picture in pictures.items()}
    first = next(iter(pictures.values()))
    return replace(first, seconds=seconds, views=views, view_parts=parts)


def peak_memory() -> int:
    """The largest memory in bytes that this process has taken; 0 where not known."""
    try:
        import resource
    except ImportError:  # Windows
        return 0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


PREFIX = "xrds"
# What the plan calls a decision and its value, and what was left out then.
_LEFT_OUT = {
    ("denoise", "skipped"): "denoising",
    ("guides", "none"): "guides",
    ("guide bounces", "0"): "guide bounces",
    ("guide lights", "none sampled"): "light in guides",
    ("guide lights", "lamps alone"): "light in guides but lamps",
    ("motion blur", "skipped"): "motion blur",
    ("network", "without empty parts"): "network on empty parts",
}


def record_of(picture: Picture, settings: Settings, samples: int) -> dict[str, str]:
    """Name and value of what made a picture; `samples` are the scene's own."""
    entries = {"version": package_version(), "mode": settings.kind}
    entries["scale"] = str(settings.scale)
    if settings.is_enlarged:
        entries["preset"] = settings.preset
    elif not settings.is_cycles_only:
        entries["preset"] = settings.quality
    entries["samples"] = str(settings.count(samples))
    if settings.is_enlarged:
        entries["guide_samples"] = _decided(picture.plan, "guide samples") or "0"
    if picture.temporal is not None:
        frames = picture.temporal.frames
        entries["frames"] = f"{frames[0]} to {frames[-1]}"
    if picture.device:
        entries["device"] = picture.device
    entries["seconds"] = f"{picture.seconds.get('total', 0.0):.1f}"
    entries["left_out"] = ", ".join(_left_out(picture.plan)) or "nothing"
    return entries


def log_line(entries: dict[str, str], frame: int, layer: str) -> str:
    """The fields as one line of a log."""
    rest = [
        f"{name.replace('_', ' ')} {value}"
        for name, value in entries.items()
        if name not in _NAMELESS
    ]
    head = f"XRDS {entries['version']}, frame {frame}, {layer}: {entries['mode']}"
    return ", ".join([head, *rest])


_NAMELESS = ("version", "mode")


def metadata_of(entries: dict[str, str], layer: str = "") -> dict[str, str]:
    """The fields by their names in files: with the layer's, as Cycles names its own.

    Files of one picture, as commands write them, have no layers.
    """
    prefix = f"{PREFIX}.{layer}." if layer else f"{PREFIX}."
    return {prefix + name: value for name, value in entries.items()}


def stamp_result(engine: Any, entries: dict[str, str], layer: str) -> None:
    """Let Blender write the fields into every file that it makes of the result."""
    result = engine.get_result()
    for name, value in metadata_of(entries, layer).items():
        result.stamp_data_add_field(name, value)


def _decided(plan: tuple[Decision, ...], name: str) -> str | None:
    return next(
        (decision.value for decision in plan if decision.decision == name), None
    )


def _left_out(plan: tuple[Decision, ...]) -> list[str]:
    left_out = [_LEFT_OUT.get((decision.decision, decision.value)) for decision in plan]
    cached = _decided(plan, GUIDE_CACHE) or ""
    if cached.startswith("used"):
        left_out.append("guides, from the cache")
    return [words for words in left_out if words]
