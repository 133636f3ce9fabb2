"""The subject of a check: shipped weights at one precision."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from xrds_core.superres.upscaler import Upscaler
from xrds_core.superres.weights_header import available

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from xrds_core.arrays import Array

    from .pictures import Inputs

PRECISIONS = ("fp32", "bf16")


@dataclass(frozen=True)
class Subject:
    """A preset at a scale and precision, ready to enlarge pictures."""

    preset: str
    scale: int
    precision: str
    upscaler: Upscaler
    side: int = 96
    """Output pixels along one side of the pictures that checks make."""
    thorough: bool = False
    """Try every case, rather than one of each kind."""

    @property
    def low_side(self) -> int:
        """Low-resolution pixels along one side."""
        return self.side // self.scale

    @property
    def name(self) -> str:
        """Name in the report, as `fast x2 fp32`."""
        return f"{self.preset} x{self.scale} {self.precision}"

    @property
    def device(self) -> str:
        """What it runs on."""
        return self.upscaler.device_name

    def __call__(self, inputs: Inputs, **options: Any) -> Array:
        """Return the picture (H, W, 3 or 4) of `inputs`."""
        return self.upscaler(*inputs, **options).radiance

    def at(self, precision: str) -> Subject:
        """Return the same weights at another precision."""
        made = Upscaler(
            self.preset,
            self.scale,
            self.device,
            precision,
            self.upscaler.network,
        )
        return Subject(
            self.preset, self.scale, precision, made, self.side, self.thorough
        )


def shipped(
    precisions: Sequence[str] = PRECISIONS,
    *,
    directory: Path | None = None,
    device: str = "auto",
    side: int = 96,
    thorough: bool = False,
    only: tuple[str, int] | None = None,
) -> list[Subject]:
    """Return every shipped preset and scale at every precision, or `only` one of them.

    Raises WeightsError if a file is damaged, UsageError for an unknown precision.
    """
    return [
        Subject(
            record["preset"],
            record["scale"],
            precision,
            Upscaler(
                record["preset"],
                record["scale"],
                device,
                precision,
                directory,
            ),
            side,
            thorough,
        )
        for record in available(directory)
        if only in (None, (record["preset"], record["scale"]))
        for precision in precisions
    ]
