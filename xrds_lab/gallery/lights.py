"""Shots whose light changes: nothing that is hit tells of it."""

from __future__ import annotations

import math

import bpy
import numpy as np

from ..studio.geometry import box, joined, sheet
from ..studio.nodes import solid
from .stage import CREAM, KEYED, MIDDLE, Set, checks, glow, key, over, room, slide

# What a worn tube does, by frame from the middle one on; noise without a pattern.
_FLICKER = (1.0, 0.2, 0.7, 1.2, 0.1, 0.9, 0.4, 1.3, 0.6, 0.05, 1.1, 0.8, 0.3)


def moving_lamp(stage: Set) -> None:
    """The lamp moves: shadows move and shading changes."""
    lamp = room(stage)
    lamp.data.size, lamp.data.energy = 0.4, 220
    lamp.location = (1.2, -1.2, 3.4)
    slide(lamp, (-0.09, 0.0, 0.0))


def flash(stage: Set) -> None:
    """A second lamp flashes in the middle frame alone."""
    room(stage)
    flash = stage.lamp("POINT", 0.0, (-2.6, -1.2, 1.8), (0, 0, 1), shadow_soft_size=0.2)
    key(flash.data, "energy", over(lambda k: 350.0 * (k == 0)), hold=True)


def dimming(stage: Set) -> None:
    """The lamp dims by a tenth in each frame."""
    lamp = room(stage)
    watts = lamp.data.energy
    key(lamp.data, "energy", over(lambda k: watts * 0.9**k))


def flickering_tube(stage: Set) -> None:
    """A tube of light that flickers, seen and lighting the room."""
    lamp = room(stage)
    lamp.data.energy = 150
    stuff = glow("tube", (1.0, 0.75, 0.5), 12.0)
    stage.put(box(1.8, 0.08, 0.08), stuff, (0.0, 1.2, 2.1))
    strength = stuff.node_tree.nodes["Emission"].inputs["Strength"]
    wanted = over(lambda k: 25.0 * _FLICKER[(k + 4) % len(_FLICKER)])
    key(strength, "default_value", wanted, hold=True)


def turning_sun(stage: Set) -> None:
    """The sun turns: sharp shadows of a grille wander over floor and wall."""
    lamp = room(stage)
    lamp.data.energy = 60
    bars = joined(box(0.08, 0.08, 2.2).moved((0.35 * i - 1.7, 0, 0)) for i in range(9))
    stage.put(bars, solid("bars", Base_Color=CREAM), (0.0, 0.4, 0.0))
    sun = stage.lamp("SUN", 4.0, (2, -4, 5), (0, 0, 0), angle=0.01)
    tilt = tuple(sun.rotation_euler)
    turned = over(lambda k: (tilt[0], tilt[1], tilt[2] + 0.015 * k))
    key(sun, "rotation_euler", turned)


def turning_sky(stage: Set) -> None:
    """A sky with bright spots, a picture of 32-bit floats, turns about the things."""
    _outdoors(stage)
    nodes = stage.world()
    place = nodes.add("TexCoord").outputs["Generated"]
    way = nodes.add("Mapping", Vector=place)
    sky = nodes.add("TexEnvironment", image=_sky(), Vector=way.outputs[0])
    nodes.light(sky.outputs["Color"], 0.8)
    turned = over(lambda k: (0.0, 0.0, 0.02 * k))
    key(way.inputs["Rotation"], "default_value", turned)


def _outdoors(stage: Set) -> None:
    """The room's things on a floor without walls, and no lamp."""
    lamp = room(stage)
    lamp.hide_render = True
    for name in ("wall", "rear", "side"):
        stage.scene.objects[name].hide_render = True


def _sky(width: int = 512, height: int = 256) -> bpy.types.Image:
    """A gradient with clouds and a few bright spots."""
    x, y = np.meshgrid(np.arange(width) / width, np.arange(height) / height)
    high = np.clip((y - 0.5) * 2, 0, 1)[..., None]
    pixels = (1 - high) * (0.75, 0.7, 0.65) + high * (0.2, 0.4, 0.85)
    waves = np.sin(88 * x + 6 * np.sin(9 * y)) * np.sin(90 * y + 3 * np.sin(50 * x))
    pixels = pixels * (1 + 0.35 * np.where(y > 0.5, waves, 0))[..., None]
    pixels[y < 0.5] = (0.25, 0.22, 0.18)
    for u, v, size, power in ((0.3, 0.72, 0.02, 150), (0.85, 0.63, 0.04, 25)):
        near = np.exp(-(((x - u) / size) ** 2 + ((y - v) / (2 * size)) ** 2))
        pixels += power * near[..., None] * (1.0, 0.9, 0.75)
    image = bpy.data.images.new("sky", width, height, float_buffer=True)
    full = np.concatenate([pixels, np.ones((height, width, 1))], -1)
    image.pixels.foreach_set(full.astype(np.float32).ravel())
    image.pack()
    return image


def bright_panel(stage: Set) -> None:
    """A panel that shines moves before the things and lights them."""
    lamp = room(stage)
    lamp.data.energy = 20
    stuff = glow("panel", (0.15, 0.4, 0.9), 10.0)
    panel = stage.put(sheet(1.0, 0.6), stuff, (0.0, 0.9, 1.5))
    panel.rotation_euler[0] = math.radians(70)
    slide(panel, (0.05, 0.0, 0.0))


def blinking_lights(stage: Set) -> None:
    """Small lights that go on and off one after the other."""
    room(stage).data.energy = 250
    for number in range(14):
        colour = ((1, 0.2, 0.1), (0.2, 1, 0.3), (0.2, 0.4, 1))[number % 3]
        stuff = glow(f"light {number}", colour, 0.0)
        stage.put(box(0.06, 0.06, 0.06), stuff, (0.3 * number - 2.0, 0.4, 1.5))
        strength = stuff.node_tree.nodes["Emission"].inputs["Strength"]
        shines = {f: 25.0 * ((f - MIDDLE + number) % 3 == 0) for f in KEYED}
        key(strength, "default_value", shines, hold=True)
    stuff = checks("shelf", CREAM, (0.2, 0.2, 0.2), 8.0)
    stage.put(box(4.4, 0.3, 0.05), stuff, (-0.05, 0.5, 1.4))
