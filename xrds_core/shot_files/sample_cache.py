"""Frames stored on disk before denoising, in the format that `frame_file` reads.

One OpenEXR file with Cycles' pass names holds what accumulation needs: light, guides
and motion in half floats, as a window stores them in memory, and depths in full. So a
frame that was read is reused and finished as if it had just been rendered.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import exr
from ..accumulation.frame import pack_counts, pack_frame
from ..accumulation.passes import LAYOUT
from ..arrays import LARGEST_HALF
from ..exr.openexr_io import Part
from .cameras import to_header
from .frame_file import KEY, NAME, RADIUS, SAMPLES, STILL, SUBSET
from .pass_names import NOISE

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ..accumulation.frame import Frame
    from ..arrays import Array


@dataclass(frozen=True)
class Origin:
    """What a frame was rendered from and how.

    Attributes
    ----------
    key : str
        The same for frames of one file and one set of settings.
    layer : str
        View layer.
    radius : int
        Temporal radius that the sample subsets are for.
    """

    key: str
    layer: str = ""
    radius: int = 0


def write_cached_frame(path: Path, frame: Frame, origin: Origin) -> None:
    """Write a frame, completely or not at all.

    Parameters
    ----------
    path : Path
        The file.
    frame : Frame
        A frame with radiance.
    origin : Origin
        What it was rendered from.

    Raises
    ------
    PictureError
        If the file cannot be written.
    """
    height, width = frame.shape
    x, y = frame.camera.window
    right, bottom = (side - 1 for side in frame.camera.size)
    attributes: dict[str, Any] = {
        **to_header(frame.camera),
        # a mean where counts differ
        SAMPLES: frame.samples if frame.counts is not None else int(frame.samples),
        KEY: origin.key,
        RADIUS: origin.radius,
        STILL: int(frame.still),
        NAME: frame.camera.name,
    }
    if frame.subset is not None:
        attributes[SUBSET] = frame.subset
    part = Part(
        "",
        ((x, y), (x + width - 1, y + height - 1)),
        ((0, 0), (right, bottom)),
        _make_channels(frame, f"{origin.layer}." if origin.layer else ""),
        attributes,
    )
    exr.write_part(path, part)


def _make_channels(frame: Frame, layer: str) -> dict[str, NDArray[Any]]:
    # noise always: computed from the half floats of the rest it would differ
    channels = _split_planes(
        f"{layer}{NOISE}", "XYZ", _stack_noise(frame).astype(np.float16)
    )
    for name, pixels in frame.given.items():
        layout = LAYOUT[name]
        if name == "counts":
            packed = pack_counts(pixels).reshape(frame.shape)
        else:
            packed = pixels.astype(np.float32) if layout.is_full else _to_half(pixels)
        channels |= _split_planes(f"{layer}{layout.name}", layout.letters, packed)
    return channels


def _split_planes(
    name: str, letters: str, pixels: NDArray[Any]
) -> dict[str, NDArray[Any]]:
    planes = pixels[..., None] if pixels.ndim == 2 else pixels
    return {f"{name}.{letter}": planes[..., i] for i, letter in enumerate(letters)}


def _stack_noise(frame: Frame) -> Array:
    """Return (H, W, 3): brightness, difference and guides of `Noise`."""
    noise = pack_frame(frame)[2]
    assert noise is not None
    parts = (noise.brightness, noise.difference, noise.guides)
    return np.stack(parts, axis=-1).reshape(*frame.shape, 3).astype(np.float32)


def _to_half(values: Array) -> NDArray[np.float16]:
    """Clip to the largest half float; infinities stay."""
    cut = np.clip(values, -LARGEST_HALF, LARGEST_HALF)
    return np.where(np.isfinite(values), cut, values).astype(np.float16)
