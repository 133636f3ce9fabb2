"""Shots of the small world of `shots`, written as OpenEXR files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import shots

from xrds_core import exr
from xrds_core.accumulation.camera import Camera
from xrds_core.accumulation.frame import Frame
from xrds_core.exr.openexr_io import Part
from xrds_core.shot_files import cameras, frame_file

WINDOW = ((0, 0), (shots.WIDTH - 1, shots.HEIGHT - 1))
CYCLES = {
    "radiance": "ViewLayer.Noisy Image.RGB",
    "albedo": "ViewLayer.Denoising Albedo.RGB",
    "normal": "ViewLayer.Denoising Normal.XYZ",
    "depth": "ViewLayer.Depth.Z",
}


def single(camera: Camera) -> Camera:
    """The camera as single precision has it, as Blender's are."""
    view, project = (x.astype(np.float32) for x in (camera.view, camera.project))
    return replace(
        camera, view=view.astype(np.float64), project=project.astype(np.float64)
    )


def frame(number: int, noise: float = 0.5, step: float = 0.1, **more: Any) -> Frame:
    """A frame of a camera that moves to the right."""
    eye = single(shots.camera(x=step * number, window=more.pop("window", (0, 0))))
    return shots.view(number, eye, noise=noise, **more).frame


def planes(arrays: Mapping[str, Any], names: Mapping[str, str]) -> dict[str, Any]:
    """Channels by name, of arrays: `Pass.RGB` is of three, `Z` of one."""
    result = {}
    for key, name in names.items():
        prefix, _, letters = name.rpartition(".")
        array = np.atleast_3d(arrays[key])
        for i, letter in enumerate(letters):
            plane = array[..., i].astype(np.float32)
            result[f"{prefix}.{letter}".lstrip(".")] = plane
    return result


def write(
    folder: Path,
    frame: Frame,
    names: Mapping[str, str] = CYCLES,
    *,
    header: Mapping[str, Any] | None = None,
    **more: Any,
) -> Path:
    """Write a frame as FOLDER/0001.exr; `more` are other arrays that names speak of."""
    height, width = frame.shape
    x, y = frame.camera.window
    data = ((x, y), (x + width - 1, y + height - 1))
    told = {**cameras.to_header(frame.camera), frame_file.SAMPLES: 1}
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{frame.number:04d}.exr"
    channels = planes({**vars(frame), **more}, names)
    attributes = told if header is None else dict(header)
    exr.write_part(path, Part("", data, WINDOW, channels, attributes))
    return path


def picture(path: Path, prefix: str = "") -> Any:
    """R, G and B of a pass as the file holds them: (H, W, 3) of the data window."""
    file = exr.File(path)
    dot = f"{prefix}." if prefix else ""
    return np.dstack([file.pixels(f"{dot}{letter}") for letter in "RGB"])
