"""Shots of things that change or come and go: no motion tells where they were."""

from __future__ import annotations

import math
from typing import Any

import bpy
import numpy as np

from ..studio.geometry import Shape, box, cone, cylinder, sheet, sphere, torus
from ..studio.nodes import solid
from .stage import (
    COLD,
    CREAM,
    LEAF,
    WARM,
    Set,
    bake,
    checks,
    key,
    marble,
    over,
    room,
    slide,
    truck,
)


def boolean(stage: Set) -> None:
    """A ball that moves cuts a hollow into a box: its mesh changes every frame."""
    room(stage)
    block = stage.put(box(1.3, 0.9, 1.2), checks("block", CREAM, WARM), (0, -0.3, 0.1))
    ball = stage.put(sphere(0.45), marble("knife", COLD, CREAM), (-0.1, -0.8, 1.0))
    ball.hide_render = True
    slide(ball, (0.045, 0.0, -0.02))
    cut = block.modifiers.new("cut", "BOOLEAN")
    cut.object, cut.solver = ball, "EXACT"


def instances(stage: Set) -> None:
    """A swarm of leaves on the points of a sheet with waves that run through it."""
    room(stage)
    swarm = stage.put(
        sheet(3.0, 1.6, 15, 8), solid("points", Base_Color=CREAM), (0, -0.3, 1.0)
    )
    wave = swarm.modifiers.new("wave", "WAVE")
    wave.height, wave.width, wave.speed = 0.35, 0.7, 0.03
    wave.time_offset = -60.0
    leaf = stage.put(sphere(0.07, 12), checks("leaf", LEAF, CREAM, 25.0))
    leaf.scale = (1.0, 0.5, 1.4)
    leaf.parent = swarm
    swarm.instance_type, swarm.show_instancer_for_render = "VERTS", False
    slide(swarm, (0.02, 0.0, 0.0))


def particles(stage: Set) -> None:
    """Particles that a wall throws out, each a small checked ball."""
    room(stage)
    source = stage.put(sheet(0.8, 0.8), solid("source", Base_Color=WARM), (0, 0.2, 1.9))
    grain = stage.put(sphere(0.07, 12), checks("grain", CREAM, COLD, 25.0))
    grain.location = (0, 0, -5)
    source.modifiers.new("throw", "PARTICLE_SYSTEM")
    how = source.particle_systems[0].settings
    how.count, how.frame_start, how.frame_end, how.lifetime = 260, -60, 20, 200
    how.normal_factor, how.factor_random = 0.6, 0.5
    how.effector_weights.gravity = 0.05
    how.render_type, how.instance_object = "OBJECT", grain
    how.particle_size = 1.0
    bake(stage, source.particle_systems[0].point_cache, -60)


def vanish(stage: Set) -> None:
    """Boxes that are there in some frames alone; one leaves after the middle one."""
    room(stage)
    for number, gone in enumerate((lambda k: k > 0, lambda k: k < 0, lambda k: k % 2)):
        stuff = checks(f"comes {number}", CREAM, (COLD, WARM, LEAF)[number], 9.0)
        x = 0.9 * (number - 1)
        thing = stage.put(box(0.6, 0.6, 0.9), stuff, (x, -0.5, 0.1), 0.3 * number)
        key(thing, "hide_render", over(lambda k, g=gone: bool(g(k))), hold=True)
        slide(thing, (0.02, 0.0, 0.0))
    truck(stage, 0.02)


def swap(stage: Set) -> None:
    """A thing whose mesh is another one in every frame, by geometry nodes."""
    room(stage)
    thing = stage.put(box(0.1, 0.1, 0.1), solid("shell"), (0.0, -0.5, 0.1))
    group = bpy.data.node_groups.new("swap", "GeometryNodeTree")
    group.interface.new_socket("Out", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    _wire_swap(group, [_hidden(stage, *each) for each in _forms()])
    thing.modifiers.new("swap", "NODES").node_group = group
    slide(thing, (0.03, 0.0, 0.0))


def _forms() -> list[tuple[str, Shape, Any]]:
    return [
        ("form box", box(0.9, 0.9, 1.1), checks("form box", CREAM, WARM)),
        ("form can", cylinder(0.5, 1.2, 32), checks("form can", CREAM, COLD)),
        ("form cone", cone(0.6, 0.1, 1.3, 32), checks("form cone", CREAM, LEAF)),
        ("form ring", torus(0.45, 0.2), checks("form ring", WARM, COLD)),
    ]


def _hidden(stage: Set, name: str, shape: Shape, stuff: Any) -> bpy.types.Object:
    thing = stage.put(shape, stuff, name=name)
    thing.hide_render = True
    return thing


def _wire_swap(group: Any, things: list[bpy.types.Object]) -> None:
    """The frame's number, modulo how many there are, picks a thing."""
    new, join = group.nodes.new, group.links.new
    frame = new("GeometryNodeInputSceneTime").outputs["Frame"]
    whole, turn = new("ShaderNodeMath"), new("ShaderNodeMath")
    whole.operation, turn.operation = "FLOOR", "FLOORED_MODULO"
    turn.inputs[1].default_value = len(things)
    pick = new("GeometryNodeIndexSwitch")
    pick.data_type = "GEOMETRY"
    while len(pick.index_switch_items) < len(things):
        pick.index_switch_items.new()
    join(frame, whole.inputs[0])
    join(whole.outputs[0], turn.inputs[0])
    join(turn.outputs[0], pick.inputs[0])
    for number, thing in enumerate(things):
        info = new("GeometryNodeObjectInfo")
        info.inputs[0].default_value = thing
        join(info.outputs["Geometry"], pick.inputs[number + 1])
    join(pick.outputs[0], new("NodeGroupOutput").inputs[0])


def rigid_bodies(stage: Set) -> None:
    """Boxes that fall and tumble as keyed by a sum of their own."""
    room(stage)
    dice = np.random.default_rng(5)
    for number in range(9):
        x, spin, start = dice.uniform(-1.3, 1.3), *dice.uniform(-0.08, 0.08, 2)
        stuff = checks(f"tumbles {number}", CREAM, WARM if number % 2 else COLD, 12.0)
        thing = stage.put(box(0.3, 0.3, 0.3), stuff, (0, 0, 0))
        low = 0.35 + 0.2 * number
        falls = over(lambda k, x=x, z=low: (x, -0.6, z - 0.03 * k - 0.002 * k * k))
        key(thing, "location", falls)
        turns = over(lambda k, s=spin, t=start: (s * k + t * 9, t * k, 0.05 * k))
        key(thing, "rotation_euler", turns)


def handler(stage: Set) -> None:
    """A script at frame changes moves and paints a box; no keyframe tells of it."""
    room(stage)
    stuff = checks("scripted", CREAM, WARM, 9.0)
    thing = stage.put(box(0.9, 0.7, 1.1), stuff, (0.0, -0.4, 0.1))
    squares = next(n for n in stuff.node_tree.nodes if n.type == "TEX_CHECKER")

    def changed(scene: Any, _: Any = None) -> None:
        k = scene.frame_current - 5
        thing.location.x = 0.04 * k
        squares.inputs["Color2"].default_value[2] = 0.5 + 0.4 * math.sin(0.9 * k)

    bpy.app.handlers.frame_change_pre.append(changed)
    changed(stage.scene)
