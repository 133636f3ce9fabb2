"""A key for guides: a hash of all that albedo and normal depend on.

Everything that Cycles reads of a scene goes in, as evaluated for the frame, but for
what is known not to matter: light, samples, denoising, output. So what is forgotten
here makes a key differ and costs a render; it does not give wrong guides. What cannot
be followed at all raises NotFollowed.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from typing import Any

import numpy as np

from ..planning.facts import SceneFacts
from .key_images import image_digest
from .key_structs import StructHash

# Counts up whenever the guide render itself changes what it gives.
GENERATION = 1
_SHAPES = {"CURVE", "SURFACE", "FONT", "META"}
_SEEN = {"MESH", "CURVES", "POINTCLOUD", "VOLUME", *_SHAPES}
# Of `scene.cycles`: what a guide render sets itself or never looks at.
_CYCLES_LEFT_OUT = (
    "samples use_sample_subset sample_offset sample_subset_length seed "
    "use_animated_seed time_limit use_layer_samples use_adaptive_sampling "
    "adaptive_threshold adaptive_min_samples sampling_pattern use_denoising denoiser "
    "max_bounces diffuse_bounces volume_bounces min_light_bounces "
    "light_sampling_threshold use_light_tree direct_light_sampling_type "
    "caustics_reflective caustics_refractive blur_glossy use_fast_gi fast_gi_method "
    "ao_bounces ao_bounces_render sample_clamp_direct sample_clamp_indirect "
    "use_auto_tile tile_size device scrambling_distance auto_scrambling_distance"
)
_CYCLES_PREFIXES = ("preview_", "denoising_", "use_preview", "bake_", "debug_")
_CYCLES_PREFIXES += ("use_guiding", "guiding_", "use_surface_guiding")
_CYCLES_PREFIXES += ("use_volume_guiding", "surface_guiding", "volume_guiding")
_CYCLES_PREFIXES += ("use_deterministic_guiding",)
# Of `scene.render`: what reaches the camera's rays or the geometry.
_RENDER = (
    "pixel_aspect_x pixel_aspect_y use_border use_crop_to_border border_min_x "
    "border_max_x border_min_y border_max_y film_transparent filter_size "
    "use_motion_blur motion_blur_shutter motion_blur_position use_simplify "
    "simplify_subdivision_render simplify_child_particles_render simplify_volumes "
    "use_multiview views_format hair_type hair_subdiv"
)


class NotFollowed(Exception):
    """The scene holds something whose changes no key would show; its text names it."""


def guide_key(depsgraph: Any, facts: SceneFacts, frame: Any) -> str:
    """The key (hex) of the guides of an evaluated scene.

    `frame` is hashed as its repr: size, region, views, passes and whatever else the
    render adds. Lamps count where they may be seen, the world but for a transparent
    film without mirrors. Raises NotFollowed.
    """
    refuse(depsgraph, facts)
    return _SceneHash(depsgraph, facts).key(frame)


def refuse(depsgraph: Any, facts: SceneFacts) -> None:
    """Raise NotFollowed for what a look at this frame cannot tell."""
    if facts.motion_blur and facts.moving:
        moving = ", ".join(facts.moving)
        raise NotFollowed(f"motion blur of {moving}, whose path is not looked at")
    if facts.shadow_catchers:
        raise NotFollowed("a shadow catcher, whose guides hold light")
    if facts.unknown_nodes:
        raise NotFollowed(f"shader nodes {', '.join(facts.unknown_nodes)}")
    for item in depsgraph.scene_eval.objects:
        if any(each.settings.type == "HAIR" for each in item.particle_systems):
            raise NotFollowed(f"particle hair on {item.name}")


class _SceneHash:
    """Feeds one scene to a hash; every data-block once."""

    def __init__(self, depsgraph: Any, facts: SceneFacts) -> None:
        import bpy

        self._graph, self._facts, self._types = depsgraph, facts, bpy.types
        self._hash = hashlib.blake2b(digest_size=20)
        self._structs = StructHash(self._add, self._reference)
        self._done: set[str] = set()
        self._add("blender", bpy.app.version_string, GENERATION)

    def key(self, frame: Any) -> str:
        scene, layer = self._graph.scene_eval, self._graph.view_layer_eval
        self._add("frame", frame)
        self._settings(scene, layer)
        for item in self._ordered(self._graph.ids):
            self._data_block(item)
        for instance in self._graph.object_instances:
            if instance.object.type in _SEEN:
                self._instance(instance)
        return self._hash.hexdigest()

    def _ordered(self, ids: Iterable[Any]) -> list[Any]:
        named = [(type(item).__name__, item.name_full, item) for item in ids]
        return [item for *_, item in sorted(named, key=lambda each: each[:2])]

    def _add(self, *values: Any) -> None:
        for value in values:
            data = value if isinstance(value, bytes) else repr(value).encode()
            self._hash.update(len(data).to_bytes(8, "little"))
            self._hash.update(data)

    def _array(self, name: str, array: np.ndarray) -> None:
        self._add(name, array.shape, array.dtype.str)
        self._hash.update(np.ascontiguousarray(array).data)

    def _settings(self, scene: Any, layer: Any) -> None:
        self._structs.add(scene.cycles, _CYCLES_LEFT_OUT.split(), _CYCLES_PREFIXES)
        self._add(
            *((name, getattr(scene.render, name, None)) for name in _RENDER.split())
        )
        self._structs.custom(scene)
        self._structs.custom(layer)
        self._add("layer", layer.name)
        if layer.material_override:
            self._add("override", layer.material_override.name_full)
        self._collections(self._graph.view_layer.layer_collection)

    def _collections(self, layer: Any) -> None:
        flags = layer.exclude, layer.holdout, layer.indirect_only
        self._add("collection", layer.name, flags)
        for child in layer.children:
            self._collections(child)

    def _data_block(self, item: Any) -> None:
        """Everything but geometry, which comes with the instances."""
        types, facts = self._types, self._facts
        if isinstance(item, types.Material):
            self._shading(item)
        elif isinstance(item, types.World):
            unseen = facts.film_transparent and not (facts.smooth or facts.volumes)
            if not unseen or any(n.type == "OUTPUT_AOV" for n in _nodes(item)):
                self._shading(item)
        elif isinstance(item, types.Light) and facts.seen_lamps:
            self._shading(item)
        elif isinstance(item, types.Camera):
            self._add("camera", item.name_full)
            self._structs.add(item)
            self._structs.add(getattr(item, "cycles", None))
        elif isinstance(item, types.Object):
            self._placed(item)

    def _shading(self, item: Any) -> None:
        self._add("shading", item.name_full)
        self._structs.add(item)
        self._structs.add(item.cycles)
        self._structs.custom(item)

    def _placed(self, item: Any) -> None:
        """Objects that are not rendered may place textures, focus and cameras."""
        if item.type == "LIGHT" and not self._facts.seen_lamps:
            return
        self._add("object", item.name_full, item.type)
        self._array("matrix", np.array(item.matrix_world, np.float32))
        if item.type in _SEEN or item.type == "LIGHT":
            self._structs.add(item)
            self._structs.add(item.cycles)
            self._structs.custom(item)

    def _reference(self, item: Any) -> None:
        """What a setting points at."""
        types = self._types
        self._add(type(item).__name__, item.name_full)
        if isinstance(item, types.Object):
            self._array("matrix", np.array(item.matrix_world, np.float32))
        elif isinstance(item, types.NodeTree):
            self._structs.tree(item)
        elif isinstance(item, types.Image):
            if self._is_new(item):
                self._structs.add(item)
                self._add(image_digest(item))
                if item.source in {"SEQUENCE", "MOVIE"}:
                    self._add(self._graph.scene_eval.frame_current)
        elif isinstance(item, types.Text):
            self._add(item.as_string())
        elif isinstance(item, types.Texture) and self._is_new(item):
            self._structs.add(item)
        elif isinstance(item, types.Collection):
            self._add(*sorted(each.name_full for each in item.all_objects))

    def _is_new(self, item: Any) -> bool:
        name = f"{type(item).__name__} {item.name_full}"
        new = name not in self._done
        self._done.add(name)
        return new

    def _instance(self, instance: Any) -> None:
        item = instance.object
        self._array("instance", np.array(instance.matrix_world, np.float32))
        self._add(
            item.name_full, instance.random_id, tuple(instance.uv), tuple(instance.orco)
        )
        data = item.data
        pointer = None if data is None else data.as_pointer()
        # Data without a name of its own can share one: its address tells it apart.
        name = f"{item.type} {item.name_full} {pointer} {instance.is_instance}"
        if name in self._done:
            return
        self._done.add(name)
        self._add(*(slot.material and slot.material.name_full for slot in _slots(item)))
        for modifier in item.modifiers:
            self._structs.add(modifier)
        self._geometry(item)

    def _geometry(self, item: Any) -> None:
        from .key_geometry import geometry

        data = item.to_mesh() if item.type in _SHAPES else item.data
        try:
            for name, array in geometry(data, item.type):
                self._array(name, array)
        except TypeError as error:
            raise NotFollowed(f"geometry of {item.name}: {error}") from error
        finally:
            if item.type in _SHAPES:
                item.to_mesh_clear()
        original = item.original.data if item.original else None
        if item.type == "MESH" and isinstance(original, self._types.Mesh):
            # Generated coordinates come from the mesh before its modifiers.
            for name, array in geometry(original, "MESH", shape_alone=True):
                self._array(name, array)
        if item.type == "VOLUME":
            self._volume(data)

    def _volume(self, data: Any) -> None:
        from .key_images import file_digest

        self._structs.add(data)
        self._structs.add(data.render)
        path = data.grids.frame_filepath or data.filepath
        self._add(file_digest(path), data.is_sequence and data.grids.frame)


def _slots(item: Any) -> list[Any]:
    return list(item.material_slots)


def _nodes(item: Any) -> list[Any]:
    return list(item.node_tree.nodes) if item.node_tree else []
