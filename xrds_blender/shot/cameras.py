"""The cameras of a shot, without its samples."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from xrds_core.errors import SceneError
from xrds_core.temporal.frame import Camera

from ..cycles.view import cameras_of
from ..frame.rendering import call_engine


def shot_cameras(scene: Any, frames: Iterable[int]) -> dict[int, Camera]:
    """The cameras of some frames of a scene, of stereo the first view's.

    Nothing is rendered; the scene stays at the last frame. Raises SceneError under a
    camera that no matrix describes.
    """
    cameras = {}
    for number in frames:
        scene.frame_set(number)
        views = call_engine(scene, cameras_of)
        camera = next(iter(views.values()), None)
        if camera is None or camera.sphere is not None:
            raise SceneError(f"no matrix describes the panoramic camera of {number}")
        cameras[number] = camera
    return cameras
