"""What one Cycles render leaves: the low-resolution picture, or the guides.

Arrays are float32, scene-linear, row 0 on top. Seconds are by stage.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from xrds_core.arrays import Array

InProcess = Callable[[Array, Array, Array], Array]
"""Denoises: radiance and alpha (h, w, 4), albedo, normal (h, w, 3) -> (h, w, 4)."""


@dataclass(frozen=True)
class Beauty:
    """The low-resolution radiance (h, w, 3), premultiplied, and alpha (h, w).

    `offset` (dy, dx): where the region starts inside the coverage, in full-resolution
    pixels. `seconds`: sync, beauty, denoise. `noisy` is None without denoising.
    """

    radiance: Array
    alpha: Array
    noisy: Array | None
    offset: tuple[int, int]
    seconds: dict[str, float] = field(default_factory=dict)
    others: dict[str, Array] = field(default_factory=dict)


@dataclass(frozen=True)
class Guides:
    """Full-resolution albedo and normal (H, W, 3), alpha and depth (H, W).

    Albedo is as Cycles writes it, not clamped; normals are in camera space.
    `samples` are per pixel, None for guides without noise. `seconds`: sync, guides.
    """

    albedo: Array
    normal: Array
    alpha: Array
    depth: Array | None
    samples: int | None
    seconds: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Probe:
    """Tiny guides, to compare with those of another render.

    `values` (N,) are all that guides keep, one pass after the other; `width` and
    `height` the size in pixels, `seconds` what the probe took.
    """

    values: Array
    width: int
    height: int
    seconds: float
