"""Frames as arrays of a file, and back: whatever fields a frame has."""

from __future__ import annotations

import dataclasses
import re
import sys
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from xrds_core.accumulation.frame import Frame
from xrds_core.arrays import LARGEST_HALF, Array

# What the window keeps in half floats as well.
_HALF = {"radiance", "albedo", "normal", "alpha", "vector", "halves"}
_VIEWS = "views"


def pack(frames: Mapping[str, Frame]) -> dict[str, Array]:
    """The frames of one moment, by view, as arrays by name."""
    arrays: dict[str, Array] = {_VIEWS: np.array(list(frames))}
    for number, frame in enumerate(frames.values()):
        arrays |= dict(_packed(frame, f"{number}."))
    return arrays


def unpack(arrays: Mapping[str, Array]) -> dict[str, Frame]:
    """The frames that `pack` made arrays of; fields that a file lacks are default."""
    views = arrays[_VIEWS].tolist()
    return {
        view: _unpacked(Frame, arrays, f"{number}.")
        for number, view in enumerate(views)
    }


def _packed(owner: Any, prefix: str) -> Iterator[tuple[str, Array]]:
    for field in dataclasses.fields(owner):
        value, name = getattr(owner, field.name), prefix + field.name
        if value is None:
            continue
        if dataclasses.is_dataclass(value):
            yield from _packed(value, f"{name}.")
        elif isinstance(value, Mapping):
            yield from ((f"{name}.{key}", np.asarray(x)) for key, x in value.items())
        else:
            yield name, _narrow(np.asarray(value), name)


def _narrow(array: Array, name: str) -> Array:
    """In half floats where that loses nothing that the window would keep."""
    if array.dtype != np.float32 or not _HALF & {*name.split(".")}:
        return array
    return np.clip(array, -LARGEST_HALF, LARGEST_HALF).astype(np.float16)


def _unpacked(kind: type[Any], arrays: Mapping[str, Array], prefix: str) -> Any:
    values = {}
    for field in dataclasses.fields(kind):
        name, inner = prefix + field.name, _dataclass_of(kind, field)
        below = {key: x for key, x in arrays.items() if key.startswith(f"{name}.")}
        if inner is not None and below:
            values[field.name] = _unpacked(inner, arrays, f"{name}.")
        elif below:
            start = len(name) + 1
            values[field.name] = {int(key[start:]): x for key, x in below.items()}
        elif name in arrays:
            values[field.name] = _value(arrays[name], str(field.type))
        elif field.default is dataclasses.MISSING and "None" in str(field.type):
            values[field.name] = None
    return kind(**values)


def _dataclass_of(kind: type[Any], field: dataclasses.Field[Any]) -> type[Any] | None:
    """The dataclass that a field is said to hold, if it is one."""
    modules = [vars(sys.modules[each.__module__]) for each in kind.__mro__]
    for word in re.findall(r"\w+", str(field.type)):
        found = next((known[word] for known in modules if word in known), None)
        if isinstance(found, type) and dataclasses.is_dataclass(found):
            return found
    return None


def _value(array: Array, said: str) -> Any:
    if said.startswith("tuple"):
        return tuple(array.tolist())
    if array.ndim == 0:
        return array.item()
    return array.astype(np.float32) if array.dtype == np.float16 else array
