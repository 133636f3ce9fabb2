"""Changes of single settings: the path of each in Blender's data, and its new value."""

from __future__ import annotations

from typing import Any

import bpy

_S, _L = 'scenes["Scene"]', 'scenes["Scene"].view_layers["ViewLayer"]'
_R, _C = f"{_S}.render", f"{_S}.cycles"
_MAIN, _LENS = 'cameras["Main"]', 'cameras["Lens"]'


def _of(owner: str, /, **values: Any) -> dict[str, Any]:
    return {f"{owner}.{name}": value for name, value in values.items()}


def _object(name: str, /, **values: Any) -> dict[str, Any]:
    return _of(f'objects["{name}"]', **values)


def _material(name: str, /, **values: Any) -> dict[str, Any]:
    return _of(f'materials["{name}"]', **values)


def _node(material: str, node: str, /, **values: Any) -> dict[str, Any]:
    return _of(f'materials["{material}"].node_tree.nodes["{node}"]', **values)


def _input(material: str, node: str, name: str, value: Any) -> dict[str, Any]:
    path = f'inputs["{name}"].default_value'
    return _node(material, node, **{path: value})


def _modifier(name: str, modifier: str, /, **values: Any) -> dict[str, Any]:
    return _of(f'objects["{name}"].modifiers["{modifier}"]', **values)


SHADE = 'objects["Scattered"].modifiers["Scatter"]'
"""The input of geometry nodes that the colour of their instances comes from."""
if "properties" in bpy.types.NodesModifier.bl_rna.properties:  # in Blender 5.2
    SHADE += ".properties.inputs.Socket_2.value"
else:
    SHADE += '["Socket_2"]'
_SHADER, _GROUP = "Principled BSDF", 'node_groups["Scatter"].nodes'
CAMERA = {
    **_of(_MAIN, type="PERSP", ortho_scale=10.2, shift_x=0.02, shift_y=0.02),
    **_of(_MAIN, clip_start=11.8, clip_end=12.2, sensor_fit="VERTICAL"),
    **_object("Main", location=(0.2, -12, 0.4), rotation_euler=(1.5, 0, 0)),
    **_object("Main", delta_location=(0.1, 0, 0)),
    f"{_S}.camera": "Other",
}
LENS = {  # with the camera Lens, which has depth of field
    **_of(_LENS, lens=45, sensor_width=34, type="PANO", shift_x=0.01),
    **_of(f"{_LENS}.dof", use_dof=False, focus_distance=5.0, aperture_fstop=0.3),
    **_of(f"{_LENS}.dof", aperture_blades=3, aperture_ratio=2.0),
    **_of(f"{_LENS}.dof", focus_object="Tint"),
}
RENDER = {
    **_of(_R, film_transparent=True, filter_size=3.0, use_border=True),
    **_of(_R, pixel_aspect_x=1.5, pixel_aspect_y=1.5, resolution_x=52),
    **_of(_R, resolution_y=40, resolution_percentage=90, use_simplify=True),
    **_of(_C, pixel_filter_type="BOX", filter_width=3.0, transparent_max_bounces=0),
    **_of(_C, film_transparent_glass=True, film_exposure=2.0),
    **_of(_C, transmission_bounces=1, glossy_bounces=1, volume_max_steps=64),
    **_of(_C, dicing_rate=2.0),
    **_of(_L, use_sky=False, use_solid=False, use_strand=False, use_volumes=False),
    **_of(_L, use_motion_blur=False, use_ao=False, material_override="Grey"),
    **_of(_L, use_pass_z=False, use_pass_object_index=False, use_pass_position=True),
    **_of(_L, pass_alpha_threshold=0.9, use_pass_uv=True, use_pass_normal=True),
    **_of(_L, use_pass_diffuse_color=True, use_pass_glossy_color=True),
    **_of(f"{_L}.cycles", use_pass_volume_direct=True, use_denoising=False),
    **_of(f'{_L}.layer_collection.children["Apart"]', exclude=True, holdout=True),
    **_of(f'{_L}.layer_collection.children["Apart"]', indirect_only=True),
    **_of('collections["Apart"]', hide_render=True, instance_offset=(1, 0, 0)),
    f'{_L}["layer_mood"]': 0.8,
    f"{_S}.audio_volume": 0.9,
    f'{_S}["mood"]': 0.9,
    f"{_S}.world": None,
}
OBJECT = {
    **_object("Plain", location=(0.1, 0, -0.1), rotation_euler=(0, 0, 1.0)),
    **_object("Plain", scale=(0.7, 1, 1), hide_render=True, visible_camera=False),
    **_object("Plain", is_holdout=True, is_shadow_catcher=True, pass_index=3),
    **_object("Plain", delta_scale=(0.8, 1, 1), parent="Goal", data="Tint"),
    **_object("Plain", visible_glossy=False, visible_shadow=False),
    **_object("Plain", track_axis="POS_Z", name="Renamed", display_type="WIRE"),
    **_object("Plain", instance_type="VERTS"),
    **_object("Info", color=(0.1, 0.9, 0.1, 1), pass_index=2, name="Another"),
    **_object("Copies", location=(2, 0, 1), color=(0.2, 0.2, 0.9, 1)),
    **_object("Copies", instance_collection=None, show_instancer_for_render=False),
    **_object("Small", color=(0.1, 0.1, 0.9, 1), scale=(0.5, 1, 1)),
    **_object("Anchor", location=(0.3, 0, 0.2), scale=(0.5, 0.5, 0.5)),
    **_object("Goal", location=(0.5, 0, -1.0)),
    **_object("Parent", location=(0, 0, 0.2)),
    **_object("Wire", location=(0.3, -2, -2), hide_render=True),
    **_object("Dot", location=(-1.0, -2, 0.3), hide_render=True),
    **_object("Cage", scale=(1.5, 1, 1)),
    **_object("Path", delta_location=(0, 0, 0.3)),
    'objects["Tint"]["tint"]': 0.9,
    'objects["Copies"]["hue"]': 0.9,
    'meshes["Data"]["data_tint"]': 0.9,
    'meshes["DataPath"].remesh_voxel_size': 0.9,
    SHADE: 0.9,
    'objects["Follower"].constraints["Copy Location"].influence': 0.5,
    'objects["Follower"].constraints["Copy Location"].mute': True,
    'objects["Rig"].pose.bones["Bone"].location': (0.3, 0.0, 0.0),
    'objects["Rig"].pose.bones["Bone"].rotation_quaternion': (0.9, 0.4, 0, 0),
}
SHADING = {
    **_input("Grey", _SHADER, "Base Color", (0.2, 0.5, 0.5, 1)),
    **_input("Grey", _SHADER, "Roughness", 0.0),
    **_input("Grey", _SHADER, "Metallic", 1.0),
    **_input("Grey", _SHADER, "Alpha", 0.7),
    **_input("Grey", _SHADER, "Emission Strength", 1.0),
    **_input("Grey", _SHADER, "Transmission Weight", 1.0),
    **_input("Grey", _SHADER, "Coat Weight", 1.0),
    **_input("Grey", _SHADER, "Sheen Weight", 1.0),
    **_input("Grey", _SHADER, "Subsurface Weight", 1.0),
    **_input("Grey", _SHADER, "Specular IOR Level", 1.0),
    **_input("Grey", _SHADER, "IOR", 2.2),
    **_node("Grey", _SHADER, distribution="GGX", mute=True),
    **_input("Clear", _SHADER, "Alpha", 0.2),
    **_input("Shining", _SHADER, "Emission Strength", 0.1),
    **_input("Shining", _SHADER, "Emission Color", (0.9, 0.1, 0.1, 1)),
    **_input("Dot", _SHADER, "Base Color", (0.9, 0.0, 0.0, 1)),
    **_input("Wire", _SHADER, "Base Color", (0.9, 0.0, 0.0, 1)),
    **_input("Noise", "Noise Texture", "Scale", 9.0),
    **_input("Noise", "Noise Texture", "Detail", 0.0),
    **_node("Noise", "Noise Texture", noise_dimensions="2D", mute=True),
    **_node("Noise", "Noise Texture", **{"texture_mapping.scale": (2, 1, 1)}),
    **_input("Noise", "Mapping", "Rotation", (0, 1, 0)),
    **_input("Noise", "Mapping", "Location", (0.3, 0, 0)),
    **_node("Noise", "Mapping", vector_type="TEXTURE"),
    **_input("Noise", "Bump", "Strength", 0.2),
    **_node("Noise", "Bump", invert=True),
    **_node(
        "Noise", "RGB Curves", **{"mapping.curves[3].points[1].location": (1, 0.3)}
    ),
    **_node("Noise", "Ramp", **{"color_ramp.elements[0].position": 0.4}),
    **_node("Noise", "Ramp", **{"color_ramp.elements[1].color": (0, 0, 1, 1)}),
    **_node("Noise", "Ramp", **{"color_ramp.interpolation": "CONSTANT"}),
    **_node("Noise", "Brightness/Contrast", **{'inputs["Bright"].default_value': 0.4}),
    **_node("Noise", "Mix", blend_type="MULTIPLY"),
    **_node("Painted", "Image Texture", interpolation="Closest", extension="CLIP"),
    **_node("Painted", "Image Texture", projection="BOX", image="packed.png"),
    **_node("Placed", "Texture Coordinate", object="Goal"),
    **_node("Placed", "Checker Texture", **{'inputs["Scale"].default_value': 9.0}),
    **_node("Tint", "Attribute", attribute_name="other", attribute_type="GEOMETRY"),
    **_node("Worn", "Attribute", attribute_name="other"),
    **_material("Grey", use_backface_culling=True, displacement_method="BOTH"),
    **_material("Grey", pass_index=4, name="Gray"),
    'node_groups["Group"].nodes["Colour"].outputs[0].default_value': (0.9, 0, 0, 1),
    'worlds["World"].node_tree.nodes["Background"].inputs[0].default_value': (
        1,
        0,
        0,
        1,
    ),
    'worlds["World"].node_tree.nodes["Background"].inputs[1].default_value': 0.9,
    'worlds["World"].cycles_visibility.camera': False,
    'images["made"].generated_color': (0.1, 0.2, 0.9, 1),
    'images["made"].generated_type': "COLOR_GRID",
    'images["filed.png"].colorspace_settings.name': "Non-Color",
    'images["filed.png"].alpha_mode': "NONE",
}
SHAPES = {
    **_modifier("Twin", "Twin", count=3, show_render=False, use_relative_offset=False),
    **_modifier("Round", "Bevel", width=0.3, segments=3, limit_method="NONE"),
    **_modifier("Round", "Bevel", show_render=False, affect="VERTICES"),
    **_modifier("Bent", "Waves", strength=0.8, mid_level=0.1, direction="X"),
    **_modifier("Boned", "Rig", object=None, show_render=False, vertex_group="Bone"),
    **_modifier("Caged", "Cage", strength=0.5, object=None),
    **_modifier("Scattered", "Scatter", show_render=False, node_group=None),
    f'{_GROUP}["Instance on Points"].inputs["Scale"].default_value': (0.6, 0.4, 0.4),
    f'{_GROUP}["Object Info"].inputs["Object"].default_value': "Plain",
    f'{_GROUP}["Store Named Attribute"].inputs["Name"].default_value': "none",
    f'{_GROUP}["Store Named Attribute"].mute': True,
    'textures["Clouds"].noise_scale': 0.6,
    'textures["Clouds"].noise_depth': 6,
    'shape_keys["Key"].key_blocks["Tall"].value': 0.8,
    'shape_keys["Key"].key_blocks["Tall"].mute': True,
    'shape_keys["Key"].key_blocks["Tall"].data[0].co': (-0.6, -0.6, 0.1),
    'curves["Text"].body': "Ac",
    'curves["Text"].extrude': 0.1,
    'curves["Text"].size': 0.8,
    'curves["Curve"].bevel_depth': 0.15,
    'curves["Curve"].bevel_resolution': 0,
    'curves["Curve"].resolution_u': 3,
    'curves["Curve"].splines[0].points[1].co': (0, 0, 0.6, 1),
    'lattices["Cage"].points[0].co_deform': (-0.9, -0.9, -0.9),
    'meshes["Plain"].vertices[0].co': (-0.6, -0.6, 0.1),
    **{f'meshes["Slots"].polygons[{n}].material_index': n > 0 for n in range(6)},
    'meshes["Named"].attributes["shade"].data[0].value': 1.0,
    'meshes["Painted"].uv_layers[0].data[0].uv': (0.5, 0.1),
    'meshes["Plain"].use_auto_texspace': False,
    'objects["Slots"].material_slots[0].link': "OBJECT",
    'objects["Slots"].material_slots[0].material': "Grey",
    'objects["Slots"].material_slots[1].material': None,
    'objects["Worn"].vertex_groups["worn"].name': "torn",
}
TIMED = {
    'materials["Sequence"].node_tree.nodes["Image Texture"].image_user.frame_offset': 1,
    'materials["Sequence"].node_tree.nodes["Image Texture"].image_user.frame_start': 0,
    **_of('particles["Sparks"]', count=9, lifetime=30, normal_factor=0.9),
    **_of('particles["Sparks"]', particle_size=0.7, instance_object="Tint"),
    **_of(
        'particles["Sparks"]', render_type="NONE", size_random=0.5, use_rotations=True
    ),
    'objects["Source"].particle_systems[0].seed': 4,
    f"{_S}.frame_current": 3,
    f"{_R}.fps": 12,
}
SEEN = {
    **_object("Lamp", location=(0, -8, -3)),
    **_object("Bulb", location=(2.8, -1, -3), visible_camera=False, hide_render=True),
    **_of('lights["Bulb"]', energy=1.0, color=(1, 0, 0), size=0.5, shape="DISK"),
    **_of('lights["Bulb"].cycles', use_multiple_importance_sampling=False),
    **_of('lights["Lamp"]', energy=1.0),
    **_input("Mirror", _SHADER, "Roughness", 0.2),
    **_input("Glass", _SHADER, "IOR", 1.1),
    **_of(_C, max_bounces=1, glossy_bounces=0, transmission_bounces=0),
}
HARMLESS = {
    **_of('lights["Lamp"]', energy=7.0, color=(1, 0, 0), size=3.0),
    **_object("Lamp", location=(3, 0, 5), hide_render=True),
    **_of(_C, samples=99, seed=5, diffuse_bounces=9, use_denoising=True),
    **_of(_C, use_adaptive_sampling=True, sample_clamp_direct=1.0, max_bounces=5),
    **_of(_C, caustics_reflective=False, blur_glossy=0.5, use_light_tree=False),
    **_of(_R, filepath="/elsewhere/", use_compositing=False, threads=2),
    **_of(_R, use_stamp=True, use_overwrite=False, use_simplify=False),
    **_of(f"{_R}.image_settings", file_format="PNG", color_depth="16"),
    **_of(f"{_S}.view_settings", exposure=1.0, gamma=1.1),
    **_node("Noise", "Noise Texture", location=(9, 9), label="Clouds"),
    f"{_S}.frame_current": 7,
    f"{_S}.sync_mode": "FRAME_DROP",
}


def put(path: str, value: Any) -> None:
    """Set what lies at a path; of a pointer the name of what it is to point at."""
    owner, name = split(path)
    if name.startswith('["'):
        owner[name[2:-2]] = value
        return
    kind = owner.bl_rna.properties[name]
    if kind.type == "POINTER" and value is not None:
        value = getattr(bpy.data, _LISTS[kind.fixed_type.identifier])[value]
    setattr(owner, name, value)


_LISTS = {
    "Object": "objects",
    "ID": "meshes",
    "Material": "materials",
    "Image": "images",
    "Collection": "collections",
}


def split(path: str) -> tuple[Any, str]:
    """The struct that a path ends in, and the property or `["key"]` of it."""
    if path.endswith('"]'):
        owner, _, name = path.rpartition('["')
        return bpy.data.path_resolve(owner), f'["{name}'
    owner, _, name = path.rpartition(".")
    return bpy.data.path_resolve(owner), name
