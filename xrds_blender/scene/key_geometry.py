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
# Numbers per particle.
_PARTICLE = {
    "location": 3,
    "velocity": 3,
    "angular_velocity": 3,
    "rotation": 4,
    "size": 1,
    "birth_time": 1,
    "die_time": 1,
    "lifetime": 1,
}


# Bevel rounds texture coordinates in another order each time it is evaluated.
_UNSTABLE = {"BEVEL"}


def mesh(item: Any) -> Iterator[tuple[str, np.ndarray]]:
    """Arrays of an evaluated mesh object by name, and of the mesh it was made from.

    Generated coordinates come from the mesh before its modifiers, and so do texture
    coordinates whose last bits are not the same each time; what modifiers do to these
    their settings say. Raises TypeError for an attribute of an unknown type.
    """
    import bpy

    kinds = {each.type for each in item.modifiers}
    stable = not kinds & _UNSTABLE or "NODES" in kinds
    left_out = "" if stable else "FLOAT2"
    yield from geometry(item.data, "MESH", left_out=left_out)
    original = item.original.data if item.original else None
    if isinstance(original, bpy.types.Mesh):
        only = "position" if stable else ""
        yield from geometry(original, "MESH", only=only)


def geometry(
    data: Any, kind: str, *, only: str = "", left_out: str = ""
) -> Iterator[tuple[str, np.ndarray]]:
    """Arrays by name, of one attribute alone or without those of one type.

    Raises TypeError for an attribute of an unknown type.
    """
    if data is None or kind == "VOLUME":
        return
    if kind in {"CURVES", "POINTCLOUD"}:
        if kind == "CURVES" and len(data.curves):
            yield "offsets", _array(data.curve_offset_data, "value", 1, np.int32)
        yield from _attributes(data, only, left_out)
        return
    yield "faces", _array(data.polygons, "loop_start", 1, np.int32)
    yield "texture space", np.array([*data.texspace_location, *data.texspace_size])
    yield from _attributes(data, only, left_out)
    if only:
        return
    layers = [layer.name for layer in data.uv_layers if layer.active_render]
    colours = data.color_attributes
    layers += [colours.default_color_name, colours.active_color_name]
    yield f"active {layers}", np.empty(0)
    if data.has_custom_normals:
        yield "normals", _array(data.corner_normals, "vector", 3, np.float32)


def pose(item: Any) -> np.ndarray:
    """Matrices of an armature's bones, (bones, 4, 4), float32."""
    bones = item.pose.bones if item.pose else ()
    return np.array([bone.matrix for bone in bones], np.float32)


def particles(system: Any) -> Iterator[tuple[str, np.ndarray]]:
    """What shaders can ask of each particle of a system, by name."""
    for name, count in _PARTICLE.items():
        yield name, _array(system.particles, name, count, np.float32)


def vertex_group(item: Any, name: str) -> np.ndarray:
    """Weights of a vertex group by vertex, (vertices,), 0 outside it."""
    index = item.vertex_groups[name].index
    weights = np.zeros(len(item.data.vertices), np.float32)
    for number, vertex in enumerate(item.data.vertices):
        for each in vertex.groups:
            if each.group == index:
                weights[number] = each.weight
    return weights


def _attributes(
    data: Any, only: str, left_out: str
) -> Iterator[tuple[str, np.ndarray]]:
    for attribute in data.attributes:
        if (only and attribute.name != only) or attribute.data_type == left_out:
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
