"""The configuration of a training run: one TOML file."""

from __future__ import annotations

import dataclasses
import json
import math
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import torch

from xrds_core.errors import UsageError
from xrds_core.superres.devices import choose_precision
from xrds_core.superres.network import NetworkConfig, preset_config

from .data import Variation
from .losses import LOSSES

_LEAST = {
    "scale": 1,
    "batch": 1,
    "crop": 1,
    "steps": 0,
    "seed": 0,
    "warmup": 0,
    "validate_every": 1,
    "validation_windows": 1,
    "workers": 1,
}


@dataclass(frozen=True)
class TrainingConfig:
    """What a run depends on, beside the code and the files of its windows."""

    data: tuple[str, ...]
    """Folders of `xrds dataset`, with `train` and `validation` in them."""
    preset: str = "fast"
    scale: int = 2
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
    """Largest norm of the gradient; 0 for any."""
    average: float = 0.999
    """Decay of the moving average of weights, which is what is validated and saved.

    0 for the weights themselves.
    """
    loss: dict[str, float] = field(default_factory=lambda: {"charbonnier": 1.0})
    """Weights of the losses of `losses.LOSSES`."""
    precision: str = "auto"
    """Of the layers: `fp32`, `bf16`, or `auto`, bf16 where a GPU is fast with it."""
    validate_every: int = 1000
    validation_windows: int = 24
    workers: int = 1
    """Processes that draw crops: 1 keeps up with a CPU, 8 with a fast GPU."""
    cache_gigabytes: float = 8.0
    """Memory for windows, of all processes; others are read from disk each time."""
    variation: Variation = field(default_factory=Variation)

    def __post_init__(self) -> None:
        unknown = set(self.loss) - set(LOSSES)
        if unknown:
            raise UsageError(f"loss {sorted(unknown)} is none of {sorted(LOSSES)}")
        for name, least in _LEAST.items():
            if getattr(self, name) < least:
                raise UsageError(f"{name} is {getattr(self, name)}, less than {least}")
        if self.crop % self.scale:
            raise UsageError(f"crop {self.crop} is no multiple of scale {self.scale}")
        choose_precision(self.precision, torch.device("cpu"))  # is it known?
        try:
            self.network_config  # noqa: B018  # is it one?
        except (ValueError, TypeError) as error:
            raise UsageError(str(error)) from error

    @property
    def network_config(self) -> NetworkConfig:
        """The preset's, with the changes of `network`."""
        shape = preset_config(self.preset, self.scale)
        return replace(shape, **self.network)

    def learning_rate_at(self, step: int) -> float:
        """The learning rate of the step that follows `step` others."""
        if step < self.warmup:
            return self.learning_rate * (step + 1) / self.warmup
        done = (step - self.warmup) / max(1, self.steps - self.warmup)
        return cosine(self.learning_rate, self.final_learning_rate, done)


def cosine(first: float, last: float, done: float) -> float:
    """From the first to the last along half a wave, as `done` goes from 0 to 1."""
    return last + (first - last) * (1 + math.cos(math.pi * done)) / 2


def read_config(path: Path, changes: Sequence[str] = ()) -> TrainingConfig:
    """Read a TOML file; paths in it are relative to it.

    Each change is one line of TOML, as `scale = 8` or `variation.noisy = 1.0`, that
    comes in the place of the file's; paths in it are relative to the working folder.

    Raises:
        UsageError: it is missing, no TOML, or has unknown or wrong values.
    """
    try:
        values = rooted(tomllib.loads(path.read_text("utf-8")), path.parent)
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise UsageError(
            f"cannot read training configuration {path}: {error}"
        ) from error
    for change in changes:
        try:
            merge(values, rooted(tomllib.loads(change), Path()))
        except tomllib.TOMLDecodeError as error:
            raise UsageError(f"{change!r} is no line of TOML: {error}") from error
    return from_values(values, path)


def rooted(values: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The same with absolute paths."""
    if "data" in values:
        data = values["data"]
        folders = data if isinstance(data, list) else [data]
        if not folders or not all(isinstance(x, str) and x for x in folders):
            raise UsageError(f"data = {data!r} names no folders: give one or a list")
        values["data"] = tuple(str((folder / f).absolute()) for f in folders)
    if start := values.get("start"):
        values["start"] = str((folder / str(start)).absolute())
    return values


def merge(values: dict[str, Any], changes: dict[str, Any]) -> None:
    """Put changes in the place of values, in nested tables key by key."""
    for name, change in changes.items():
        if isinstance(change, dict) and isinstance(values.get(name), dict):
            merge(values[name], change)
        else:
            values[name] = change


def from_values(values: dict[str, Any], path: Path) -> TrainingConfig:
    """The configuration of a file's values."""
    known = {f.name for f in dataclasses.fields(TrainingConfig)}
    if unknown := set(values) - known:
        raise UsageError(
            f"{path}: unknown {sorted(unknown)}; known are {sorted(known)}"
        )
    try:
        _check_types(TrainingConfig, values)
        _check_types(Variation, values.get("variation", {}))
        _check_types(NetworkConfig, values.get("network", {}))
        losses = values.get("loss", {})
        if not isinstance(losses, dict) or not all(
            _is(float, x) for x in losses.values()
        ):
            raise TypeError(f"loss = {losses!r} is no table of numbers")
        values["variation"] = Variation(**values.get("variation", {}))
        values["betas"] = tuple(values.get("betas", TrainingConfig.betas))
        return TrainingConfig(**values)
    except (KeyError, TypeError, ValueError, UsageError) as error:
        raise UsageError(f"{path}: {error}") from error


def _check_types(owner: type, values: Any) -> None:
    """Raise TypeError for a value of another type than the field of `owner`."""
    if not isinstance(values, dict):
        raise TypeError(f"{values!r} is no table")
    simple = {kind.__name__: kind for kind in (bool, int, float, str)}
    for each in dataclasses.fields(owner):
        kind = simple.get(str(each.type))
        if kind and each.name in values and not _is(kind, values[each.name]):
            raise TypeError(
                f"{each.name} = {values[each.name]!r} is not of type {kind.__name__}"
            )


def _is(kind: type, value: Any) -> bool:
    """Whether a TOML value is of a type; an integer is a float, a truth value none."""
    if isinstance(value, bool):
        return kind is bool
    return isinstance(value, (int, float) if kind is float else kind)


def to_toml(config: TrainingConfig) -> str:
    """A file that `read_config` reads as `config`."""
    values = dataclasses.asdict(config)
    tables = {name: values.pop(name) for name in ("network", "loss", "variation")}
    text = toml_lines(values)
    for name, table in tables.items():
        text += f"\n[{name}]\n" + toml_lines(table)
    return text


def toml_lines(values: dict[str, Any]) -> str:
    """Strings, numbers, truth values and lists of them are the same in JSON."""
    return "".join(f"{name} = {json.dumps(value)}\n" for name, value in values.items())
