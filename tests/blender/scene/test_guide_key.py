"""What changes a key of guides, and what does not; nothing is rendered."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from xrds_blender.scene.contents import scene_facts
from xrds_blender.scene.guide_key import NotFollowed, guide_key
from xrds_lab.studio import traps
from xrds_lab.studio.builder import Builder
from xrds_lab.studio.geometry import box
from xrds_lab.studio.nodes import Nodes, Surface

Change = Callable[[Any], None]


def key() -> str:
    """Of the scene as a render, which evaluates everything anew, would see it."""
    for item in (bpy.context.scene, *bpy.data.objects):
        item.update_tag()
    bpy.context.view_layer.update()
    graph = bpy.context.evaluated_depsgraph_get()
    return guide_key(graph, scene_facts(graph), ())


def rich_scene() -> Any:
    """A textured room with an empty, an image, a group, instances and a modifier."""
    scene = traps.trap("texture", 64, 48)
    put_empty("Anchor")
    material = bpy.data.objects["Thing"].data.materials[0]
    nodes = Nodes(material.node_tree)
    place = nodes.add("TexCoord", object=bpy.data.objects["Anchor"])
    picture = nodes.add("TexImage", image=bpy.data.images.new("image", 4, 4))
    nodes.plug(picture.inputs[0], place.outputs["Object"])
    group = bpy.data.node_groups.new("Group", "ShaderNodeTree")
    group.interface.new_socket("Out", in_out="OUTPUT", socket_type="NodeSocketColor")
    inside, end = group.nodes.new("ShaderNodeRGB"), group.nodes.new("NodeGroupOutput")
    group.links.new(inside.outputs[0], end.inputs[0])
    grouped = nodes.add("Group", node_tree=group)
    ramp = nodes.add("ValToRGB", Fac=picture.outputs["Color"])
    mixed = nodes.mix(ramp.outputs["Color"], grouped.outputs[0], 0.5)
    shader = material.node_tree.nodes["Principled BSDF"]
    nodes.plug(shader.inputs["Base Color"], mixed)
    red = bpy.data.objects["Red"]
    red.modifiers.new("Twin", "ARRAY").relative_offset_displace[0] = 0.1
    apart = bpy.data.collections.new("Apart")
    scene.collection.children.link(apart)
    apart.objects.link(bpy.data.objects["Thing"])
    crowd = bpy.data.collections.new("Crowd")
    small = Builder(scene).put(box(0.2, 0.2, 0.2), shader_of("Red"), name="Small")
    crowd.objects.link(small)
    copies = put_empty("Copies")
    copies.instance_type, copies.instance_collection = "COLLECTION", crowd
    return scene


def put_empty(name: str) -> Any:
    item = bpy.data.objects.new(name, None)
    bpy.context.scene.collection.objects.link(item)
    return item


def shader_of(name: str) -> Any:
    return bpy.data.objects[name].data.materials[0]


def node(kind: str) -> Any:
    tree = shader_of("Thing").node_tree
    return next(each for each in tree.nodes if each.bl_idname == f"ShaderNode{kind}")


def drive(scene: Any) -> None:
    curve = shader_of("Red").node_tree.nodes["Principled BSDF"].inputs["Alpha"]
    driver = curve.driver_add("default_value").driver
    driver.expression = "0.5 + frame / 1000"


def paint(scene: Any) -> None:
    bpy.data.images["image"].pixels[0] = 0.7


def push_vertex(scene: Any) -> None:
    bpy.data.objects["Floor"].data.vertices[0].co.z += 0.01


def hold_out(scene: Any) -> None:
    bpy.context.view_layer.layer_collection.children["Apart"].holdout = True


def override(scene: Any) -> None:
    bpy.context.view_layer.material_override = shader_of("Red")


def custom(scene: Any) -> None:
    bpy.data.objects["Red"]["shade"] = 0.5


def scatter(scene: Any) -> None:
    bpy.data.objects["Copies"].location.x = 1.0


def multiply(scene: Any) -> None:
    bpy.data.objects["Red"].modifiers["Twin"].count = 3


def recolour(scene: Any) -> None:
    tree = bpy.data.node_groups["Group"]
    colour = next(each for each in tree.nodes if each.type == "RGB")
    colour.outputs[0].default_value[0] = 0.9


def focus(scene: Any) -> None:
    scene.camera.data.dof.use_dof = True


def attribute(scene: Any) -> None:
    mesh = bpy.data.objects["Floor"].data
    mesh.attributes.new("worn", "FLOAT", "POINT").data[0].value = 1.0


MATTERS: dict[str, Change] = {
    "camera": lambda s: setattr(s.camera, "location", (0, -7.4, 2.6)),
    "lens": lambda s: setattr(s.camera.data, "lens", 51),
    "focus": focus,
    "object": lambda s: setattr(bpy.data.objects["Red"], "location", (1, 1, 0)),
    "vertex": push_vertex,
    "modifier": multiply,
    "attribute": attribute,
    "instances": scatter,
    "hidden in render": lambda s: setattr(bpy.data.objects["Red"], "hide_render", True),
    "hidden from camera": lambda s: setattr(
        bpy.data.objects["Red"], "visible_camera", False
    ),
    "object colour": lambda s: setattr(bpy.data.objects["Red"], "color", (1, 0, 0, 1)),
    "custom property": custom,
    "pass index": lambda s: setattr(bpy.data.objects["Red"], "pass_index", 3),
    "material": lambda s: setattr(
        shader_of("Red").node_tree.nodes["Principled BSDF"].inputs["Roughness"],
        "default_value",
        0.6,
    ),
    "other material": lambda s: setattr(
        bpy.data.objects["Red"].material_slots[0], "material", shader_of("Thing")
    ),
    "driver": drive,
    "node muted": lambda s: setattr(node("TexImage"), "mute", True),
    "node setting": lambda s: setattr(node("TexImage"), "interpolation", "Closest"),
    "texture mapping": lambda s: setattr(
        node("TexImage").texture_mapping, "scale", (2, 1, 1)
    ),
    "ramp": lambda s: setattr(
        node("ValToRGB").color_ramp.elements[0], "position", 0.25
    ),
    "group": recolour,
    "painted": paint,
    "texture's empty": lambda s: setattr(
        bpy.data.objects["Anchor"], "location", (0, 0, 1)
    ),
    "world": lambda s: setattr(
        s.world.node_tree.nodes["Background"].inputs["Strength"], "default_value", 2.0
    ),
    "film": lambda s: setattr(s.render, "film_transparent", True),
    "filter": lambda s: setattr(s.cycles, "filter_width", 3.0),
    "alpha bounces": lambda s: setattr(s.cycles, "transparent_max_bounces", 2),
    "holdout": hold_out,
    "override": override,
}
DOES_NOT: dict[str, Change] = {
    "lamp energy": lambda s: setattr(bpy.data.objects["Lamp"].data, "energy", 7),
    "lamp place": lambda s: setattr(bpy.data.objects["Lamp"], "location", (3, 0, 5)),
    "samples": lambda s: setattr(s.cycles, "samples", 99),
    "seed": lambda s: setattr(s.cycles, "seed", 5),
    "bounces": lambda s: setattr(s.cycles, "diffuse_bounces", 9),
    "denoiser": lambda s: setattr(s.cycles, "use_denoising", False),
    "output": lambda s: setattr(s.render, "filepath", "/tmp/other"),
    "view": lambda s: setattr(s.view_settings, "exposure", 1.0),
    "selection": lambda s: bpy.data.objects["Red"].select_set(True),
    "node position": lambda s: setattr(node("TexImage"), "location", (9, 9)),
    "frame": lambda s: s.frame_set(7),
}


@pytest.mark.parametrize("change", MATTERS)
def test_what_guides_depend_on_changes_the_key(change: str) -> None:
    scene = rich_scene()
    before = key()
    assert key() == before
    MATTERS[change](scene)
    assert key() != before


def test_light_and_settings_leave_the_key() -> None:
    scene = rich_scene()
    before = key()
    for name, change in DOES_NOT.items():
        change(scene)
        assert key() == before, name


def test_a_file_opened_again_has_the_same_key(tmp_path: Path) -> None:
    rich_scene()
    path = str(tmp_path / "scene.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    before = key()
    bpy.ops.wm.open_mainfile(filepath=path)
    assert key() == before


def test_mirrors_make_lamps_and_worlds_count() -> None:
    """Where they can be seen, and only there."""
    for name, counts in (("texture", False), ("mirror", True), ("seen_lamp", True)):
        traps.trap(name, 64, 48)
        before = key()
        bpy.data.objects["Lamp"].data.energy = 7
        assert (key() != before) == counts, name
    for name, counts in (("texture", False), ("mirror", True), ("fog", True)):
        scene = traps.trap(name, 64, 48)
        scene.render.film_transparent = True
        before = key()
        background = scene.world.node_tree.nodes["Background"]
        background.inputs["Strength"].default_value = 2.0
        assert (key() != before) == counts, name


def test_animation_shows_in_the_key_of_its_frame() -> None:
    """A driver, a shader's own time and nodes that move geometry."""
    scene = rich_scene()
    drive(scene)
    assert at(scene, 1) != at(scene, 2)
    scene = rich_scene()
    assert at(scene, 1) == at(scene, 2)
    move_by_nodes(bpy.data.objects["Red"])
    assert at(scene, 1) != at(scene, 2)


def at(scene: Any, frame: int) -> str:
    scene.frame_set(frame)
    return key()


def move_by_nodes(item: Any) -> None:
    tree = bpy.data.node_groups.new("Move", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket(
            "Geometry", in_out=way, socket_type="NodeSocketGeometry"
        )
    kinds = ("NodeGroupInput", "GeometryNodeTransform", "NodeGroupOutput")
    start, moved, end = (tree.nodes.new(kind) for kind in kinds)
    time = tree.nodes.new("GeometryNodeInputSceneTime")
    tree.links.new(start.outputs[0], moved.inputs[0])
    tree.links.new(time.outputs["Frame"], moved.inputs["Translation"])
    tree.links.new(moved.outputs[0], end.inputs[0])
    item.modifiers.new("Move", "NODES").node_group = tree


def test_nodes_that_know_the_time_are_motion() -> None:
    traps.trap("plain", 64, 48)
    move_by_nodes(bpy.data.objects["Red"])
    graph = bpy.context.evaluated_depsgraph_get()
    assert "Move" in scene_facts(graph).moving


def test_an_image_file_that_changes_is_another(tmp_path: Path) -> None:
    rich_scene()
    image = bpy.data.images["image"]
    path = tmp_path / "image.png"
    image.filepath_raw, image.file_format = str(path), "PNG"
    image.save()
    node("TexImage").image = bpy.data.images.load(str(path))
    before = key()
    image.pixels.foreach_set(np.ones(64, np.float32))
    image.save()
    assert key() != before


@pytest.mark.parametrize("what", ["motion blur", "hair", "shadow catcher", "unknown"])
def test_what_cannot_be_followed_is_said(what: str) -> None:
    scene = rich_scene()
    red = bpy.data.objects["Red"]
    if what == "motion blur":
        scene.render.use_motion_blur = True
        red.keyframe_insert("location", frame=1)
    elif what == "hair":
        red.modifiers.new("Hair", "PARTICLE_SYSTEM")
        red.particle_systems[0].settings.type = "HAIR"
    elif what == "shadow catcher":
        red.is_shadow_catcher = True
    else:
        surface = Surface("portal")
        surface.replace(Surface=surface.add("BsdfRayPortal").outputs[0])
        red.data.materials[0] = surface.material
    with pytest.raises(NotFollowed, match=r"(?i)motion|hair|catcher|PORTAL"):
        key()


def test_every_kind_of_thing_can_be_looked_at() -> None:
    """Of any node, modifier and object all properties are read, and none crashes."""
    scene = rich_scene()
    every_object(scene)
    every_modifier(bpy.data.objects["Red"])
    for kind, tree in (
        ("ShaderNode", shader_of("Thing").node_tree),
        ("GeometryNode", bpy.data.node_groups.new("All", "GeometryNodeTree")),
        ("FunctionNode", bpy.data.node_groups["All"]),
    ):
        added = every_node(kind, tree)
        assert len(added) > 15, kind
    item = bpy.data.objects["Floor"]
    item.modifiers.new("All", "NODES").node_group = bpy.data.node_groups["All"]
    graph = bpy.context.evaluated_depsgraph_get()
    facts = replace(scene_facts(graph), unknown_nodes=(), shadow_catchers=False)
    first, second = (guide_key(graph, facts, ()) for _ in range(2))
    assert first == second


def every_object(scene: Any) -> None:
    """One of each type of data that an object can be made of."""
    makers = {
        "armatures": (),
        "cameras": (),
        "lattices": (),
        "metaballs": (),
        "speakers": (),
        "hair_curves": (),
        "pointclouds": (),
        "volumes": (),
        "grease_pencils_v3": (),
        "lights": ("SUN",),
        "lightprobes": ("SPHERE",),
    }
    for name, more in makers.items():
        if hasattr(bpy.data, name):
            data = getattr(bpy.data, name).new(name, *more)
            scene.collection.objects.link(bpy.data.objects.new(name, data))
    for kind in ("CURVE", "SURFACE", "FONT"):
        item = bpy.data.objects.new(kind, bpy.data.curves.new(kind, kind))
        scene.collection.objects.link(item)
    for kind in kinds(bpy.types.Texture):
        displace = bpy.data.objects["Floor"].modifiers.new(kind, "DISPLACE")
        displace.texture = bpy.data.textures.new(kind, kind)


def kinds(struct: Any) -> list[str]:
    return [each.identifier for each in struct.bl_rna.properties["type"].enum_items]


def every_modifier(item: Any) -> None:
    for kind in kinds(bpy.types.Modifier):
        # hair is not followed, and those of grease pencil are of no mesh
        if kind != "PARTICLE_SYSTEM" and "GREASE" not in kind:
            item.modifiers.new(kind, kind)


def every_node(kind: str, tree: Any) -> list[str]:
    """Those nodes that such a tree takes, but Ray Portals and scripts."""
    added = []
    for name in dir(bpy.types):
        if name.startswith(kind) and name not in ("ShaderNodeScript",):
            try:
                tree.nodes.new(name)
            except RuntimeError:  # of another tree, or no node
                continue
            added.append(name)
    return added
