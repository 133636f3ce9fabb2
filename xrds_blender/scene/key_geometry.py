"""Evaluated geometry as arrays: everything that Cycles builds its scene of."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

# Per type of attribute: property, numbers per element, and their type in memory.
_ATTRIBUTES: dict[str, tuple[str, int, Any]] = {
    "FLOAT": ("value", 1, np.float32),
    "INT": ("value", 1, np.int32),
    "INT8": ("value", 1, np.int8),
    "BOOLEAN": ("value", 1, np.bool_),
    "FLOAT2": ("vector", 2, np.float32),
    "FLOAT_VECTOR": ("vector", 3, np.float32),
    "FLOAT_COLOR": ("color", 4, np.float32),
    "BYTE_COLOR": ("color", 4, np.float32),
    "INT16_2D": ("value", 2, np.int16),
    "INT32_2D": ("value", 2, np.int32),
    "QUATERNION": ("value", 4, np.float32),
    "FLOAT4X4": ("value", 16, np.float32),
}


def geometry(
    data: Any, kind: str, *, shape_alone: bool = False
) -> Iterator[tuple[str, np.ndarray]]:
    """Arrays by name. Raises TypeError for an attribute of an unknown type."""
    if data is None or kind == "VOLUME":
        return
    if kind in {"CURVES", "POINTCLOUD"}:
        if kind == "CURVES":
            yield "offsets", _array(data.curve_offset_data, "value", 1, np.int32)
        yield from _attributes(data, "")
        return
    yield "faces", _array(data.polygons, "loop_start", 1, np.int32)
    yield "texture space", np.array([*data.texspace_location, *data.texspace_size])
    yield from _attributes(data, "position" if shape_alone else "")
    if shape_alone:
        return
    layers = [layer.name for layer in data.uv_layers if layer.active_render]
    colours = data.color_attributes
    layers += [colours.default_color_name, colours.active_color_name]
    yield f"active {layers}", np.empty(0)
    if data.has_custom_normals:
        yield "normals", _array(data.corner_normals, "vector", 3, np.float32)


def _attributes(data: Any, only: str) -> Iterator[tuple[str, np.ndarray]]:
    for attribute in data.attributes:
        if only and attribute.name != only:
            continue
        if attribute.data_type not in _ATTRIBUTES:
            raise TypeError(f"attribute {attribute.name} is {attribute.data_type}")
        name, count, number = _ATTRIBUTES[attribute.data_type]
        label = f"{attribute.name} {attribute.domain} {attribute.data_type}"
        yield label, _array(attribute.data, name, count, number)


def _array(items: Any, name: str, count: int, number: Any) -> np.ndarray:
    values = np.empty(len(items) * count, number)
    if len(items):
        items.foreach_get(name, values)
    return values
