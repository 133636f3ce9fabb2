"""Enlargements without a network, which the product is compared with."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from xrds_core.arrays import Array
from xrds_core.superres import front_end

from .. import baselines

# (radiance, radiance before denoising, albedo, normal, scale) -> picture; those that
# need no guides take None
Enlargement = Callable[[Array, Array, Any, Any, int], Array]

# By the method's name in every report.
ENLARGEMENTS: dict[str, Enlargement] = {
    "bicubic": lambda low, noisy, albedo, normal, s: baselines.bicubic(low, s),
    "demodulated_bilinear": lambda low, noisy, albedo, normal, s: (
        front_end.demodulated_base(low, albedo, s)
    ),
    "joint_bilateral": lambda low, noisy, *guides: baselines.joint_bilateral(
        low, *guides
    ),
    "regressed": front_end.regressed_base,
}
