"""A key for guides: a hash of what albedo and normal depend on.

Everything that an evaluated scene holds goes in, but for what is known not to matter:
light, samples, denoising, output. So what nobody thought of costs a render. What no
data-block shows (a file that changed while its times did not, a renderer's own state)
the key cannot know; a probe render proves it (`cycles/guide_probe.py`). What cannot be
followed at all raises NotFollowed.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from typing import Any

import numpy as np

from ..planning.plan import SceneFacts
from .hashing import StructHash, geometry, mesh, particles, pose, vertex_group
from .outer_files import file_digest, image_digest

# Counts up whenever the guide render itself changes what it gives.
GENERATION = 2
_SHAPES = {"CURVE", "SURFACE", "FONT", "META"}
_SEEN = {"MESH", "CURVES", "POINTCLOUD", "VOLUME", *_SHAPES}
# Data-blocks that act through others, or not at all.
_SILENT = "Scene Action Key Brush Sound Speaker Library Palette Screen NodeTree"
# Of `scene.cycles`: what a guide render sets itself or never looks at.
_CYCLES_LEFT_OUT = (
    "samples use_sample_subset sample_offset sample_subset_length seed "
    "use_animated_seed time_limit use_layer_samples use_adaptive_sampling "
    "adaptive_threshold adaptive_min_samples sampling_pattern use_denoising denoiser "
    "max_bounces diffuse_bounces volume_bounces min_light_bounces "
    "light_sampling_threshold use_light_tree direct_light_sampling_type "
    "caustics_reflective caustics_refractive blur_glossy use_fast_gi fast_gi_method "
    "ao_bounces ao_bounces_render sample_clamp_direct sample_clamp_indirect "
    "use_auto_tile tile_size scrambling_distance auto_scrambling_distance"
)
_CYCLES_PREFIXES = (
    *("preview_", "denoising_", "use_preview", "bake_", "debug_"),
    *("use_guiding", "guiding_", "use_surface_guiding"),
    *("use_volume_guiding", "surface_guiding", "volume_guiding"),
    "use_deterministic_guiding",
)
# Of `scene.render`: the size, which the frame gives, and what comes after a render.
_RENDER_LEFT_OUT = (
    "filepath engine image_settings ffmpeg resolution_x resolution_y "
    "resolution_percentage threads threads_mode use_compositing use_sequencer "
    "use_persistent_data use_overwrite use_placeholder use_file_extension "
    "use_lock_interface use_render_cache use_single_layer use_stereo_viewport "
    "dither_intensity display_mode use_freestyle line_thickness line_thickness_mode "
    "use_crop_to_border simplify_subdivision simplify_child_particles "
    "frame_path is_movie_format file_extension stereo_views views bake "
    "use_high_quality_normals use_spherical_stereo has_multiple_engines"
)
_RENDER_PREFIXES = (
    *("preview_", "stamp_", "use_stamp", "bake_", "use_bake", "metadata_"),
    *("sequencer_", "use_sequencer", "compositor_", "simplify_gpencil"),
)
# Of a view layer: what it holds by name, and what no light passes.
_LAYER_LEFT_OUT = (
    "use samples objects depsgraph layer_collection active_layer_collection eevee "
    "freestyle_settings use_freestyle lightgroups active_lightgroup active_aov "
    "active_lightgroup_index active_aov_index"
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
    """Raise NotFollowed for what a look at this frame cannot show."""
    if facts.motion_blur and facts.moving:
        moving = ", ".join(facts.moving)
        raise NotFollowed(f"motion blur of {moving}, whose path is not looked at")
    if facts.shadow_catchers:
        raise NotFollowed("a shadow catcher, whose guides hold light")
    if facts.unknown_nodes:
        raise NotFollowed(f"shader nodes {', '.join(facts.unknown_nodes)}")
    if getattr(depsgraph.scene_eval.cycles, "shading_system", False):
        raise NotFollowed("Open Shading Language, whose scripts may read anything")
    for item in depsgraph.scene_eval.objects:
        if any(system.settings.type == "HAIR" for system in item.particle_systems):
            raise NotFollowed(f"particle hair on {item.name}")


class _SceneHash:
    """Feeds one scene to a hash; every data-block once."""

    def __init__(self, depsgraph: Any, facts: SceneFacts) -> None:
        import bpy

        self._graph, self._facts, self._types = depsgraph, facts, bpy.types
        self._hash = hashlib.blake2b(digest_size=20)
        self._structs = StructHash(self._add, self._reference)
        self._silent = tuple(getattr(bpy.types, name) for name in _SILENT.split())
        self._done: set[Any] = set()
        self._waiting: list[Any] = []
        self._objects: list[Any] = []
        self._is_timed = False
        self._add("blender", bpy.app.version_string, GENERATION)

    def key(self, frame: Any) -> str:
        scene = self._graph.scene_eval
        self._add("frame", frame)
        self._settings(scene, self._graph.view_layer_eval)
        for item in self._ordered(self._graph.ids):
            self._data_block(item)
        while self._waiting:  # what the graph does not list, but something points at
            self._data_block(self._waiting.pop())
        for instance in self._graph.object_instances:
            if instance.object.type in _SEEN:
                self._instance(instance)
        self._read_by_shaders()
        if self._is_timed or self._structs.is_timed:
            self._add("time", scene.frame_current, scene.frame_subframe)
        return self._hash.hexdigest()

    def _ordered(self, ids: Iterable[Any]) -> list[Any]:
        named = [(type(item).__name__, item.name_full, item) for item in ids]
        return [item for *_, item in sorted(named, key=lambda entry: entry[:2])]

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
        self._structs.add(scene.render, _RENDER_LEFT_OUT.split(), _RENDER_PREFIXES)
        self._structs.add(layer, _LAYER_LEFT_OUT.split())
        self._structs.custom(scene)
        for item in (scene.camera, scene.world):
            self._add(item and item.name_full)
        self._collections(self._graph.view_layer.layer_collection)

    def _collections(self, layer: Any) -> None:
        flags = layer.exclude, layer.holdout, layer.indirect_only, layer.hide_viewport
        self._add("collection", layer.name, flags)
        for child in layer.children:
            self._collections(child)

    def _reference(self, item: Any) -> None:
        """What a setting points at: its name here, what it holds by itself."""
        if self._is_shown(item):
            raise NotFollowed(f"the image {item.name}, which every render changes")
        if not self._counts(item):
            return
        self._add(type(item).__name__, item.name_full)
        if isinstance(item, self._types.NodeTree):
            self._structs.tree(item)
        elif self._name(item) not in self._done:
            self._waiting.append(item)

    def _name(self, item: Any) -> tuple[str, str]:
        return type(item).__name__, item.name_full

    def _data_block(self, item: Any) -> None:
        """Everything but geometry, which comes with the instances."""
        name, types = self._name(item), self._types
        if name in self._done or isinstance(item, self._silent):
            return
        self._done.add(name)
        if not self._counts(item):
            return
        self._add("data-block", *name)
        self._structs.add(item)
        if isinstance(item, types.Object):
            self._placed(item)
        elif isinstance(item, types.Image):
            self._add(image_digest(item))
            self._is_timed |= item.source in {"SEQUENCE", "MOVIE"}
        elif isinstance(item, types.Text):
            self._add(item.as_string())
        elif isinstance(item, (types.CacheFile, types.Volume)):
            self._is_timed |= item.is_sequence

    def _is_shown(self, item: Any) -> bool:
        """Whether an image is what Blender shows of a render."""
        return isinstance(item, self._types.Image) and item.source == "VIEWER"

    def _counts(self, item: Any) -> bool:
        """Whether guides can depend on a data-block of light, or of the compositor."""
        types, facts = self._types, self._facts
        if isinstance(item, types.Object) and item.type == "LIGHT":
            return facts.seen_lamps > 0
        if isinstance(item, types.Light):
            return facts.seen_lamps > 0
        if self._is_shown(item):
            return False  # in the compositor; where shaders see it, see `_reference`
        if isinstance(item, types.World):
            unseen = facts.film_transparent and not (facts.smooth or facts.volumes)
            return not unseen or any(n.type == "OUTPUT_AOV" for n in _nodes(item))
        return True

    def _placed(self, item: Any) -> None:
        """Objects that are not rendered may place textures, focus and cameras."""
        self._objects.append(item)
        self._array("matrix", np.array(item.matrix_world, np.float32))
        if item.type == "ARMATURE":
            self._array("pose", pose(item))
        for system in item.particle_systems:
            self._is_timed = True  # a particle's age is counted from the frame
            self._add("particles", system.name, system.seed, system.settings.name_full)
            for name, array in particles(system):
                self._array(name, array)

    def _instance(self, instance: Any) -> None:
        item, parent = instance.object, instance.parent
        self._array("instance", np.array(instance.matrix_world, np.float32))
        self._add(
            item.name_full,
            parent and parent.name_full,
            instance.random_id,
            tuple(instance.persistent_id),
            tuple(instance.uv),
            tuple(instance.orco),
        )
        data = item.data
        pointer = None if data is None else data.as_pointer()
        # Data without a name of its own can share one: its address tells it apart.
        name = item.type, item.name_full, pointer, instance.is_instance
        if name in self._done:
            return
        self._done.add(name)
        slots = [slot.material and slot.material.name_full for slot in _slots(item)]
        self._add(*slots)
        self._geometry(item)

    def _geometry(self, item: Any) -> None:
        if item.type == "MESH":
            arrays = mesh(item)
        elif item.type in _SHAPES:
            arrays = geometry(item.to_mesh(), item.type)
        else:
            arrays = geometry(item.data, item.type)
        try:
            for name, array in arrays:
                self._array(name, array)
        except TypeError as error:
            raise NotFollowed(f"geometry of {item.name}: {error}") from error
        finally:
            if item.type in _SHAPES:
                item.to_mesh_clear()
        if item.type == "VOLUME":
            data = item.data
            path = data.grids.frame_filepath or data.filepath
            self._add(file_digest(path), data.is_sequence and data.grids.frame)

    def _read_by_shaders(self) -> None:
        """What Attribute nodes find by a name: any property, or a vertex group."""
        scene, layer = self._graph.scene_eval, self._graph.view_layer_eval
        for kind, name in sorted(self._structs.attributes):
            owners: list[Any] = [layer, scene, scene.world]
            if kind in {"OBJECT", "INSTANCER"}:
                owners = [
                    owner for item in self._objects for owner in (item, item.data)
                ]
            if kind != "GEOMETRY":
                self._add(kind, name, [_resolved(owner, name) for owner in owners])
                continue
            for item in self._objects:
                if item.type == "MESH" and name in item.vertex_groups:
                    self._array(name, vertex_group(item, name))


def _resolved(owner: Any, path: str) -> str:
    """The value at a path of Blender's data, as text; empty where there is none."""
    try:
        value = owner.path_resolve(path)
    except (ValueError, AttributeError):
        return ""
    # Of a struct the text would hold its address; shaders read numbers alone.
    return "" if hasattr(value, "bl_rna") else repr(value)


def _slots(item: Any) -> list[Any]:
    return list(item.material_slots)


def _nodes(item: Any) -> list[Any]:
    return list(item.node_tree.nodes) if item.node_tree else []
