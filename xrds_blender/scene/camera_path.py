"""Where a camera swings so fast that the frames beside show something else.

Read from its keyframes alone: nothing is evaluated. A camera that is driven by more, as
by a parent or a constraint, is not judged.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from .keyframes import curves

_PART = 0.5  # of the width that is seen; less than half of the frame then stays in view
_EULER, _QUATERNION = "rotation_euler", "rotation_quaternion"


def whips(scene: Any, frames: Sequence[int]) -> list[int]:
    """Frames, of those given in order, in which less than half stays in view."""
    camera = scene.camera
    if camera is None or camera.parent or camera.constraints:
        return []
    data = camera.animation_data
    if data is None or data.action is None:
        return []
    found = curves(data.action, getattr(data, "action_slot", None))
    by_path = {(x.data_path, x.array_index): x for x in found}
    if not any(path in (_EULER, _QUATERNION) for path, _ in by_path):
        return []
    limit = _PART * camera.data.angle
    views = ((number, _rotation(camera, by_path, number)) for number in frames)
    return [
        number
        for (_, before), (number, now) in pairwise(views)
        if _angle(before, now) > limit
    ]


def _rotation(camera: Any, by_path: dict[tuple[str, int], Any], number: int) -> Any:
    """The camera's rotation in a frame, as a quaternion."""
    mode = camera.rotation_mode
    if mode == "AXIS_ANGLE":
        return camera.matrix_basis.to_quaternion()
    path = _QUATERNION if mode == "QUATERNION" else _EULER
    value = getattr(camera, path).copy()
    for index in range(len(value)):
        curve = by_path.get((path, index))
        if curve is not None:
            value[index] = curve.evaluate(number)
    return value.normalized() if mode == "QUATERNION" else value.to_quaternion()


def _angle(before: Any, now: Any) -> float:
    """Radians between the directions that two rotations look in."""
    first, second = (rotation.to_matrix().col[2] for rotation in (before, now))
    return float(first.angle(second, math.pi))
