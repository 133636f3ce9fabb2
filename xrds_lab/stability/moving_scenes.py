"""Small shots that are hard on accumulation: frames that show other light or things.

Each function fills an empty scene and animates frames 0 to 10; frames 5 and 6 are those
that are judged. They need Blender.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import bpy

from ..studio.builder import Builder, aim, empty_scene
from ..studio.geometry import box, joined, sheet, sphere
from ..studio.nodes import Surface, air, solid
from .stiff_scenes import LENS, checker, still

FRAMES = range(1, 10)
JUDGED = (5, 6)
_KEYED = range(11)
SIZE = (96, 72)  # pixels


def key(owner: Any, path: str, values: Mapping[int, Any]) -> None:
    """Keyframe an attribute, the last of a path, by frame."""
    name = path.rpartition(".")[2]
    for frame, value in values.items():
        setattr(owner, name, value)
        owner.keyframe_insert(path, frame=frame)


def truck(stage: Builder, step: float = 0.1) -> None:
    """Move the camera sideways, about two pixels a frame."""
    camera = stage.scene.camera
    x, y, z = camera.location
    key(camera, "location", {f: (x + step * (f - 5), y, z) for f in _KEYED})


def _look(stage: Builder, frame: int, eye: Any, target: Any) -> None:
    camera = stage.scene.camera
    aim(camera, eye, target)
    camera.keyframe_insert("location", frame=frame)
    camera.keyframe_insert("rotation_euler", frame=frame)


def cut(stage: Builder) -> None:
    """Another set, 100 m away, from frame 6 on; its floor lies at the same height."""
    still(stage)
    blue = solid("blue", Base_Color=(0.1, 0.2, 0.7))
    stage.put(sheet(30, 30), checker(0.7, (0.2, 0.6, 0.3)), (100, 0, 0))
    stage.put(box(1.5, 1.0, 1.0), blue, (99.6, 0.5, 0))
    stage.put(sphere(0.5), checker(0.2), (101, -0.6, 0.5))
    stage.lamp("AREA", 400, (98, -3, 4), (100, 0, 0), size=0.5)
    for frame in _KEYED:
        x = 0 if frame < 6 else 100
        _look(stage, frame, (x, -5, 2), (x, 0, 0.5))


def other_angle(stage: Builder) -> None:
    """A cut to another view of the same things: what both show may be lent."""
    still(stage)
    for frame in _KEYED:
        eye = (0, -5, 2) if frame < 6 else (3.5, -3, 1.2)
        _look(stage, frame, eye, (0, 0, 0.5))


def closer(stage: Builder) -> None:
    """A cut to another lens."""
    still(stage)
    lens = stage.scene.camera.data
    key(lens, "lens", {f: LENS if f < 6 else 1.3 * LENS for f in _KEYED})


def lights_out(stage: Builder) -> None:
    """All lamps go out at frame 6; nothing moves."""
    still(stage)
    lamp = next(x for x in stage.scene.objects if x.type == "LIGHT")
    watts = lamp.data.energy
    key(lamp.data, "energy", {f: watts if f < 6 else 0.0 for f in _KEYED})


def teleport(stage: Builder) -> None:
    """The ball is somewhere else from frame 6 on."""
    still(stage)
    ball = stage.scene.objects["red"]
    x, y, z = ball.location
    key(ball, "location", {f: (x, y, z) if f < 6 else (1.6, -1, z) for f in _KEYED})


def passing(stage: Builder) -> None:
    """A ball passes quickly, eight pixels a frame."""
    still(stage)
    ball = stage.scene.objects["red"]
    key(ball, "location", {f: (0.45 * (f - 5) - 0.2, -1.2, 0.6) for f in _KEYED})


def flickering(stage: Builder) -> None:
    """The lamp flickers by up to a half."""
    still(stage)
    lamp = next(x for x in stage.scene.objects if x.type == "LIGHT")
    watts = lamp.data.energy
    values = {f: watts * (1 + 0.5 * math.sin(2.1 * f)) for f in _KEYED}
    key(lamp.data, "energy", values)


def strobe(stage: Builder) -> None:
    """The lamp shines in every second frame."""
    still(stage)
    lamp = next(x for x in stage.scene.objects if x.type == "LIGHT")
    watts = lamp.data.energy
    key(lamp.data, "energy", {f: watts * (f % 2) for f in _KEYED})


def blinds(stage: Builder) -> None:
    """The sun wanders behind blinds: stripes of light move over the floor."""
    still(stage)
    slats = [box(6, 0.02, 0.12).moved((0, 0, 0.22 * i)) for i in range(18)]
    stage.put(joined(slats), solid("slats", Base_Color=(0.6, 0.6, 0.6)), (0, 3, 0.4))
    sun = stage.lamp("SUN", 12, (0, 5, 4), (0, 0, 0), angle=0.01)
    turn = tuple(sun.rotation_euler)
    values = {f: (turn[0] + 0.012 * (f - 5), *turn[1:]) for f in _KEYED}
    key(sun, "rotation_euler", values)


def mirror(stage: Builder) -> None:
    """A mirror and a ball of chrome under a moving camera."""
    still(stage)
    chrome = solid("chrome", Base_Color=(0.9, 0.9, 0.9), Metallic=1.0, Roughness=0.0)
    stage.put(box(3.0, 0.1, 2.2), chrome, (0, 2.0, 0))
    stage.put(sphere(0.6), chrome, (0.1, -1.2, 0.6))
    truck(stage)


def glass_ball(stage: Builder) -> None:
    """A ball of glass before a checked floor, under a moving camera."""
    still(stage)
    glass = solid("glass", Transmission_Weight=1.0, Roughness=0.0, IOR=1.5)
    stage.put(sphere(0.8), glass, (0, -1.4, 0.8))
    truck(stage)


def water(stage: Builder) -> None:
    """Waves that run over clear water on a checked ground."""
    still(stage)
    surface = Surface("water", Transmission_Weight=1.0, Roughness=0.02, IOR=1.33)
    place = surface.add("NewGeometry").outputs["Position"]
    shifted = surface.add("VectorMath", Vector=place)
    waves = surface.add("TexNoise", Vector=shifted.outputs[0], Scale=3.0)
    surface.bump(waves.outputs[0], 0.3)
    stage.put(sheet(30, 30), surface.material, (0, 0, 0.3))
    offset = shifted.inputs[1]
    for frame in _KEYED:
        offset.default_value = (0.12 * frame, 0.07 * frame, 0.1 * frame)
        offset.keyframe_insert("default_value", frame=frame)


def fire(stage: Builder) -> None:
    """A cloud that glows and boils before the things."""
    still(stage)
    nodes = Surface("fire")
    place = nodes.add("NewGeometry").outputs["Position"]
    boil = nodes.add("TexNoise", noise_dimensions="4D", Vector=place, Scale=3.0)
    dense = nodes.span(nodes.math("GREATER_THAN", boil.outputs[0], 0.52), 0.0, 3.0)
    glow = nodes.add("Emission", Color=(1.0, 0.35, 0.05), Strength=dense)
    nodes.replace(Volume=glow.outputs[0])
    stage.put(box(1.2, 0.8, 1.8), nodes.material, (0, -1.2, 0))
    time = boil.inputs["W"]
    for frame in _KEYED:
        time.default_value = 0.25 * frame
        time.keyframe_insert("default_value", frame=frame)


def fog(stage: Builder) -> None:
    """A spot light's cone in scattering air, under a moving camera."""
    still(stage)
    stage.put(box(8, 8, 4), air("air", 0.15), (0, 0, -0.1))
    stage.lamp("SPOT", 4000, (-2, 1, 3.4), (0.5, -0.5, 0), spot_size=0.6)
    truck(stage)


def alpha_cards(stage: Builder) -> None:
    """Leaves cut out of cards by their alpha, which sway before the things."""
    still(stage)
    leaf = Surface("leaf", Base_Color=(0.15, 0.5, 0.1), Roughness=0.8)
    place = leaf.add("TexCoord").outputs["Object"]
    holes = leaf.add("TexNoise", Vector=place, Scale=9.0)
    leaf.set(Alpha=leaf.math("GREATER_THAN", holes.outputs[0], 0.5))
    for number, x in enumerate((-1.0, 0.2, 1.2)):
        card = stage.put(box(1.0, 0.001, 1.6), leaf.material, (x, -1.8, 0.1))
        swing = {f: (0.0, 0.03 * (f - 5) * (-1) ** number, 0.0) for f in _KEYED}
        key(card, "rotation_euler", swing)
    truck(stage, 0.05)


def motion_blur(stage: Builder) -> None:
    """Things and the camera move with their shutters open."""
    passing(stage)
    truck(stage)
    stage.scene.render.use_motion_blur = True


def resolution(stage: Builder) -> None:
    """The frames grow from frame 6 on."""
    still(stage)
    truck(stage)


def zoom(stage: Builder) -> None:
    """The lens changes from frame to frame."""
    still(stage)
    lens = stage.scene.camera.data
    key(lens, "lens", {f: LENS * 1.03 ** (f - 5) for f in _KEYED})


def orthographic(stage: Builder) -> None:
    """An orthographic camera that moves."""
    still(stage)
    lens = stage.scene.camera.data
    lens.type, lens.ortho_scale = "ORTHO", 4.5
    truck(stage)


def panorama(stage: Builder) -> None:
    """An equirectangular camera that moves."""
    fisheye(stage)
    lens = stage.scene.camera.data
    held = lens if hasattr(lens, "panorama_type") else lens.cycles  # before Blender 5
    held.panorama_type = "EQUIRECTANGULAR"


def fisheye(stage: Builder) -> None:
    """A fisheye that moves: its frames can lend nothing."""
    still(stage)
    stage.scene.camera.data.type = "PANO"
    truck(stage)


SHOTS: dict[str, Callable[[Builder], None]] = {
    "cut": cut,
    "other_angle": other_angle,
    "closer": closer,
    "lights_out": lights_out,
    "teleport": teleport,
    "passing": passing,
    "flickering": flickering,
    "strobe": strobe,
    "blinds": blinds,
    "mirror": mirror,
    "glass_ball": glass_ball,
    "water": water,
    "fire": fire,
    "fog": fog,
    "alpha_cards": alpha_cards,
    "motion_blur": motion_blur,
    "resolution": resolution,
    "zoom": zoom,
    "orthographic": orthographic,
    "panorama": panorama,
}


def build(name: str) -> bpy.types.Scene:
    """Open an empty file, build a shot in it and return its scene."""
    from xrds_blender.interface.registration import ensure_registered

    scene = empty_scene(*SIZE)
    ensure_registered()
    (SHOTS | {"fisheye": fisheye})[name](Builder(scene))
    return scene


def set_frame(scene: Any, name: str, frame: int) -> None:
    """Go to a frame; those of `resolution` grow."""
    scene.frame_set(frame)
    if name == "resolution":
        grown = 1.25 if frame >= JUDGED[-1] else 1.0
        width, height = (round(n * grown) for n in SIZE)
        scene.render.resolution_x, scene.render.resolution_y = width, height
