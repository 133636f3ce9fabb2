"""Changes of a stage that no single setting makes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from tests.support.guides import images
from tests.support.guides.settings import SHADE, put, split
from xrds_lab.studio.geometry import box
from xrds_lab.studio.nodes import solid

Deed = Callable[[Path], None]
"""Is given the folder of the stage's images."""


def _scene() -> Any:
    return bpy.data.scenes["Scene"]


def _tree(material: str) -> Any:
    return bpy.data.materials[material].node_tree


def _shader(material: str) -> Any:
    return _tree(material).nodes["Principled BSDF"]


def cut_by_marker(_: Path) -> None:
    """Another camera, bound to a marker of the time line."""
    for name, frame in (("Main", 1), ("Other", 2)):
        marker = _scene().timeline_markers.new(name, frame=frame)
        marker.camera = bpy.data.objects[name]
    _scene().frame_set(2)


def marker_alone(_: Path) -> None:
    """A marker that binds no other camera."""
    _scene().timeline_markers.new("Beat", frame=1)


def border(_: Path) -> None:
    """A part of the picture."""
    put('scenes["Scene"].render.use_border', True)
    put('scenes["Scene"].render.border_max_x', 0.5)


def other_border(folder: Path) -> None:
    """Another part."""
    border(folder)
    put('scenes["Scene"].render.border_min_y', 0.5)


def stereo(_: Path) -> None:
    """Two views."""
    _scene().render.use_multiview = True


def focus_on_distance(_: Path) -> None:
    """Focus that follows nothing."""
    bpy.data.cameras["Lens"].dof.focus_object = None


def focused_bone_moves(_: Path) -> None:
    """The bone in focus, which moves nothing else, goes towards the camera."""
    bpy.data.objects["Puller"].pose.bones["Focus"].location = (0.0, 0.0, 6.0)


def next_frame(_: Path) -> None:
    """The next frame of what knows the time."""
    _scene().frame_set(_scene().frame_current + 1)


def animated(_: Path) -> None:
    """An object that keys move, at another frame."""
    plain = bpy.data.objects["Plain"]
    for frame, x in ((1, plain.location.x), (11, plain.location.x + 1)):
        plain.location.x = x
        plain.keyframe_insert("location", frame=frame)
    _scene().frame_set(6)


def animated_node(_: Path) -> None:
    """A shader's input that keys change."""
    socket = _shader("Grey").inputs["Base Color"]
    socket.keyframe_insert("default_value", frame=1)
    socket.default_value = (0.9, 0.1, 0.1, 1)
    socket.keyframe_insert("default_value", frame=11)
    _scene().frame_set(6)


def driven_modifier(_: Path) -> None:
    """An input of geometry nodes that a driver sets."""
    owner, name = split(SHADE)
    owner.driver_add(name).driver.expression = "0.9"


def driven_property(_: Path) -> None:
    """A custom property that a driver sets."""
    driver = bpy.data.objects["Tint"].driver_add('["tint"]').driver
    driver.expression = "0.9"


def driven_visibility(_: Path) -> None:
    """A driver that hides an object from the render."""
    bpy.data.objects["Plain"].driver_add("hide_render").driver.expression = "1"


def material_by_object(_: Path) -> None:
    """Another material, of the object in place of its mesh."""
    slot = bpy.data.objects["Slots"].material_slots[0]
    slot.link, slot.material = "OBJECT", bpy.data.materials["Second"]


def thing_added(_: Path) -> None:
    """One more object."""
    mesh = box(0.5, 0.5, 0.5).mesh("New")
    mesh.materials.append(solid("New", Base_Color=(0.9, 0.2, 0.1)))
    item = bpy.data.objects.new("New", mesh)
    item.location = (0, -2, 0)
    _scene().collection.objects.link(item)


def thing_removed(_: Path) -> None:
    """One object less."""
    bpy.data.objects.remove(bpy.data.objects["Plain"])


def crowd_grows(_: Path) -> None:
    """One more object in a collection that is instanced."""
    bpy.data.collections["Crowd"].objects.link(bpy.data.objects["Tint"])


def instanced_geometry_changes(_: Path) -> None:
    """The mesh that instances share."""
    for vertex in bpy.data.objects["Small"].data.vertices:
        vertex.co.z *= 0.5


def node_linked(_: Path) -> None:
    """A link less."""
    link = _shader("Noise").inputs["Base Color"].links[0]
    _tree("Noise").links.remove(link)


def node_link_muted(_: Path) -> None:
    """A link that is off."""
    _shader("Noise").inputs["Base Color"].links[0].is_muted = True


def other_output(_: Path) -> None:
    """Another of a node's outputs."""
    tree = _tree("Info")
    info = next(node for node in tree.nodes if node.type == "OBJECT_INFO")
    tree.links.new(info.outputs["Alpha"], _shader("Info").inputs["Base Color"])


def ramp_stop_added(_: Path) -> None:
    """One more stop of a colour ramp."""
    _tree("Noise").nodes["Ramp"].color_ramp.elements.new(0.5).color = (0, 0, 0, 1)


def osl(_: Path) -> None:
    """A renderer's other shading system."""
    _scene().cycles.shading_system = True


def vertex_weight(_: Path) -> None:
    """The weight of one vertex in a group that a shader reads."""
    bpy.data.objects["Worn"].vertex_groups["worn"].add([1, 3], 1.0, "REPLACE")


def vertex_left_out(_: Path) -> None:
    """Vertices that leave their group."""
    bpy.data.objects["Worn"].vertex_groups["worn"].remove([0, 1, 2, 3])


def mesh_attribute_gone(_: Path) -> None:
    """An attribute less."""
    mesh = bpy.data.meshes["Named"]
    mesh.attributes.remove(mesh.attributes["shade"])


def mesh_path_shown(_: Path) -> None:
    """An Attribute node that reads a path of the mesh, which then changes."""
    node = _tree("Data").nodes["Attribute"]
    node.attribute_name = "auto_smooth_angle"
    node.attribute_name = "texspace_size.x"


def layer_path_shown(_: Path) -> None:
    """An Attribute node that reads a path of the view layer."""
    _tree("Layer").nodes["Attribute"].attribute_name = "pass_alpha_threshold"


def scene_path_of_frame(_: Path) -> None:
    """An Attribute node that reads the frame's number, one frame on."""
    _tree("ScenePath").nodes["Attribute"].attribute_name = "frame_current"
    _scene().frame_set(2)


def smooth_shading(_: Path) -> None:
    """Smooth faces."""
    mesh = bpy.data.meshes["Plain"]
    mesh.polygons.foreach_set("use_smooth", [True] * len(mesh.polygons))
    mesh.update()


def uv_moved(_: Path) -> None:
    """Texture coordinates turned over."""
    layer = bpy.data.meshes["Filed"].uv_layers[0].data
    values = np.empty(len(layer) * 2, np.float32)
    layer.foreach_get("uv", values)
    layer.foreach_set("uv", 1 - values)


def modifier_added(_: Path) -> None:
    """One more modifier."""
    bpy.data.objects["Plain"].modifiers.new("Thin", "WIREFRAME")


def modifier_order(_: Path) -> None:
    """Modifiers in another order."""
    item = bpy.data.objects["Round"]
    item.modifiers.new("Twin", "ARRAY").relative_offset_displace = (0.3, 0, 0)
    item.modifiers.move(0, 1)


def world_changed_by_node(_: Path) -> None:
    """A texture in the world."""
    tree = _scene().world.node_tree
    sky = tree.nodes.new("ShaderNodeTexGradient")
    tree.links.new(sky.outputs[0], tree.nodes["Background"].inputs[0])


def cryptomatte(_: Path) -> None:
    """One more data pass."""
    _scene().view_layers[0].use_pass_cryptomatte_object = True


def bone_constraint(_: Path) -> None:
    """A bone that a constraint turns."""
    bone = bpy.data.objects["Rig"].pose.bones["Bone"]
    limit = bone.constraints.new("LIMIT_ROTATION")
    limit.use_limit_x, limit.min_x, limit.max_x = True, 0.6, 0.8


def bone_parent(_: Path) -> None:
    """An object on a bone, which moves."""
    item = bpy.data.objects["Plain"]
    item.parent, item.parent_type = bpy.data.objects["Rig"], "BONE"
    item.parent_bone = "Bone"


def constraint_added(_: Path) -> None:
    """A constraint of an object that is seen."""
    item = bpy.data.objects["Tint"]
    item.constraints.new("COPY_ROTATION").target = bpy.data.objects["Child"]
    bpy.data.objects["Child"].rotation_euler[2] = 1.2


def instance_on_faces(_: Path) -> None:
    """Children instanced on the faces of their parent."""
    parent = bpy.data.objects["Round"]
    bpy.data.objects["Dot"].parent = parent
    parent.instance_type = "FACES"


def nodes_input_default(_: Path) -> None:
    """The mesh that geometry nodes start from."""
    for vertex in bpy.data.meshes["Scattered"].vertices:
        vertex.co.x *= 1.3


def point_radius(_: Path) -> None:
    """A curve's radius at one point."""
    bpy.data.curves["Curve"].splines[0].points[0].radius = 2.0


def selected(_: Path) -> None:
    """Another selection."""
    bpy.data.objects["Plain"].select_set(True)
    bpy.context.view_layer.objects.active = bpy.data.objects["Tint"]


def lamp_added(_: Path) -> None:
    """One more lamp that nobody sees."""
    item = bpy.data.objects.new("Extra", bpy.data.lights.new("Extra", "POINT"))
    item.location, item.data.shadow_soft_size = (0, -9, 3), 0.0
    _scene().collection.objects.link(item)


def saved_and_opened(folder: Path) -> None:
    """The same file, saved again."""
    path = str(folder / "again.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)


def unused_material(_: Path) -> None:
    """A material that nothing wears."""
    bpy.data.materials.new("Unused").use_fake_user = True


STILL: tuple[Deed, ...] = (
    cut_by_marker,
    border,
    other_border,
    stereo,
    images.file_rewritten,
    images.file_of_equal_size_and_time,
    images.file_gone,
    images.texel_painted,
    images.texel_packed,
    animated,
    animated_node,
    driven_modifier,
    driven_property,
    driven_visibility,
    material_by_object,
    thing_added,
    thing_removed,
    crowd_grows,
    instanced_geometry_changes,
    node_linked,
    node_link_muted,
    other_output,
    ramp_stop_added,
    osl,
    vertex_weight,
    vertex_left_out,
    mesh_attribute_gone,
    mesh_path_shown,
    layer_path_shown,
    scene_path_of_frame,
    smooth_shading,
    uv_moved,
    modifier_added,
    modifier_order,
    world_changed_by_node,
    cryptomatte,
    bone_constraint,
    bone_parent,
    constraint_added,
    instance_on_faces,
    nodes_input_default,
    point_radius,
    images.viewer_as_texture,
)
LENS: tuple[Deed, ...] = (focus_on_distance, focused_bone_moves)
TIMED: tuple[Deed, ...] = (next_frame, images.sequence_file_rewritten)
HARMLESS: tuple[Deed, ...] = (
    marker_alone,
    selected,
    lamp_added,
    saved_and_opened,
    unused_material,
    images.viewer,
)
