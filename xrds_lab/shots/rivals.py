"""What a shot is compared with: Cycles' own denoiser, and a median over frames.

Arrays are float32 (H, W, C), row 0 on top, scene-linear.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from xrds_blender.planning.settings import (
    CYCLES_DENOISING,
    DEFAULT_DENOISING,
    Denoising,
)
from xrds_core.accumulation.frame import store
from xrds_core.accumulation.reprojection import grid, reproject, reprojection

if TYPE_CHECKING:
    from xrds_core.accumulation.frame import Frame
    from xrds_core.arrays import Array

MODES: tuple[Denoising, ...] = CYCLES_DENOISING


def cycles_oidn(frame: Frame, mode: Denoising = DEFAULT_DENOISING) -> Array:
    """What Cycles' denoiser makes of a frame's samples, (H, W, 3).

    The same library with the same settings, as in Cycles'
    `intern/cycles/integrator/denoiser_oidn.cpp`: one render then serves all modes.
    """
    quality = mode.quality.capitalize()
    images = {name: _upwards(image) for name, image in _guides(frame).items()}
    if mode.prefilter == "ACCURATE":
        images = {k: _run(quality, False, **{k: image}) for k, image in images.items()}
    colour = _upwards(frame.radiance)
    clean = mode.prefilter != "FAST"  # which takes the guides for noisy
    return np.ascontiguousarray(_run(quality, clean, color=colour, **images)[::-1])


def clean_guides(frame: Frame) -> dict[str, Array]:
    """Albedo and normal (H, W, 3), each denoised by itself."""
    cleaned = {
        name: _run("High", False, **{name: _upwards(image)})
        for name, image in _guides(frame).items()
    }
    return {name: np.ascontiguousarray(image[::-1]) for name, image in cleaned.items()}


def _guides(frame: Frame) -> dict[str, Array]:
    return {"albedo": frame.albedo, "normal": frame.normal}


def _upwards(image: Array) -> Array:
    """Rows in Blender's order: the networks are not symmetric."""
    return np.ascontiguousarray(image[::-1])


def _run(quality: str, clean: bool, **images: Array) -> Array:
    import mitsuba_oidn as oidn

    output = np.empty_like(next(iter(images.values())))
    task = _device().new_filter("RT")
    task.quality = getattr(oidn.Quality, quality)
    if "color" in images:
        task.hdr, task.clean_aux = True, clean
    for name, image in images.items():
        task.set_image(name, image)
    task.set_image("output", output)
    task.execute()
    return output


@lru_cache(maxsize=1)
def _device() -> Any:
    from xrds_core.denoising.oidn_device import open_device

    return open_device("cpu", 0)


def median_of_three(frames: dict[int, Frame], number: int) -> Array:
    """The median of three denoised frames, the outer two moved onto the middle one.

    As SID-Temporal does: each frame is denoised by itself, the neighbours are
    displaced by the Vector pass, and every channel of every pixel is the middle one of
    three values. A neighbour that is not there is left to the frame itself. Where
    the frames hold no Vector pass nothing but the camera moves: then the depth tells
    the same.
    """
    own = frames[number]
    pictures = [cycles_oidn(own)]
    for beside in (number - 1, number + 1):
        other = frames.get(beside)
        if other is None:
            return pictures[0]
        x, y = displaced(own, other)
        pictures.append(interpolated(cycles_oidn(other), x, y))
    return np.asarray(np.median(np.stack(pictures), axis=0))


def displaced(here: Frame, there: Frame) -> tuple[Array, Array]:
    """Where each pixel (H, W) is in the frame before or after, in pixels."""
    rows, columns = np.mgrid[: here.shape[0], : here.shape[1]].astype(np.float32)
    if here.vector is None:
        own = grid(here.shape)
        forth = reprojection(here.camera, there.camera)
        x, y, _ = reproject(forth, own.x, own.y, store(here).inverse_depth)
        return x.reshape(here.shape) - 0.5, y.reshape(here.shape) - 0.5
    if there.number < here.number:
        return columns + here.vector[..., 0], rows - here.vector[..., 1]
    return columns - here.vector[..., 2], rows + here.vector[..., 3]


def interpolated(picture: Array, x: Array, y: Array) -> Array:
    """Return a picture (H, W, 3) at places (H, W), linear between pixels."""
    height, width = picture.shape[:2]
    x, y = np.nan_to_num(x).clip(0, width - 1), np.nan_to_num(y).clip(0, height - 1)
    left, top = np.floor(x).astype(int), np.floor(y).astype(int)
    right, below = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
    across, down = (x - left)[..., None], (y - top)[..., None]
    upper = picture[top, left] * (1 - across) + picture[top, right] * across
    lower = picture[below, left] * (1 - across) + picture[below, right] * across
    return np.asarray(upper * (1 - down) + lower * down, np.float32)
