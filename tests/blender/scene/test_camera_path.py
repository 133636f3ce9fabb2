"""Cameras that swing too fast for their neighbours, read from keyframes."""

from __future__ import annotations

import math

import bpy
import pytest

from xrds_blender.scene.camera_path import whips


@pytest.fixture
def scene() -> bpy.types.Scene:
    bpy.ops.wm.read_factory_settings()
    return bpy.context.scene


def swing(camera: bpy.types.Object, *keys: tuple[int, float]) -> None:
    """Turn it about the vertical, as fast as between its keys."""
    for frame, degrees in keys:
        camera.rotation_euler.z = math.radians(degrees)
        camera.keyframe_insert("rotation_euler", frame=frame)


def test_only_the_frames_of_a_fast_swing(scene: bpy.types.Scene) -> None:
    swing(scene.camera, (1, 0), (10, 5), (11, 100), (20, 105))
    assert whips(scene, range(1, 21)) == [11]
    assert whips(scene, range(12, 21)) == []


def test_a_slow_pan_is_none(scene: bpy.types.Scene) -> None:
    swing(scene.camera, (1, 0), (48, 90))
    assert whips(scene, range(1, 49)) == []


def test_quaternions(scene: bpy.types.Scene) -> None:
    camera = scene.camera
    swing(camera, (1, 0))
    turned = camera.rotation_euler.to_quaternion()
    camera.animation_data_clear()
    camera.rotation_mode = "QUATERNION"
    for frame, angle in ((1, 0.0), (2, 2.0)):
        camera.rotation_quaternion = turned
        camera.rotation_quaternion.rotate(_about_z(angle))
        camera.keyframe_insert("rotation_quaternion", frame=frame)
    assert whips(scene, range(1, 4)) == [2]


def _about_z(angle: float) -> object:
    from mathutils import Quaternion

    return Quaternion((0.0, 0.0, 1.0), angle)


def test_what_more_moves_is_not_judged(scene: bpy.types.Scene) -> None:
    swing(scene.camera, (1, 0), (2, 100))
    scene.camera.constraints.new("TRACK_TO")
    assert whips(scene, range(1, 4)) == []
    scene.camera = None
    assert whips(scene, range(1, 4)) == []
