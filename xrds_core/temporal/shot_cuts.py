"""Shot cuts, detected from the cameras alone.

No samples are reused across a shot cut, whatever the pictures look like. A change to
another camera, camera type or frame size, a jump of the focal length and a view that
swings away within one frame are cuts; a zoom, a fast pan and a change of the render
border are not.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .frame import Camera, Stored

# Factor by which the focal length may change from one frame to the next.
_ZOOM = 1.25
# Share of the field of view by which a camera may turn from one frame to the next.
_TURN = 0.5


def is_shot_cut(before: Camera, after: Camera) -> bool:
    """Whether there is a shot cut between two consecutive frames."""
    if _kind(before) != _kind(after):
        return True
    if before.sphere is not None:  # a panorama sees everything
        return False
    old, new = (np.abs(np.diag(c.project)[:2]) for c in (before, after))
    if (np.maximum(old / new, new / old) > _ZOOM).any():
        return True
    cosine = before.view[2, :3] @ after.view[2, :3]
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    seen = np.pi if before.orthographic else 2 * np.arctan(1 / min(*old, *new))
    return bool(angle > _TURN * seen)


def same_shot(target: Stored, others: Sequence[Stored]) -> list[Stored]:
    """Return those of `others`, in their order, with no cut between them and `target`.

    The views of one moment, as of a stereo pair, belong to the same shot.
    """
    cameras = {frame.number: frame.camera for frame in (*others, target)}
    numbers = {target.number}
    for step in (1, -1):
        number = target.number
        beyond = [n for n in cameras if (n - number) * step > 0]
        for after in sorted(beyond, key=lambda n: n * step):
            if is_shot_cut(cameras[number], cameras[after]):
                break
            numbers.add(after)
            number = after
    return [frame for frame in others if frame.number in numbers]


def _kind(camera: Camera) -> tuple[object, ...]:
    return camera.name, camera.orthographic, camera.sphere, camera.size
