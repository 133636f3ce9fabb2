"""A scene that holds one of everything guides can depend on, each seen in the picture.

Things stand on a grid before an orthographic camera, a few pixels each. `build` makes
the scene in an open empty file; images lie in a folder.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from tests.support.guides.things import Stage, painted, saved
from xrds_lab.studio.builder import empty_scene
from xrds_lab.studio.geometry import box, sheet, sphere
from xrds_lab.studio.nodes import Surface, solid

WIDTH, HEIGHT = 96, 72
WEIGHTS = (0.1, 0.3, 0.5, 0.9)


def save(folder: Path, kind: str) -> None:
    """Build a stage and save it beside its images as `stage.blend`."""
    build(folder, kind)
    for image in bpy.data.images:
        if image.filepath and not image.packed_file:
            image.filepath = f"//{Path(image.filepath).name}"
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "stage.blend"))


def build(folder: Path, kind: str = "still") -> Any:
    """Build a stage.

    `still`; `timed`, which knows the frame in several ways, `clocked` in one alone; in
    `seen` there are mirrors and a lamp in the picture.
    """
    scene = empty_scene(WIDTH, HEIGHT)
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    stage = Stage(scene, folder)
    stage.even_world((0.3, 0.4, 0.6), 0.5)
    stage.lamp("AREA", 300, (0, -8, 5), (0, 0, 0), "Lamp").visible_camera = False
    _cameras(stage)
    _shaded(stage)
    _attributes(stage)
    _deformed(stage)
    _instanced(stage)
    if kind == "timed":
        _timed(stage)
    if kind == "seen":
        _seen(stage)
    if kind == "clocked":
        _clocked(stage)
    layer = scene.view_layers[0]
    layer.use_pass_z = layer.use_pass_object_index = layer.use_pass_material_index = (
        True
    )
    return scene


def _cameras(stage: Stage) -> None:
    main = stage.camera((0.0, -12.0, 0.4), (0.0, 0.0, 0.0), 50)
    main.name = main.data.name = "Main"
    main.data.type, main.data.ortho_scale = "ORTHO", 10.0
    other = stage.link("Other", main.data.copy(), (1.0, -12.0, 0.0))
    other.rotation_euler, other.data.name = (math.radians(90), 0, 0), "Other"
    lens = stage.link("Lens", bpy.data.cameras.new("Lens"), (0.0, -12.0, 0.4))
    lens.rotation_euler = (math.radians(90), 0, 0)
    puller = stage.link("Puller", bpy.data.armatures.new("Puller"))
    _add_bone(puller, "Focus")
    lens.data.dof.focus_object, lens.data.dof.focus_subtarget = puller, "Focus"
    lens.data.dof.use_dof, lens.data.dof.aperture_fstop = True, 0.1


def _shaded(stage: Stage) -> None:
    """Materials: nodes of many kinds, images of every source, slots."""
    two = stage.thing("Slots", solid("First", Base_Color=(0.8, 0.1, 0.1)))
    two.data.materials.append(solid("Second", Base_Color=(0.1, 0.8, 0.1)))
    two.data.polygons[0].material_index = 1
    stage.pictured("Painted", painted("painted"))
    bpy.data.images["painted"].pack()  # a file keeps no others
    stage.pictured("Filed", saved(stage.folder / "filed.png"))
    packed = saved(stage.folder / "packed.png")
    packed.pack()
    stage.pictured("Packed", packed)
    stage.pictured("Made", bpy.data.images.new("made", 8, 8))
    bpy.data.images["made"].generated_color = (0.5, 0.2, 0.1, 1)
    _procedural(stage)
    grouped = bpy.data.node_groups.new("Group", "ShaderNodeTree")
    grouped.interface.new_socket("Out", in_out="OUTPUT", socket_type="NodeSocketColor")
    inside, end = (grouped.nodes.new(n) for n in ("ShaderNodeRGB", "NodeGroupOutput"))
    inside.name = "Colour"
    grouped.links.new(inside.outputs[0], end.inputs[0])
    surface = Surface("Grouped")
    surface.set(Base_Color=surface.add("Group", node_tree=grouped).outputs[0])
    stage.thing("Grouped", surface.material)
    surface = Surface("Placed")
    anchor = stage.empty("Anchor")
    where = surface.add("TexCoord", object=anchor).outputs["Object"]
    surface.set(Base_Color=surface.add("TexChecker", Vector=where).outputs["Color"])
    stage.thing("Placed", surface.material)
    surface = Surface("Info")
    info = surface.add("ObjectInfo")
    colour = surface.mix(info.outputs["Color"], info.outputs["Random"], 0.5)
    surface.set(Base_Color=surface.mix(colour, info.outputs["Object Index"], 0.3))
    stage.thing("Info", surface.material)
    surface = Surface("Driven")
    value = surface.add("Value")
    value.name = "Driven"
    surface.set(Base_Color=value.outputs[0])
    driver = value.outputs[0].driver_add("default_value").driver
    variable = driver.variables.new()
    variable.name, variable.targets[0].id_type = "mood", "SCENE"
    variable.targets[0].id = stage.scene
    variable.targets[0].data_path = '["mood"]'
    stage.scene["mood"], driver.expression = 0.4, "mood"
    stage.thing("Driven", surface.material)
    clear = solid("Clear", Alpha=0.5, Base_Color=(0.9, 0.9, 0.2))
    stage.thing("Clear", clear)
    shining = solid("Shining", Emission_Color=(0.2, 0.5, 0.3), Emission_Strength=0.5)
    stage.thing("Shining", shining)


def _procedural(stage: Stage) -> None:
    surface = Surface("Noise")
    where = surface.add("TexCoord").outputs["Generated"]
    turned = surface.add("Mapping", Vector=where, Rotation=(0.2, 0, 0)).outputs[0]
    noise = surface.add("TexNoise", Vector=turned, Scale=6.0)
    curve = surface.add("RGBCurve", Color=noise.outputs["Color"])
    bright = surface.add("BrightContrast", Color=curve.outputs[0])
    surface.ramp(noise.outputs[0], [(0.1, (0, 0, 0)), (0.9, (1, 0.5, 0))], "LINEAR")
    ramp = (
        surface.tree.nodes["Color Ramp"]
        if "Color Ramp" in surface.tree.nodes
        else (surface.tree.nodes["ColorRamp"])
    )
    ramp.name = "Ramp"
    mixed = surface.mix(bright.outputs[0], ramp.outputs[0], 0.5)
    surface.set(Base_Color=mixed, Roughness=0.6)
    surface.bump(noise.outputs[0], 0.1)
    stage.thing("Noise", surface.material)


def _attributes(stage: Stage) -> None:
    """Colours that are read by name."""
    stage.tinted("Tint", "OBJECT", "tint")["tint"] = 0.3
    stage.tinted("Path", "OBJECT", "delta_location.z")
    stage.tinted("Data", "OBJECT", "data_tint").data["data_tint"] = 0.3
    stage.tinted("DataPath", "OBJECT", "remesh_voxel_size")
    stage.tinted("Layer", "VIEW_LAYER", "layer_mood")
    stage.scene.view_layers[0]["layer_mood"] = 0.3
    stage.tinted("ScenePath", "VIEW_LAYER", "audio_volume").color = (1, 0, 0, 1)
    stage.scene.audio_volume = 0.3
    worn = stage.tinted("Worn", "GEOMETRY", "worn")
    group = worn.vertex_groups.new(name="worn")
    for index, vertex in enumerate(worn.data.vertices):
        group.add([vertex.index], WEIGHTS[index % len(WEIGHTS)], "REPLACE")
    stage.tinted("Named", "GEOMETRY", "shade")
    mesh = bpy.data.objects["Named"].data
    mesh.attributes.new("shade", "FLOAT", "POINT").data.foreach_set(
        "value", np.full(len(mesh.vertices), 0.4, np.float32)
    )
    mesh.color_attributes.new("Colours", "FLOAT_COLOR", "POINT")


def _deformed(stage: Stage) -> None:
    """Geometry that comes of modifiers, keys, bones and other types of objects."""
    grey = solid("Grey", Base_Color=(0.5, 0.5, 0.5))
    stage.thing("Plain", grey)
    stage.thing("Twin", grey).modifiers.new("Twin", "ARRAY").count = 2
    bpy.data.objects["Twin"].scale = (0.4, 0.4, 0.4)
    stage.thing("Round", grey).modifiers.new("Bevel", "BEVEL").width = 0.1
    keyed = stage.thing("Keyed", grey)
    keyed.shape_key_add(name="Basis")
    for point in keyed.shape_key_add(name="Tall").data:
        point.co.z *= 1.5
    keyed.data.shape_keys.key_blocks["Tall"].value = 0.4
    bent = stage.thing("Bent", grey, sheet(0.9, 0.9, 6, 6))
    bent.rotation_euler[0] = 0.8
    waves = bent.modifiers.new("Waves", "DISPLACE")
    waves.texture, waves.strength = bpy.data.textures.new("Clouds", "CLOUDS"), 0.4
    rig = stage.link("Rig", bpy.data.armatures.new("Rig"))
    _add_bone(rig, "Bone")
    rig.pose.bones["Bone"].location = (0.1, 0.1, 0.0)
    boned = stage.thing("Boned", grey)
    boned.vertex_groups.new(name="Bone").add(range(8), 1.0, "REPLACE")
    boned.modifiers.new("Rig", "ARMATURE").object = rig
    stage.write("Ab", 0.9, grey, stage.place(), name="Text")
    curve = bpy.data.curves.new("Curve", "CURVE")
    curve.dimensions, curve.bevel_depth = "3D", 0.1
    curve.splines.new("POLY").points.add(2)
    for number, point in enumerate(curve.splines[0].points):
        point.co = (number * 0.4 - 0.4, 0, 0.3 * (number % 2), 1)
    curve.materials.append(grey)
    stage.link("Curve", curve, stage.place())
    goal = stage.empty("Goal", stage.place())
    follower = stage.put(sphere(0.4, 12), grey, name="Follower")
    follower.constraints.new("COPY_LOCATION").target = goal
    caged = stage.thing("Caged", grey)
    cage = stage.link("Cage", bpy.data.lattices.new("Cage"), caged.location)
    caged.modifiers.new("Cage", "LATTICE").object = cage
    cage.data.points[0].co_deform = (-0.9, -0.7, -0.7)
    child = stage.thing("Child", grey)
    child.parent = stage.empty("Parent")
    stage.put(box(0.02, 0.02, 4.0), solid("Wire"), (0.1, -2, -2), name="Wire")
    stage.put(box(0.12, 0.12, 0.12), solid("Dot"), (-1.2, -2, 0.3), name="Dot")


def _add_bone(rig: Any, name: str) -> None:
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    bone = rig.data.edit_bones.new(name)
    bone.head, bone.tail = (0, 0, 0), (0, 0, 1)
    bpy.ops.object.mode_set(mode="OBJECT")


def _instanced(stage: Stage) -> None:
    """Instances of collections, of geometry nodes and of vertices."""
    surface = Surface("Crowd")
    colour = surface.add("Attribute", attribute_type="INSTANCER")
    colour.attribute_name = "hue"
    info = surface.add("ObjectInfo").outputs["Color"]
    mixed = surface.mix(colour.outputs["Fac"], info, 0.5)
    surface.set(Base_Color=mixed)
    crowd = bpy.data.collections.new("Crowd")
    small = stage.put(box(0.7, 0.7, 0.7), surface.material, name="Small")
    stage.scene.collection.objects.unlink(small)
    crowd.objects.link(small)
    copies = stage.empty("Copies", stage.place())
    copies.instance_type, copies.instance_collection = "COLLECTION", crowd
    copies["hue"] = 0.4
    nodes = stage.thing("Scattered", solid("Dust"), sheet(0.8, 0.8, 2, 2))
    nodes.rotation_euler[0] = 1.0
    nodes.modifiers.new("Scatter", "NODES").node_group = scatter(small)
    apart = bpy.data.collections.new("Apart")
    stage.scene.collection.children.link(apart)
    hidden = stage.put(box(9, 0.1, 1), solid("Back"), (0, 3, -3.8), name="Back")
    stage.scene.collection.objects.unlink(hidden)
    apart.objects.link(hidden)


def scatter(small: Any, time: bool = False) -> Any:
    """Geometry nodes that put `small` on points, with an attribute `hue` of each."""
    tree = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        kind = "NodeSocketGeometry"
        tree.interface.new_socket("Geometry", in_out=way, socket_type=kind)
    shade = tree.interface.new_socket(
        "Shade", in_out="INPUT", socket_type="NodeSocketFloat"
    )
    shade.default_value = 0.5
    add = tree.nodes.new
    start, end = add("NodeGroupInput"), add("NodeGroupOutput")
    spread, what = add("GeometryNodeInstanceOnPoints"), add("GeometryNodeObjectInfo")
    store = add("GeometryNodeStoreNamedAttribute")
    what.inputs["Object"].default_value = small
    spread.inputs["Scale"].default_value = (0.4, 0.4, 0.4)
    store.domain = "INSTANCE"
    store.inputs["Name"].default_value = "hue"
    value = start.outputs["Shade"]
    if time:
        value = add("GeometryNodeInputSceneTime").outputs["Seconds"]
    for source, target in (
        (start.outputs["Geometry"], spread.inputs["Points"]),
        (what.outputs["Geometry"], spread.inputs["Instance"]),
        (spread.outputs[0], store.inputs["Geometry"]),
        (value, next(s for s in store.inputs if s.name == "Value" and s.enabled)),
        (store.outputs[0], end.inputs[0]),
    ):
        tree.links.new(source, target)
    return tree


def _timed(stage: Stage) -> None:
    """A sequence of images, particles, and nodes that know the time."""
    for number in (1, 2, 3):
        path = stage.folder / f"frame_{number:04d}.png"
        saved(path).pixels.foreach_set(np.full(256, number / 4, np.float32))
        bpy.data.images[path.name].save()
        bpy.data.images.remove(bpy.data.images[path.name])
    image = bpy.data.images.load(str(stage.folder / "frame_0001.png"))
    image.source = "SEQUENCE"
    user = stage.pictured("Sequence", image).data.materials[0].node_tree.nodes
    user = next(node for node in user if node.type == "TEX_IMAGE").image_user
    user.frame_duration, user.use_auto_refresh = 3, True
    surface = Surface("Spark")
    age = surface.add("ParticleInfo")
    surface.set(Base_Color=surface.math("DIVIDE", age.outputs["Age"], 50.0))
    spark = stage.put(box(0.3, 0.3, 0.3), surface.material, (0, 0, -9), name="Spark")
    source = stage.thing("Source", solid("Source"))
    source.modifiers.new("Sparks", "PARTICLE_SYSTEM")
    settings = source.particle_systems[0].settings
    settings.name, settings.count, settings.frame_end = "Sparks", 12, 1
    settings.lifetime, settings.normal_factor = 60, 0.6
    settings.render_type, settings.instance_object = "OBJECT", spark
    settings.particle_size = 1.0
    _clocked(stage)
    stage.tinted("Frame", "VIEW_LAYER", "frame_current")
    stage.scene.frame_set(2)


def _clocked(stage: Stage) -> None:
    """Geometry nodes that read the time."""
    small = bpy.data.objects["Small"]
    clock = stage.thing("Clock", solid("Clock"), sheet(0.8, 0.8, 2, 2))
    clock.rotation_euler[0] = 1.0
    clock.modifiers.new("Scatter", "NODES").node_group = scatter(small, time=True)


def _seen(stage: Stage) -> None:
    """A mirror, glass and a lamp that the camera sees."""
    stage.thing("Mirror", solid("Mirror", Metallic=1.0, Roughness=0.0))
    glass = solid("Glass", Transmission_Weight=1.0, Roughness=0.0)
    stage.thing("Glass", glass, sphere(0.45, 12))
    at = (3.0, -1.0, -3.0)
    lamp = stage.lamp("AREA", 2, at, (3, -12, -3), "Bulb", size=1.0)
    lamp.visible_camera = True
