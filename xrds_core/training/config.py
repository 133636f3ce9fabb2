"""The configuration of a training run: one TOML file."""

from __future__ import annotations

import dataclasses
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..errors import UsageError
from .data import Variation
from .losses import LOSSES


@dataclass(frozen=True)
class TrainingConfig:
    """What a run depends on, beside the code and the files of its windows."""

    data: tuple[str, ...]
    """Folders of `xrds dataset`, with `train` and `validation` in them."""
    preset: str = "fast"
    scale: int = 2
    guides: str = "fast"
    network: dict[str, Any] = field(default_factory=dict)
    """Changes to the preset's `NetworkConfig`."""
    start: str = ""
    """Weights file to start from: tensors of the same name and shape are taken."""
    seed: int = 0
    steps: int = 20_000
    batch: int = 8
    crop: int = 128
    """Side of a crop in output pixels."""
    learning_rate: float = 5e-4
    final_learning_rate: float = 1e-6
    """Reached along a cosine at the last step."""
    warmup: int = 200
    betas: tuple[float, float] = (0.9, 0.99)
    clip_gradient: float = 1.0
    """Largest norm of the gradient."""
    average: float = 0.999
    """Decay of the moving average of weights, which is what is validated and saved."""
    loss: dict[str, float] = field(default_factory=lambda: {"charbonnier": 1.0})
    """Weights of the losses of `losses.LOSSES`."""
    precision: str = "fp32"
    """`fp32` or `bf16`."""
    validate_every: int = 1000
    validation_windows: int = 24
    cache_gigabytes: float = 8.0
    """Memory for windows; those beyond it are read from disk each time."""
    variation: Variation = field(default_factory=Variation)

    def __post_init__(self) -> None:
        unknown = set(self.loss) - set(LOSSES)
        if unknown:
            raise UsageError(f"loss {sorted(unknown)} is none of {sorted(LOSSES)}")
        if self.crop % self.scale:
            raise UsageError(f"crop {self.crop} is no multiple of scale {self.scale}")
        if self.precision not in ("fp32", "bf16"):
            raise UsageError(f"precision {self.precision!r} is neither fp32 nor bf16")


def read_config(path: Path) -> TrainingConfig:
    """Read a TOML file; paths in it are relative to it.

    Raises:
        UsageError: it is missing, no TOML, or has unknown or wrong values.
    """
    try:
        values = tomllib.loads(path.read_text())
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise UsageError(
            f"cannot read training configuration {path}: {error}"
        ) from error
    known = {f.name for f in dataclasses.fields(TrainingConfig)}
    if unknown := set(values) - known:
        raise UsageError(
            f"{path}: unknown {sorted(unknown)}; known are {sorted(known)}"
        )
    try:
        folders = values["data"]
        folders = [folders] if isinstance(folders, str) else folders
        values["data"] = tuple(str(path.parent / folder) for folder in folders)
        if values.get("start"):
            values["start"] = str(path.parent / values["start"])
        values["variation"] = Variation(**values.get("variation", {}))
        values["betas"] = tuple(values.get("betas", TrainingConfig.betas))
        return TrainingConfig(**values)
    except (KeyError, TypeError) as error:
        raise UsageError(f"{path}: {error}") from error
