"""Facts of a scene, its cuts and the light passes that somebody looks at.

Read from Blender's data without rendering.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import islice, pairwise
from typing import Any

from xrds_core.denoising.light_passes import ALL, NONE, Wanted, find_parts
from xrds_core.exr.channels import Channels

from ..planning.plan import SceneFacts
from .closures import Closures, of_tree, reachable
from .hashing import TIMED_NODES

_SURFACES = {
    "MESH",
    "CURVE",
    "SURFACE",
    "FONT",
    "META",
    "CURVES",
    "POINTCLOUD",
    "VOLUME",
}
_HAIR = {"CURVES"}
# Modifiers whose result is the same in every frame unless something they use moves,
# which then is found by itself.
_STILL_MODIFIERS = (
    "ARMATURE ARRAY BEVEL BOOLEAN CAST CORRECTIVE_SMOOTH CURVE DATA_TRANSFER DECIMATE "
    "DISPLACE EDGE_SPLIT HOOK LAPLACIANDEFORM LAPLACIANSMOOTH LATTICE MASK MESH_DEFORM "
    "MIRROR MULTIRES NODES NORMAL_EDIT REMESH SCREW SHRINKWRAP SIMPLE_DEFORM SKIN "
    "SMOOTH SMOOTH_BY_ANGLE SOLIDIFY SUBSURF SURFACE_DEFORM TRIANGULATE UV_PROJECT "
    "UV_WARP VERTEX_WEIGHT_EDIT VERTEX_WEIGHT_MIX VERTEX_WEIGHT_PROXIMITY WARP "
    "WEIGHTED_NORMAL WELD WIREFRAME"
)
_NAMED = 3  # of what moves; more would not help a reader


def scene_facts(depsgraph: Any) -> SceneFacts:
    """Look at an evaluated scene once; cheap, nothing is rendered or changed."""
    import bpy

    scene, ids = depsgraph.scene_eval, list(depsgraph.ids)
    objects = [item for item in ids if isinstance(item, bpy.types.Object)]
    materials = [item for item in ids if isinstance(item, bpy.types.Material)]
    by_material = {item.name: of_material(item) for item in materials}
    solid = [item for item in objects if item.type in _SURFACES]
    surface = Closures(scatters=bool(solid))  # what has no material is white
    for closures in by_material.values():
        surface |= closures
    if solid and by_material and not _has_bare_slot(solid):
        surface = _unite_closures(by_material.values())
    kind, air = _look_at_world(scene.world)
    lamps = [item for item in objects if item.type == "LIGHT"]
    return SceneFacts(
        surfaces=bool(solid),
        scatters=surface.scatters or air.scatters,
        smooth=surface.smooth,
        glass=surface.glass,
        transparent=surface.transparent,
        volumes=surface.volume or air.volume or any(o.type == "VOLUME" for o in solid),
        emitters=tuple(
            sorted(name for name, closures in by_material.items() if closures.emits)
        ),
        lamps=len(lamps),
        seen_lamps=sum(_is_seen(lamp, surface.smooth) for lamp in lamps),
        world=kind,
        textures=surface.varies,
        bump=surface.bump,
        displacement=surface.displaced or any(_is_diced(item) for item in solid),
        subsurface=surface.subsurface,
        hair=any(item.type in _HAIR or _has_hair(item) for item in objects),
        depth_of_field=scene.camera is None or _has_blur(scene.camera.data),
        motion_blur=scene.render.use_motion_blur,
        moving=tuple(islice(_find_moving(ids, objects), _NAMED)),
        film_transparent=scene.render.film_transparent,
        shadow_catchers=any(item.is_shadow_catcher for item in solid),
        passes=requested_passes(depsgraph.view_layer_eval),
        materials=len(materials),
        unknown_nodes=surface.unknown,
    )


def of_material(material: Any) -> Closures:
    """What a material can do; one without nodes is diffuse."""
    if not _uses_nodes(material):
        return Closures(scatters=True)
    return of_tree(material.node_tree)


def _uses_nodes(item: Any) -> bool:
    """Whether a material's or a world's tree counts; from Blender 5.0 on it does."""
    import bpy

    return item.node_tree is not None and (bpy.app.version >= (5,) or item.use_nodes)


def requested_passes(layer: Any) -> tuple[str, ...]:
    """Names of the view layer's switches that are on, but for the picture's own."""
    owners = layer, layer.cycles
    names = [
        item.identifier.removeprefix("use_pass_")
        for owner in owners
        for item in owner.bl_rna.properties
        if item.identifier.startswith("use_pass_") and getattr(owner, item.identifier)
    ]
    # Accuracy is an option of cryptomatte, not a pass.
    return tuple(n for n in names if n not in {"combined", "cryptomatte_accurate"})


def _unite_closures(all_closures: Iterable[Closures]) -> Closures:
    merged = Closures()
    for closures in all_closures:
        merged |= closures
    return merged


def _has_bare_slot(objects: list[Any]) -> bool:
    """Whether an object has a slot without a material, or no slot."""
    slots = [[slot.material for slot in item.material_slots] for item in objects]
    return any(not materials or None in materials for materials in slots)


def _look_at_world(world: Any) -> tuple[str, Closures]:
    if world is None:
        return "none", Closures()
    if not _uses_nodes(world):
        return ("constant" if any(world.color) else "none"), Closures()
    light = of_tree(world.node_tree)
    if light.varies or any(n.type == "LIGHT_PATH" for n in reachable(world.node_tree)):
        return "varies", light
    return ("constant" if light.emits else "none"), light


def _is_seen(item: Any, smooth: bool) -> bool:
    """Whether rays that albedo and normal follow can end on a lamp.

    Lamps without extent are never hit, nor those left out of forward paths.
    """
    lamp = item.data
    if not getattr(lamp.cycles, "use_multiple_importance_sampling", True):
        return False
    if getattr(lamp.cycles, "is_portal", False):
        return False
    extent = {"SUN": "angle", "POINT": "shadow_soft_size", "SPOT": "shadow_soft_size"}
    if lamp.type in extent and not getattr(lamp, extent[lamp.type]):
        return False
    mirrored = item.visible_glossy or item.visible_transmission
    return item.visible_camera or (smooth and mirrored)


def _is_diced(item: Any) -> bool:
    return bool(getattr(item.cycles, "use_adaptive_subdivision", False))


def _has_hair(item: Any) -> bool:
    return any(system.settings.type == "HAIR" for system in item.particle_systems)


def _has_blur(camera: Any) -> bool:
    return camera.type == "PANO" or (camera.type != "ORTHO" and camera.dof.use_dof)


def _find_moving(ids: list[Any], objects: list[Any]) -> Iterator[str]:
    """Names of what may differ in the next frame."""
    import bpy

    handlers = bpy.app.handlers
    if handlers.frame_change_pre or handlers.frame_change_post:
        yield "a script at frame changes"
    for item in ids:
        trees = [item, getattr(item, "node_tree", None)]
        if any(tree is not None and _is_animated(tree) for tree in trees):
            yield item.name
        if isinstance(item, bpy.types.Image) and item.source in {"SEQUENCE", "MOVIE"}:
            yield item.name
        if isinstance(item, bpy.types.NodeTree) and _is_timed(item):
            yield item.name
        if isinstance(item, bpy.types.CacheFile):
            yield item.name
        if isinstance(item, bpy.types.Volume) and item.is_sequence:
            yield item.name
    for item in objects:
        if item.rigid_body or item.soft_body or _is_simulated(item):
            yield item.name


def _is_animated(owner: Any) -> bool:
    animation = getattr(owner, "animation_data", None)
    return bool(
        animation and (animation.action or animation.drivers or animation.nla_tracks)
    )


def stands_still(camera: Any) -> bool:
    """Whether nothing in the file moves the camera or its lens; a handler still may."""
    owners = [camera.data]
    while camera is not None:
        owners.append(camera)
        if camera.constraints or camera.rigid_body or camera.parent_bone:
            return False
        camera = camera.parent
    return not any(_is_animated(owner) for owner in owners)


def frame_range(scene: Any) -> range:
    """Numbers of the frames that Blender would render as the animation."""
    return range(scene.frame_start, scene.frame_end + 1, scene.frame_step)


def moves_in_time(scene: Any) -> bool:
    """Whether anything in the scene changes from frame to frame."""
    layer = next((x for x in scene.view_layers if x.use), scene.view_layers[0])
    layer.update()
    return layer.depsgraph is not None and bool(scene_facts(layer.depsgraph).moving)


def shapes_move(depsgraph: Any) -> bool:
    """Whether anything but camera and light may lie elsewhere in another frame."""
    import bpy

    light = bpy.types.Light, bpy.types.World, bpy.types.Material, bpy.types.Scene
    kinds = *light, bpy.types.Camera, bpy.types.Image, bpy.types.ShaderNodeTree
    unseen = {"CAMERA", "LIGHT"}
    carriers = {
        parent.name_full
        for item in depsgraph.ids
        if isinstance(item, bpy.types.Object) and item.type not in unseen
        for parent in _find_parents(item)
    }

    def is_shape(item: Any) -> bool:
        if isinstance(item, bpy.types.Object):
            return item.type not in unseen or item.name_full in carriers
        return not isinstance(item, kinds)

    ids = [item for item in depsgraph.ids if is_shape(item)]
    objects = [item for item in ids if isinstance(item, bpy.types.Object)]
    return any(True for _ in _find_moving(ids, objects))


def _find_parents(item: Any) -> Iterator[Any]:
    while (item := item.parent) is not None:
        yield item


def _is_timed(tree: Any) -> bool:
    return any(node.type in TIMED_NODES for node in tree.nodes)


def _is_simulated(item: Any) -> bool:
    modifiers = [modifier.type for modifier in item.modifiers]
    emitting = any(system.settings.type != "HAIR" for system in item.particle_systems)
    # A particle system left is hair: what is emitted was asked for.
    still = {*_STILL_MODIFIERS.split(), "PARTICLE_SYSTEM"}
    return emitting or any(m not in still for m in modifiers)


def cuts(scene: Any, frames: Sequence[int]) -> frozenset[int]:
    """Frames, of those given in order, that begin the take of another camera."""
    bound = sorted(
        (m.frame, m.camera.name_full) for m in scene.timeline_markers if m.camera
    )
    if not bound:
        return frozenset()
    pairs = pairwise((number, _camera(bound, number)) for number in frames)
    return frozenset(number for (_, old), (number, new) in pairs if old != new)


def _camera(bound: list[tuple[int, str]], number: int) -> str:
    """The name of a frame's camera: before the first marker it is the first one's."""
    before = [name for frame, name in bound if frame <= number]
    return before[-1] if before else bound[0][1]


# Switches of a view layer.
_LIGHT = {
    *("diffuse_direct", "diffuse_indirect", "glossy_direct", "glossy_indirect"),
    *("transmission_direct", "transmission_indirect", "volume_direct"),
    *("volume_indirect", "emit", "environment", "shadow_catcher"),
}
_IMAGES = ("OPEN_EXR_MULTILAYER", "MULTILAYER")


def passes_looked_at(scene: Any) -> tuple[str, ...]:
    """The light passes that are looked at: ALL of them, or NONE.

    ALL where the file that is written holds them or the compositor reads one.
    """
    is_written = scene.render.image_settings.file_format in _IMAGES
    return (ALL,) if is_written or _is_composited(scene) else (NONE,)


def has_light(layer: Any) -> bool:
    """Whether a view layer has light passes beside the picture."""
    return bool(len(layer.lightgroups)) or bool(_LIGHT & {*requested_passes(layer)})


def compositor_of(scene: Any) -> Any:
    """The node tree that a render of the scene is to go through; None without one."""
    if not scene.render.use_compositing:
        return None
    if hasattr(scene, "compositing_node_group"):  # Blender 5.0 and later
        return scene.compositing_node_group
    return scene.node_tree if scene.use_nodes else None


def _is_composited(scene: Any) -> bool:
    """Whether a node of the compositor takes light of a view layer."""
    tree = compositor_of(scene)
    read = {
        f"{socket.name}.{letter}": None
        for node in (tree.nodes if tree else ())
        if node.type == "R_LAYERS"
        for socket in node.outputs
        if socket.is_linked
        for letter in "RGB"
    }
    wanted = Wanted((ALL,))
    # a lobe counts without the colour that it was divided by
    lobes = (lobe for renderer in wanted.renderers for lobe in renderer.lobes)
    names = {name for lobe in lobes for name in lobe.colour}
    colours = {f"{name}.{letter}": None for name in names for letter in "RGB"}
    return bool(find_parts(Channels(scene.name, {**read, **colours}), "", wanted))
