"""Cameras of frames: in the header of an OpenEXR file, or in a JSON file beside them.

OpenEXR's standard attributes are `worldToCamera` and `worldToNDC`, for row vectors.
The camera looks along its +Z, with X to the right and Y up; NDC is (0, 0) in the upper
left and (1, 1) in the lower right corner of the display window. (OpenEXR, Standard
Attributes.) Some renderers write a camera that looks along -Z, or NDC from -1 to 1 with
Y up: the two matrices together show which.

Headers and camera files may hold anything: each reader of a value takes what is there
and raises ValueError, with what was expected, if that is something else.
"""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..accumulation.camera import Camera, Sphere
from ..errors import UsageError
from ..files import read_stream

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ..accumulation.frame import Matrix


MOST = 2**31 - 1  # the libraries count in 32 bits
LARGEST = 1e15
"""Of lengths, in any unit: its square fits into float32."""
_LEAST_SPAN = 1e-6  # radians
_ROUNDING = 1e-4  # of matrices in single precision


def whole(value: Any, least: int = 0, most: int = MOST) -> int:
    """A whole number, also as text: 64, 64.0 or "64"."""
    text = str(value)[:40] if isinstance(value, int | float | str) else ""
    match = re.fullmatch(r"([0-9]{1,10})(\.0+)?", text)
    if match is None or not least <= int(match[1]) <= most:
        raise ValueError(f"{_shorten(value)} is no whole number from {least} to {most}")
    return int(match[1])


def whole_or_none(value: Any, least: int = 0, most: int = MOST) -> int | None:
    """The same, but None for anything else: for optional values."""
    try:
        return whole(value, least, most)
    except ValueError:
        return None


def number(value: Any, least: float = -LARGEST, most: float = LARGEST) -> float:
    """A number from `least` to `most`."""
    result = math.nan
    if isinstance(value, int | float) and not isinstance(value, bool):
        result = float(value) if abs(value) <= LARGEST else math.nan
    if not least <= result <= most:
        raise ValueError(f"{_shorten(value)} is no number from {least:g} to {most:g}")
    return result


def positive(value: Any) -> float:
    """A number above 0, large enough to divide by."""
    return number(value, 1 / LARGEST)


def pair_of_numbers(value: Any) -> tuple[float, float]:
    """Two numbers in a list."""
    if not isinstance(value, list) or len(value) != 2:
        raise ValueError(f"{_shorten(value)} are not two numbers")
    return number(value[0]), number(value[1])


def matrix(rows: Any) -> Matrix:
    """(4, 4), from 4 lists of 4 numbers."""
    if not _is_four(rows) or not all(map(_is_four, rows)):
        raise ValueError("a matrix has not 4 rows of 4 numbers")
    try:
        return np.array([[number(x) for x in row] for row in rows])
    except ValueError as error:
        raise ValueError(f"in a matrix {error}") from error


def placement(rows: Any) -> Matrix:
    """An invertible affine transform, for column vectors."""
    result = matrix(rows)
    if np.abs(result[3] - [0, 0, 0, 1]).max() > _ROUNDING:
        raise ValueError("a matrix is no placement: it may lie on its side")
    axes = np.linalg.norm(result[:3, :3], axis=0)
    volume = abs(np.linalg.det(result[:3, :3]))
    if not volume > 1e-6 * axes.prod() or not 1e-9 < axes.min() <= axes.max() < 1e9:
        raise ValueError("a matrix has no inverse")
    return result


def projection(rows: Any) -> Matrix:
    """(4, 4) to OpenGL clip space, perspective or orthographic, without rotation."""
    result = matrix(rows)
    ends = [*result[3], result[0, 1], result[1, 0]]  # the rest is free
    kinds = ([0, 0, -1, 0, 0, 0], [0, 0, 0, 1, 0, 0])
    if not any(np.allclose(ends, kind, atol=_ROUNDING) for kind in kinds):
        raise ValueError("a matrix is no projection to OpenGL's clip space")
    if not all(1e-9 < abs(result[i, i]) < 1e9 for i in (0, 1)):
        raise ValueError("a projection has no width or no height")
    return result


def sphere_of(text: Any) -> Sphere:
    """What a panorama shows: west, east, south and north in radians, as text."""
    words = text.split() if isinstance(text, str) else []
    try:
        west, east, south, north = (number(float(x), -100.0, 100.0) for x in words)
    except ValueError as error:
        raise ValueError(
            f"{_shorten(text)} are not west, east, south and north in radians"
        ) from error
    if east - west < _LEAST_SPAN or north - south < _LEAST_SPAN:
        raise ValueError(f"{_shorten(text)} is a panorama without an extent")
    return Sphere((west, east), (south, north))


def _is_four(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 4


def _shorten(value: Any) -> str:
    """Return a value as text, if it is short enough for an error message."""
    if isinstance(value, int) and abs(value) > MOST:
        return "a number beyond 32 bits"
    text = repr(value) if isinstance(value, int | float | str) else ""
    return text if 0 < len(text) <= 40 else "this value"


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
    """Read the camera that a header describes.

    Parameters
    ----------
    header : mapping
        Attributes of a file.
    size : tuple of int
        Width and height of the display window.

    Returns
    -------
    camera : Camera or None
        None without the attributes of a camera.

    Raises
    ------
    ValueError
        If the values describe no camera.
    """
    if not has_camera(header):
        return None
    view = placement(_transpose(header[VIEW]))
    if SPHERE in header:
        sphere = sphere_of(header[SPHERE])
        return Camera(_AHEAD @ view, np.zeros((4, 4)), size, sphere=sphere)
    if PROJECT in header:
        project = projection(_transpose(header[PROJECT]))
        return Camera(_AHEAD @ view, project, size)
    ndc = matrix(_transpose(header[NDC]))
    seen: Matrix = ndc @ np.linalg.inv(view)
    perspective = abs(seen[3, 2]) > _SKEW * abs(seen[3, 3])
    turned: Matrix = _AHEAD if not perspective or seen[3, 2] > 0 else np.eye(4)
    project = _make_projection(seen @ turned, perspective)
    return Camera(turned @ view, projection(project.tolist()), size)


def _transpose(rows: Any) -> list[list[float]]:
    """Transpose a matrix: headers hold those for row vectors, cameras for columns."""
    return matrix(rows).T.tolist()


def _make_projection(seen: Matrix, perspective: bool) -> Matrix:
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
    """Return a camera in the form of a JSON file of cameras; not of a panorama."""
    return {
        "to_world": np.linalg.inv(camera.view).tolist(),
        "project": camera.project.tolist(),
        "name": camera.name,
    }


def read_cameras(path: Path) -> dict[int | None, dict[str, Any]]:
    """Read cameras by frame number from a JSON file.

    The file holds an object from frame numbers, or "all", to cameras with these keys:

    - `to_world`, 4 rows of 4 numbers: the transform to world space from that of a
      camera that looks along -Z, Y up (its columns are the camera's axes and position);
    - `focal_length` and `sensor_width` in one unit, or `ortho_width` in the world's;
    - optional `shift`, two fractions of the width by which the frame is moved right and
      up;
    - instead of these `project`, 4 rows of 4 numbers: the transform from camera space
      to OpenGL clip space;
    - optional `name`: no samples are reused between cameras with different names.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    cameras : dict of int or None to dict
        Entries by frame number; None is for all other frames.

    Raises
    ------
    UsageError
        If the file cannot be read or holds no cameras.
    """
    try:
        entries = json.loads(read_stream(path, _MOST_BYTES).decode("utf-8"))
        keys = {None if k == "all" else int(k): v for k, v in entries.items()}
        for camera in keys.values():
            _make_camera(camera, (2, 2), 1.0)
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
    """Return the camera of a frame.

    Parameters
    ----------
    cameras : mapping
        What `read_cameras` returns.
    number : int
        Frame number.
    size : tuple of int
        Width and height of the display window.
    aspect : float
        A pixel's width over its height.

    Returns
    -------
    camera : Camera or None
        None where the file has no camera for this frame.

    Raises
    ------
    ValueError
        If the entry and the size together give no camera.
    """
    entry = cameras.get(number, cameras.get(None))
    return None if entry is None else _make_camera(entry, size, aspect)


def _make_camera(
    item: Mapping[str, Any], size: tuple[int, int], aspect: float
) -> Camera:
    view = np.linalg.inv(placement(item["to_world"]))
    name = str(item.get("name", ""))
    rows = (
        item["project"]
        if "project" in item
        else _make_lens_projection(item, size, aspect).tolist()
    )
    return Camera(view, projection(rows), size, name=name)


def _make_lens_projection(
    entry: Mapping[str, Any], size: tuple[int, int], aspect: float
) -> Matrix:
    """Return `Camera.project` for a focal length, or for an orthographic width."""
    width, height = size[0] * aspect, size[1]
    project = np.zeros((4, 4))
    shift_x, shift_y = pair_of_numbers(entry.get("shift", [0.0, 0.0]))
    shift = np.array([2 * shift_x, 2 * shift_y * width / height])
    if "ortho_width" in entry:
        across = 2.0 / positive(entry["ortho_width"])
        project[2, 2], project[3, 3] = -1.0, 1.0
        project[:2, 3] = -shift
    else:
        sensor = positive(entry.get("sensor_width", _SENSOR))
        across = 2.0 * positive(entry["focal_length"]) / sensor
        project[2, 2], project[2, 3], project[3, 2] = -1.0, -1.0, -1.0
        project[:2, 2] = shift
    project[0, 0], project[1, 1] = across, across * width / height
    return project
