"""Blender's structs to a hash, property by property, whatever their type."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any

# What of each type no pixel depends on, or what is added by other means: matrices of
# objects, pixels of images, geometry. Everything else counts.
_BLOCK = (
    "name name_full original users use_fake_user use_extra_user is_embedded_data "
    "is_evaluated is_library_indirect is_missing is_runtime_data is_editable tag "
    "session_uid library library_weak_reference asset_data override_library preview "
    "animation_data id_type cycles"
)
_LEFT_OUT = {
    "ID": _BLOCK,
    "Object": "location scale rotation_euler rotation_quaternion rotation_axis_angle "
    "rotation_mode delta_location delta_scale delta_rotation_euler "
    "delta_rotation_quaternion matrix_basis matrix_local matrix_world "
    "matrix_parent_inverse bound_box dimensions mode active_material "
    "active_material_index active_shape_key active_shape_key_index motion_path "
    "animation_visualization pose hide_viewport hide_select lightgroup",
    "Node": "location location_absolute width height width_hidden dimensions label "
    "parent select color use_custom_color internal_links "
    "debug_zone_lazy_function_graph debug_zone_body_lazy_function_graph",
    "Image": "pixels packed_file bindcode is_dirty has_data depth channels size "
    "resolution frame_duration filepath_raw",
    "Material": "texture_paint_images paint_active_slot paint_clone_slot lineart "
    "grease_pencil",
    "Modifier": "execution_time is_active persistent_uid show_expanded "
    "show_in_editmode show_on_cage show_viewport use_pin_to_last",
}
_INTERFACE = {"ID": ("show_", "display_", "empty_", "lock_", "preview_")}
_COLLECTIONS = {"elements", "curves", "points", "tiles"}
# Settings of Blender's own and of this add-on that lie among the custom properties.
_OWN = {"cycles", "cycles_visibility", "xrds"}


class StructHash:
    """Adds structs to a hash. `add` takes values, `refer` data-blocks pointed at."""

    def __init__(self, add: Callable[..., None], refer: Callable[[Any], None]) -> None:
        self._add_values, self._refer = add, refer
        self._trees: set[str] = set()
        self._known: dict[Any, list[tuple[str, str]]] = {}

    def add(
        self,
        struct: Any,
        left_out: Collection[str] = (),
        prefixes: tuple[str, ...] = (),
    ) -> None:
        """Every value of a struct and of the structs inside, but for those named."""
        if struct is None:
            return
        values = []
        for name, kind in self._properties(struct):
            if name in left_out or (prefixes and name.startswith(prefixes)):
                continue
            value = getattr(struct, name)
            if kind == "VALUE":
                values.append((name, value))
            elif kind == "ARRAY":
                values.append((name, tuple(_flat(value))))
            elif kind == "SET":
                values.append((name, sorted(value)))
            elif value is not None:
                values.append((name, kind))
                self._nested(kind, value)
        self._add_values(type(struct).__name__, values)

    def custom(self, struct: Any) -> None:
        """Custom properties, which shaders can read as attributes."""
        for name in sorted(set(struct.keys()) - _OWN):
            value = struct[name]
            for plain in ("to_dict", "to_list"):
                value = getattr(value, plain)() if hasattr(value, plain) else value
            self._add_values("custom", name, value)

    def tree(self, tree: Any) -> None:
        """A node tree: nodes, sockets, links and the trees of its groups."""
        # A material's own tree has a name like any other's; its owner is hashed.
        key = f"{tree.name_full} {tree.as_pointer()}"
        if key in self._trees:
            return
        self._trees.add(key)
        for node in tree.nodes:
            self._add_values("node", node.name, node.type, node.mute)
            self.add(node, ("inputs", "outputs"))
            for socket in [*node.inputs, *node.outputs]:
                self._socket(socket)
        for link in tree.links:
            ends = link.from_node.name, link.from_socket.identifier
            ends += link.to_node.name, link.to_socket.identifier
            self._add_values("link", ends, link.is_muted)

    def _socket(self, socket: Any) -> None:
        value = getattr(socket, "default_value", None)
        self._add_values(socket.identifier, socket.enabled, socket.hide_value)
        if hasattr(value, "bl_rna"):
            self._refer(value)
        elif hasattr(value, "__len__") and not isinstance(value, str):
            self._add_values(tuple(value))
        else:
            self._add_values(value)

    def _nested(self, kind: str, value: Any) -> None:
        if kind == "POINTER":
            self._pointed(value)
        else:
            for item in value:
                self._pointed(item)

    def _pointed(self, value: Any) -> None:
        if value is None:
            return
        if _is_data_block(value):
            self._refer(value)
        else:
            self.add(value)

    def _properties(self, struct: Any) -> list[tuple[str, str]]:
        """Names and kinds of what counts; looked up once per type."""
        kind = type(struct)
        if kind not in self._known:
            names, prefixes = _left_out(kind)
            self._known[kind] = [
                (item.identifier, _kind(item))
                for item in struct.bl_rna.properties
                if item.identifier not in names
                and not item.identifier.startswith(prefixes)
                and _kind(item)
            ]
        return self._known[kind]


def _left_out(kind: type) -> tuple[set[str], tuple[str, ...]]:
    """Names and prefixes of the properties that do not count."""
    import bpy

    bases = [n for n in _LEFT_OUT if issubclass(kind, getattr(bpy.types, n))]
    names = {name for base in bases for name in _LEFT_OUT[base].split()}
    prefixes = [each for base in bases for each in _INTERFACE.get(base, ())]
    always_on = {"use_nodes"} if bpy.app.version >= (5,) else set()
    return names | always_on | {"rna_type", "bl_rna"}, ("bl_", *prefixes)


def _kind(item: Any) -> str:
    if item.type == "POINTER":
        return "POINTER"
    if item.type == "COLLECTION":
        # Small lists inside of nodes; geometry and sockets come by themselves.
        return "COLLECTION" if item.identifier in _COLLECTIONS else ""
    if item.type == "ENUM" and item.is_enum_flag:
        return "SET"
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
