"""The evaluated camera as matrices, for finding a pixel in another frame."""

from __future__ import annotations

from typing import Any

import numpy as np

from xrds_core.temporal.frame import Camera

from .size import border_start, frame_size, picture_size


def camera_of(depsgraph: Any, render: Any) -> Camera | None:
    """The camera of a render; None for one that no matrix describes, as a panorama.

    `render` is the pipeline's own copy of the render settings.
    """
    camera = depsgraph.scene_eval.camera
    if camera is None or camera.data.type not in {"PERSP", "ORTHO"}:
        return None
    width, height = frame_size(render)
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
        view=np.array(camera.matrix_world.normalized().inverted()),
        project=np.array(project),
        size=(width, height),
        window=window,
    )
