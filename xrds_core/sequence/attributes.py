"""Values from headers and camera files, which may hold anything.

Each reader takes what the file holds and raises ValueError, with what was expected, if
that is something else.
"""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any

import numpy as np

from ..temporal.frame import Sphere

if TYPE_CHECKING:
    from ..temporal.frame import Matrix

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
        raise ValueError(f"{_short(value)} is no whole number from {least} to {most}")
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
        raise ValueError(f"{_short(value)} is no number from {least:g} to {most:g}")
    return result


def positive(value: Any) -> float:
    """A number above 0, large enough to divide by."""
    return number(value, 1 / LARGEST)


def pair(value: Any) -> tuple[float, float]:
    """Two numbers in a list."""
    if not isinstance(value, list) or len(value) != 2:
        raise ValueError(f"{_short(value)} are not two numbers")
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


def sphere(text: Any) -> Sphere:
    """What a panorama shows: west, east, south and north in radians, as text."""
    words = text.split() if isinstance(text, str) else []
    try:
        west, east, south, north = (number(float(x), -100.0, 100.0) for x in words)
    except ValueError as error:
        raise ValueError(
            f"{_short(text)} are not west, east, south and north in radians"
        ) from error
    if east - west < _LEAST_SPAN or north - south < _LEAST_SPAN:
        raise ValueError(f"{_short(text)} is a panorama without an extent")
    return Sphere((west, east), (south, north))


def _is_four(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 4


def _short(value: Any) -> str:
    """The value, if it is short enough for an error message."""
    if isinstance(value, int) and abs(value) > MOST:
        return "a number beyond 32 bits"
    text = repr(value) if isinstance(value, int | float | str) else ""
    return text if 0 < len(text) <= 40 else "this value"
