"""Cameras of frames: in the header of an OpenEXR file, or in a JSON file beside them.

OpenEXR's standard attributes are `worldToCamera` and `worldToNDC`, for row vectors.
The camera looks along its +Z, with X to the right and Y up; NDC is (0, 0) in the upper
left and (1, 1) in the lower right corner of the display window. (OpenEXR, Standard
Attributes.) Some renderers write a camera that looks along -Z, or NDC from -1 to 1 with
Y up: the two matrices together tell which.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import UsageError
from ..files import read_stream
from ..temporal.frame import Camera
from . import attributes

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ..temporal.frame import Matrix

VIEW, NDC = "worldToCamera", "worldToNDC"
PROJECT = "xrds/project"
"""`Camera.project` for row vectors, exact where NDC is rounded."""
SPHERE = "xrds/sphere"
"""Of an equirectangular panorama: `Camera.sphere` in words, in the place of NDC."""
_AHEAD = np.diag([1.0, 1.0, -1.0, 1.0])  # to and from a camera that looks along +Z
_SKEW = 1e-3
_SENSOR = 36.0  # mm, of a camera in JSON that names none
_MOST_BYTES = 64 << 20  # of a file of cameras: a hundred thousand frames


def to_header(camera: Camera) -> dict[str, list[list[float]] | str]:
    """Return the attributes that tell a camera."""
    view = {VIEW: (_AHEAD @ camera.view).T.tolist()}
    if camera.sphere is not None:
        angles = (*camera.sphere.longitude, *camera.sphere.latitude)
        return {**view, SPHERE: " ".join(repr(float(x)) for x in angles)}
    ndc = np.array([[0.5, 0, 0, 0.5], [0, -0.5, 0, 0.5], [0, 0, 1, 0], [0, 0, 0, 1]])
    return {
        **view,
        NDC: (ndc @ camera.project @ camera.view).T.tolist(),
        PROJECT: camera.project.T.tolist(),
    }


def from_header(told: Mapping[str, Any], size: tuple[int, int]) -> Camera | None:
    """Return the camera that a header tells; None without the attributes.

    `size` is (width, height) of the display window. Raises ValueError for what is no
    camera's.
    """
    if VIEW not in told or not {NDC, PROJECT, SPHERE} & set(told):
        return None
    view = attributes.placement(_transposed(told[VIEW]))
    if SPHERE in told:
        sphere = attributes.sphere(told[SPHERE])
        return Camera(_AHEAD @ view, np.zeros((4, 4)), size, sphere=sphere)
    if PROJECT in told:
        project = attributes.projection(_transposed(told[PROJECT]))
        return Camera(_AHEAD @ view, project, size)
    ndc = attributes.matrix(_transposed(told[NDC]))
    seen: Matrix = ndc @ np.linalg.inv(view)
    perspective = abs(seen[3, 2]) > _SKEW * abs(seen[3, 3])
    turned: Matrix = _AHEAD if not perspective or seen[3, 2] > 0 else np.eye(4)
    project = _project(seen @ turned, perspective)
    return Camera(turned @ view, attributes.projection(project.tolist()), size)


def _transposed(rows: Any) -> list[list[float]]:
    """Headers hold matrices for row vectors, cameras those for columns."""
    return attributes.matrix(rows).T.tolist()


def _project(seen: Matrix, perspective: bool) -> Matrix:
    """Return `Camera.project` from what takes an OpenGL camera's points to NDC."""
    column, scale = (2, -seen[3, 2]) if perspective else (3, seen[3, 3])
    if not scale > 0 or not seen[0, 0] or not seen[1, 1]:
        raise ValueError("the matrices are no camera's")
    seen = seen / scale
    if abs(seen[0, 1]) + abs(seen[1, 0]) > _SKEW * abs(seen[0, 0]):
        raise ValueError("the matrices turn or skew the picture")
    middle = seen[:2, column] * (-1.0 if perspective else 1.0)
    if middle.sum() > 0.5:  # NDC from 0 to 1, not from -1 to 1
        seen[:2] = 2 * seen[:2] - seen[3]
    seen[1] *= np.sign(seen[1, 1])  # Y upwards
    project = np.diag([seen[0, 0], seen[1, 1], -1.0, float(not perspective)])
    project[:2, column] = seen[:2, column]
    if perspective:
        project[2, 3] = project[3, 2] = -1.0
    return project


def to_json(camera: Camera) -> dict[str, Any]:
    """Return a camera as `read_cameras` takes it; not of a panorama."""
    return {
        "to_world": np.linalg.inv(camera.view).tolist(),
        "project": camera.project.tolist(),
        "name": camera.name,
    }


def read_cameras(path: Path) -> dict[int | None, dict[str, Any]]:
    """Read cameras by frame number from a JSON file; None is for all other frames.

    An object from frame numbers, or "all", to cameras: `to_world`, 4 rows of 4 numbers,
    takes points of a camera that looks along -Z, Y up, to the world (the columns are
    its axes and its place); `focal_length` and `sensor_width` in one unit, or
    `ortho_width` in the world's; optional `shift`, two shares of the width by which the
    frame lies to the right and up. In the place of these `project`, 4 rows of 4
    numbers, takes the camera's points to OpenGL clip space. Frames of cameras of
    another `name` lend nothing to each other. Raises UsageError.
    """
    try:
        told = json.loads(read_stream(path, _MOST_BYTES).decode("utf-8"))
        keys = {None if k == "all" else int(k): v for k, v in told.items()}
        for camera in keys.values():
            _told_camera(camera, (2, 2), 1.0)
    except KeyError as error:
        raise UsageError(f"{path}: a camera lacks {error}") from error
    except (ValueError, TypeError, AttributeError) as error:
        raise UsageError(f"{path} is no file of cameras ({error})") from error
    except RecursionError as error:
        raise UsageError(f"{path} is no file of cameras (lists in lists)") from error
    return keys


def told_camera(
    cameras: Mapping[int | None, dict[str, Any]],
    number: int,
    size: tuple[int, int],
    aspect: float = 1.0,
) -> Camera | None:
    """Return the camera of a frame as `read_cameras` has it, or None.

    `size` is (width, height) of the display window, `aspect` a pixel's width over its
    height. Raises ValueError where the two together make no camera.
    """
    told = cameras.get(number, cameras.get(None))
    return None if told is None else _told_camera(told, size, aspect)


def _told_camera(
    told: Mapping[str, Any], size: tuple[int, int], aspect: float
) -> Camera:
    view = np.linalg.inv(attributes.placement(told["to_world"]))
    name = str(told.get("name", ""))
    rows = told["project"] if "project" in told else _lens(told, size, aspect).tolist()
    return Camera(view, attributes.projection(rows), size, name=name)


def _lens(told: Mapping[str, Any], size: tuple[int, int], aspect: float) -> Matrix:
    """Return `Camera.project` of a focal length, or of an orthographic width."""
    width, height = size[0] * aspect, size[1]
    project = np.zeros((4, 4))
    shift_x, shift_y = attributes.pair(told.get("shift", [0.0, 0.0]))
    shift = np.array([2 * shift_x, 2 * shift_y * width / height])
    if "ortho_width" in told:
        across = 2.0 / attributes.positive(told["ortho_width"])
        project[2, 2], project[3, 3] = -1.0, 1.0
        project[:2, 3] = -shift
    else:
        sensor = attributes.positive(told.get("sensor_width", _SENSOR))
        across = 2.0 * attributes.positive(told["focal_length"]) / sensor
        project[2, 2], project[2, 3], project[3, 2] = -1.0, -1.0, -1.0
        project[:2, 2] = shift
    project[0, 0], project[1, 1] = across, across * width / height
    return project
