"""Sizes of frames as Blender rounds them, and the evaluated camera as matrices."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from xrds_core.accumulation.camera import Camera, Sphere

from ..internals.borrowed import Borrowed
from ..planning.settings import low_size


def cameras_of(engine: Any, depsgraph: Any) -> dict[str, Camera]:
    """The cameras of a render by view; without stereo there is one view.

    Empty under a camera whose frames cannot be reprojected: see `can_track`.
    """
    camera = depsgraph.scene_eval.camera
    if camera is None or not can_track(depsgraph.scene_eval):
        return {}
    # The method of this name hides the property, so it is asked for by path.
    render = engine.path_resolve("render")
    views = [view.name for view in engine.get_result().views] or [""]
    if len(views) == 1:
        return {views[0]: _camera(depsgraph, render, camera.matrix_world)}
    cameras = {}
    for view in views:
        engine.active_view_set(view)
        with Borrowed() as borrowed:
            borrowed.set(camera.data, shift_x=engine.camera_shift_x(camera))
            place = engine.camera_model_matrix(camera)
            cameras[view] = _camera(depsgraph, render, place)
    return cameras


def can_track(scene: Any) -> bool:
    """Whether it is known where the scene's cameras show a place.

    Of panoramas only of equirectangular ones, without stereo: that moves the camera
    from pixel to pixel. Cameras that markers bind count, too.
    """
    bound = [m.camera for m in scene.timeline_markers if m.camera]
    cameras = [camera.data for camera in (scene.camera, *bound)]
    return all(_is_tracked(data, scene.render.use_multiview) for data in cameras)


def _is_tracked(data: Any, stereo: bool) -> bool:
    if data.type == "PANO":
        return not stereo and _panorama(data).panorama_type == "EQUIRECTANGULAR"
    return data.type in {"PERSP", "ORTHO"}


def _panorama(data: Any) -> Any:
    """What holds a camera's panorama settings, before Blender 5.0 and from then on."""
    return data if hasattr(data, "panorama_type") else data.cycles


def _sphere(data: Any) -> Sphere | None:
    if data.type != "PANO":
        return None
    held = _panorama(data)
    return Sphere(
        (held.longitude_min, held.longitude_max), (held.latitude_min, held.latitude_max)
    )


def _camera(depsgraph: Any, render: Any, place: Any) -> Camera:
    camera = depsgraph.scene_eval.camera
    width, height = frame_size(render)
    project = np.zeros((4, 4))
    if camera.data.type != "PANO":
        project = camera.calc_matrix_camera(
            depsgraph,
            x=width,
            y=height,
            scale_x=render.pixel_aspect_x,
            scale_y=render.pixel_aspect_y,
        )
    window = (0, 0)
    if render.use_border:
        left, bottom = border_start(render)
        window = left, height - bottom - picture_size(render)[1]
    return Camera(
        # of Blender 5.2's matrices NumPy would make float32, too coarse to compute with
        view=np.array(place.normalized().inverted(), np.float64),
        project=np.array(project, np.float64),
        size=(width, height),
        window=window,
        name=camera.name_full,
        sphere=_sphere(camera.data),
    )


def low_view(camera: Camera, scale: int, window: tuple[int, int]) -> Camera:
    """The camera of pixels `scale` times as large.

    Its frame covers whole pixels and keeps the top left corner, which
    `low_camera.widen` does for Blender's camera; that of a panorama, which cannot be
    widened, stays. `window` is the (x, y) of the arrays' top-left pixel in it.
    """
    width, height = camera.size
    size = low_size(width, height, scale)
    across, down = width / (scale * size[0]), height / (scale * size[1])
    wider = np.diag([across, down, 1.0, 1.0])
    wider[0, 3], wider[1, 3] = across - 1.0, 1.0 - down
    return replace(camera, project=wider @ camera.project, size=size, window=window)


def frame_size(render: Any) -> tuple[int, int]:
    """Width and height of the whole frame.

    Blender multiplies and divides integers (BKE_render_resolution): 720 rows at 70 %
    are 504, where 720 * 0.7 would be 503.
    """
    percentage = render.resolution_percentage
    return (
        render.resolution_x * percentage // 100,
        render.resolution_y * percentage // 100,
    )


def border_start(render: Any) -> tuple[int, int]:
    """Left column and bottom row of the border, counted from the lower left."""
    width, height = frame_size(render)
    return _pixel(render.border_min_x, width), _pixel(render.border_min_y, height)


def picture_size(render: Any) -> tuple[int, int]:
    """Width and height of what is rendered: of the border, where there is one."""
    width, height = frame_size(render)
    if not render.use_border:
        return width, height
    left, bottom = border_start(render)
    right = _pixel(render.border_max_x, width)
    return right - left, _pixel(render.border_max_y, height) - bottom


def _pixel(edge: float, side: int) -> int:
    """Blender multiplies in single precision, and cuts off."""
    import numpy as np

    return int(np.float32(edge) * np.float32(side))
