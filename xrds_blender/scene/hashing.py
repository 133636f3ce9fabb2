"""Blender's structs and evaluated geometry to a hash, whatever their type.

What is left out is named here; all else counts, so a property that nobody thought of
makes a key differ and costs a render, never a wrong picture.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from typing import Any

import numpy as np

from .outer_files import file_digest

# What of each type no pixel depends on, or what is added by other means: matrices of
# objects, pixels of images, geometry.
_LEFT_OUT = {
    "ID": "name name_full original users use_fake_user use_extra_user tag library "
    "is_embedded_data is_evaluated is_library_indirect is_missing is_runtime_data "
    "is_editable session_uid library_weak_reference asset_data override_library "
    "preview animation_data id_type",
    "Object": "location scale rotation_euler rotation_quaternion rotation_axis_angle "
    "rotation_mode delta_location delta_scale delta_rotation_euler "
    "delta_rotation_quaternion matrix_basis matrix_local matrix_world "
    "matrix_parent_inverse bound_box dimensions mode active_material "
    "active_material_index active_shape_key active_shape_key_index motion_path "
    "animation_visualization pose hide_viewport hide_select lightgroup constraints "
    "vertex_groups users_collection children children_recursive particle_systems "
    "active_selection_set selection_sets",
    "Mesh": "total_vert_sel total_edge_sel total_face_sel is_editmode shape_keys",
    "Collection": "all_objects children_recursive collection_objects "
    "collection_children",
    "Camera": "background_images",
    "Node": "location location_absolute width height width_hidden dimensions label "
    "parent select color use_custom_color internal_links inputs outputs "
    "paired_output "
    "debug_zone_lazy_function_graph debug_zone_body_lazy_function_graph",
    "Image": "pixels packed_file packed_files bindcode is_dirty has_data depth "
    "channels size resolution frame_duration filepath_raw render_slots layers",
    "Material": "texture_paint_images texture_paint_slots paint_active_slot "
    "paint_clone_slot lineart grease_pencil",
    "Modifier": "execution_time is_active persistent_uid show_expanded "
    "show_in_editmode show_on_cage show_viewport use_pin_to_last panels "
    "node_warnings",
    "ParticleSettings": "active_dupliweight active_instanceweight",
}
_INTERFACE = {"ID": ("show_", "display_", "empty_", "lock_", "preview_")}
# Their elements are geometry, or what moved it; what they point at is often their own
# arrays, and reading those of evaluated data can crash Blender.
_SHAPES = "Mesh Curve MetaBall Curves PointCloud Volume Lattice Armature"
_ARRAYS = "Mesh Curves PointCloud"
# Settings of Blender's own and of this add-on that lie among the custom properties.
_OWN = {"cycles", "cycles_visibility", "xrds"}
# Nodes that give another value in every frame, or at every place of the time line.
TIMED_NODES = {"INPUT_SCENE_TIME", "SIMULATION_INPUT", "SIMULATION_OUTPUT", "BAKE"}


class StructHash:
    """Adds structs to a hash. `add` takes values, `refer` data-blocks pointed at."""

    def __init__(self, add: Callable[..., None], refer: Callable[[Any], None]) -> None:
        self._add_values, self._refer = add, refer
        self._trees: set[int] = set()
        self._inside: set[tuple[type, int]] = set()
        self._known: dict[type, list[tuple[str, str]]] = {}
        self.attributes: set[tuple[str, str]] = set()
        """Type and name of what Attribute nodes read."""
        self.is_timed = False
        """Whether something seen here changes with the frame, whatever else does."""

    def add(
        self,
        struct: Any,
        left_out: Collection[str] = (),
        prefixes: tuple[str, ...] = (),
    ) -> None:
        """Every value of a struct and of the structs inside, but for those named."""
        values: list[tuple[str, Any]] = []
        nested: list[Any] = []
        for name, kind in self._properties(struct):
            if name in left_out or (prefixes and name.startswith(prefixes)):
                continue
            value = getattr(struct, name)
            if kind in {"POINTER", "COLLECTION"}:
                items = value if kind == "COLLECTION" else [value]
                values.append((name, kind))
                nested += [item for item in items if item is not None]
            elif kind == "ARRAY":
                values.append((name, tuple(_flat(value))))
            elif kind == "PATH":
                library = getattr(struct, "library", None)
                values.append((name, value and file_digest(value, library)))
            else:
                values.append((name, sorted(value) if kind == "SET" else value))
        self._add_values(type(struct).__name__, values)
        if not _is_a(type(struct), "PropertyGroup"):  # its properties came above
            self.custom(struct)
        for item in nested:
            self._pointed(item)

    def custom(self, struct: Any) -> None:
        """Custom properties: shaders read them, and nodes of geometry take them."""
        try:
            names = sorted(set(struct.keys()) - _OWN)
        except TypeError:  # this type of struct has none
            return
        for name in names:
            value = struct[name]
            for plain in ("to_dict", "to_list"):
                value = getattr(value, plain)() if hasattr(value, plain) else value
            if _is_data_block(value):
                self._refer(value)
                value = value.name_full
            self._add_values("custom", name, value)

    def tree(self, tree: Any) -> None:
        """A node tree: nodes, sockets, links and the trees of its groups."""
        # A material's own tree has a name like any other's; its owner is hashed.
        if tree.as_pointer() in self._trees:
            return
        self._trees.add(tree.as_pointer())
        for node in tree.nodes:
            self._add_values("node", node.name, node.type, node.mute)
            self.is_timed |= node.type in TIMED_NODES
            if node.type == "ATTRIBUTE":
                self.attributes.add((node.attribute_type, node.attribute_name))
            self.add(node)
            for socket in [*node.inputs, *node.outputs]:
                self._socket(socket)
        for link in tree.links:
            ends = (
                *(link.from_node.name, link.from_socket.identifier),
                *(link.to_node.name, link.to_socket.identifier),
            )
            self._add_values("link", ends, link.is_muted)

    def _socket(self, socket: Any) -> None:
        value: Any = getattr(socket, "default_value", None)
        self._add_values(socket.identifier, socket.enabled, socket.hide_value)
        if hasattr(value, "bl_rna"):
            self._refer(value)
        elif hasattr(value, "__len__") and not isinstance(value, str):
            self._add_values(tuple(value))
        else:
            self._add_values(value)

    def _pointed(self, value: Any) -> None:
        if _is_data_block(value):
            self._refer(value)
            return
        # Some structs point back at the one that holds them.
        place = type(value), value.as_pointer()
        if place not in self._inside:
            self._inside.add(place)
            self.add(value)
            self._inside.remove(place)

    def _properties(self, struct: Any) -> list[tuple[str, str]]:
        """Names and kinds of what counts; looked up once per type."""
        kind = type(struct)
        if kind not in self._known:
            names, prefixes = _left_out(kind)
            nested = {"COLLECTION"} if _is_a(kind, _SHAPES) else set()
            nested |= {"POINTER"} if _is_a(kind, _ARRAYS) else set()
            self._known[kind] = [
                (item.identifier, _kind(item))
                for item in struct.bl_rna.properties
                if item.identifier not in names
                and not item.identifier.startswith(prefixes)
                and item.type not in nested
            ]
        return self._known[kind]


def _left_out(kind: type) -> tuple[set[str], tuple[str, ...]]:
    """Names and prefixes of the properties that do not count."""
    import bpy

    bases = [base for base in _LEFT_OUT if _is_a(kind, base)]
    names = {name for base in bases for name in _LEFT_OUT[base].split()}
    prefixes = [prefix for base in bases for prefix in _INTERFACE.get(base, ())]
    always_on = {"use_nodes"} if bpy.app.version >= (5,) else set()
    return names | always_on | {"rna_type", "bl_rna"}, ("bl_", *prefixes)


def _is_a(kind: type, names: str) -> bool:
    import bpy

    types = [getattr(bpy.types, name, None) for name in names.split()]
    return any(base is not None and issubclass(kind, base) for base in types)


def _kind(item: Any) -> str:
    if item.type in {"POINTER", "COLLECTION"}:
        return str(item.type)
    if item.type == "ENUM" and item.is_enum_flag:
        return "SET"
    if item.type == "STRING" and item.subtype in {"FILE_PATH", "DIR_PATH"}:
        return "PATH"
    return "ARRAY" if getattr(item, "is_array", False) else "VALUE"


def _is_data_block(value: Any) -> bool:
    import bpy

    return isinstance(value, bpy.types.ID)


def _flat(value: Any) -> list[Any]:
    """Vectors, colours and matrices as plain numbers."""
    return [
        part
        for item in value
        for part in (_flat(item) if hasattr(item, "__len__") else [item])
    ]


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

    kinds = {modifier.type for modifier in item.modifiers}
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
        for membership in vertex.groups:
            if membership.group == index:
                weights[number] = membership.weight
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
