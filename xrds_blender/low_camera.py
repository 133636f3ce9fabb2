"""The camera of the low-resolution render: every pixel exactly scale x scale.

The low-resolution frame is the full one rounded up to whole pixels, so its camera
sees a little more at the right and at the bottom. Sensor, shift and ortho scale of
the evaluated camera are changed accordingly; the top left corner stays.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from .borrowed import Borrowed


@dataclass(frozen=True)
class Frame:
    """A camera frame in full-resolution pixels, with the pixels' shape."""

    width: int
    height: int
    aspect_x: float = 1.0
    aspect_y: float = 1.0

    def low_size(self, scale: int) -> tuple[int, int]:
        """Width and height in low-resolution pixels, rounded up."""
        return -(-self.width // scale), -(-self.height // scale)

    def covered(self, scale: int) -> Frame:
        """The frame that the low-resolution pixels cover."""
        width, height = self.low_size(scale)
        return Frame(width * scale, height * scale, self.aspect_x, self.aspect_y)

    def fits_width(self, sensor_fit: str) -> bool:
        """Whether Blender lays the sensor along the width."""
        if sensor_fit == "AUTO":
            return self.width * self.aspect_x > self.height * self.aspect_y
        return sensor_fit == "HORIZONTAL"


@dataclass(frozen=True)
class Lens:
    """What of a camera decides the frame; `sensor` lies along the fitted side."""

    sensor: float
    ortho_scale: float
    shift_x: float
    shift_y: float


def widened(lens: Lens, along_width: bool, frame: Frame, seen: Frame) -> Lens:
    """The lens that shows `seen`, a frame with the same top left corner.

    Shifts are in units of the fitted side, as Blender counts them.
    """
    if along_width:
        old, new = frame.width * frame.aspect_x, seen.width * seen.aspect_x
    else:
        old, new = frame.height * frame.aspect_y, seen.height * seen.aspect_y
    right = (seen.width - frame.width) / 2 * frame.aspect_x
    down = (seen.height - frame.height) / 2 * frame.aspect_y
    return Lens(
        lens.sensor * new / old,
        lens.ortho_scale * new / old,
        (lens.shift_x * old + right) / new,
        (lens.shift_y * old - down) / new,
    )


def is_exact(camera: Any) -> bool:
    """Whether the camera's frame can be widened; panoramas are resampled instead."""
    return camera.type in {"PERSP", "ORTHO"}


def widen(borrowed: Borrowed, camera: Any, frame: Frame, scale: int) -> None:
    """Make the evaluated `camera` show `frame.covered(scale)`, until given back."""
    seen = frame.covered(scale)
    if not is_exact(camera) or seen == frame:
        return
    along_width = frame.fits_width(camera.sensor_fit)
    # AUTO measures by the sensor's width whichever side is longer.
    use_width = along_width or camera.sensor_fit == "AUTO"
    sensor = camera.sensor_width if use_width else camera.sensor_height
    old = Lens(sensor, camera.ortho_scale, camera.shift_x, camera.shift_y)
    new = widened(old, along_width, frame, seen)
    borrowed.set(
        camera,
        sensor_fit="HORIZONTAL" if along_width else "VERTICAL",
        **{"sensor_width" if along_width else "sensor_height": new.sensor},
        ortho_scale=new.ortho_scale,
        shift_x=new.shift_x,
        shift_y=new.shift_y,
    )
