"""Cameras of frames: in the header of an OpenEXR file, or in a JSON file beside them.

OpenEXR's standard attributes are `worldToCamera` and `worldToNDC`, for row vectors.
The camera looks along its +Z, with X to the right and Y up; NDC is (0, 0) in the upper
left and (1, 1) in the lower right corner of the display window. (OpenEXR, Standard
Attributes.) Some renderers write a camera that looks along -Z, or NDC from -1 to 1 with
Y up: the two matrices together show which.
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
"""Of an equirectangular panorama: `Camera.sphere` as text, instead of NDC."""
_AHEAD = np.diag([1.0, 1.0, -1.0, 1.0])  # to and from a camera that looks along +Z
_SKEW = 1e-3
_SENSOR = 36.0  # mm, of a camera in JSON that names none
_MOST_BYTES = 64 << 20  # of a file of cameras: a hundred thousand frames


def to_header(camera: Camera) -> dict[str, list[list[float]] | str]:
    """Return the attributes that describe a camera."""
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


def has_camera(header: Mapping[str, Any]) -> bool:
    """Whether a header says anything of a camera."""
    return VIEW in header and bool({NDC, PROJECT, SPHERE} & set(header))


def from_header(header: Mapping[str, Any], size: tuple[int, int]) -> Camera | None:
    """Return the camera that a header describes; None without the attributes.

    `size` is (width, height) of the display window. Raises ValueError for values that
    describe no camera.
    """
    if not has_camera(header):
        return None
    view = attributes.placement(_transposed(header[VIEW]))
    if SPHERE in header:
        sphere = attributes.sphere(header[SPHERE])
        return Camera(_AHEAD @ view, np.zeros((4, 4)), size, sphere=sphere)
    if PROJECT in header:
        project = attributes.projection(_transposed(header[PROJECT]))
        return Camera(_AHEAD @ view, project, size)
    ndc = attributes.matrix(_transposed(header[NDC]))
    seen: Matrix = ndc @ np.linalg.inv(view)
    perspective = abs(seen[3, 2]) > _SKEW * abs(seen[3, 3])
    turned: Matrix = _AHEAD if not perspective or seen[3, 2] > 0 else np.eye(4)
    project = _project(seen @ turned, perspective)
    return Camera(turned @ view, attributes.projection(project.tolist()), size)


def _transposed(rows: Any) -> list[list[float]]:
    """Headers hold matrices for row vectors, cameras those for columns."""
    return attributes.matrix(rows).T.tolist()


def _project(seen: Matrix, perspective: bool) -> Matrix:
    """Return `Camera.project` from the transform from OpenGL camera space to NDC."""
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
    """Return a camera as `read_cameras` reads it; not of a panorama."""
    return {
        "to_world": np.linalg.inv(camera.view).tolist(),
        "project": camera.project.tolist(),
        "name": camera.name,
    }


def read_cameras(path: Path) -> dict[int | None, dict[str, Any]]:
    """Read cameras by frame number from a JSON file; None is for all other frames.

    An object from frame numbers, or "all", to cameras: `to_world`, 4 rows of 4 numbers,
    is the transform to world space from that of a camera that looks along -Z, Y up (the
    columns are its axes and its position); `focal_length` and `sensor_width` in one
    unit, or `ortho_width` in the world's; optional `shift`, two fractions of the width
    by which the frame is moved right and up. Instead of these `project`, 4 rows of 4
    numbers, is the transform from camera space to OpenGL clip space. No samples are
    reused between cameras with different `name`s. Raises UsageError.
    """
    try:
        entries = json.loads(read_stream(path, _MOST_BYTES).decode("utf-8"))
        keys = {None if k == "all" else int(k): v for k, v in entries.items()}
        for camera in keys.values():
            _camera(camera, (2, 2), 1.0)
    except KeyError as error:
        raise UsageError(f"{path}: a camera lacks {error}") from error
    except (ValueError, TypeError, AttributeError) as error:
        raise UsageError(f"{path} is no file of cameras ({error})") from error
    except RecursionError as error:
        raise UsageError(f"{path} is no file of cameras (lists in lists)") from error
    return keys


def camera_of_frame(
    cameras: Mapping[int | None, dict[str, Any]],
    number: int,
    size: tuple[int, int],
    aspect: float = 1.0,
) -> Camera | None:
    """Return the camera of a frame from those of `read_cameras`, or None.

    `size` is (width, height) of the display window, `aspect` a pixel's width over its
    height. Raises ValueError if the two together give no camera.
    """
    entry = cameras.get(number, cameras.get(None))
    return None if entry is None else _camera(entry, size, aspect)


def _camera(item: Mapping[str, Any], size: tuple[int, int], aspect: float) -> Camera:
    view = np.linalg.inv(attributes.placement(item["to_world"]))
    name = str(item.get("name", ""))
    rows = item["project"] if "project" in item else _lens(item, size, aspect).tolist()
    return Camera(view, attributes.projection(rows), size, name=name)


def _lens(entry: Mapping[str, Any], size: tuple[int, int], aspect: float) -> Matrix:
    """Return `Camera.project` for a focal length, or for an orthographic width."""
    width, height = size[0] * aspect, size[1]
    project = np.zeros((4, 4))
    shift_x, shift_y = attributes.pair(entry.get("shift", [0.0, 0.0]))
    shift = np.array([2 * shift_x, 2 * shift_y * width / height])
    if "ortho_width" in entry:
        across = 2.0 / attributes.positive(entry["ortho_width"])
        project[2, 2], project[3, 3] = -1.0, 1.0
        project[:2, 3] = -shift
    else:
        sensor = attributes.positive(entry.get("sensor_width", _SENSOR))
        across = 2.0 * attributes.positive(entry["focal_length"]) / sensor
        project[2, 2], project[2, 3], project[3, 2] = -1.0, -1.0, -1.0
        project[:2, 2] = shift
    project[0, 0], project[1, 1] = across, across * width / height
    return project
