"""Short films of the best and the worst shot, beside Cycles + OIDN's default."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np

from xrds_blender.planning.settings import DEFAULT_DENOISING
from xrds_core.files import replacing

from ..metrics import to_srgb
from .figures import Clip
from .frames import REACH
from .methods import XRDS
from .report import cases, compared

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from PIL import Image

    from xrds_core.arrays import Array

    Point = dict[str, Any]

FRAME_MILLISECONDS = 83  # 12 frames a second
FILM_MILLISECONDS = 62  # 16: of longer ones
QUALITIES = (90, 75, 60, 45, 30, 20)
LARGEST = 600_000  # bytes: pages show several
_GAP = 4  # white pixels between both


def chosen(points: Sequence[Point], samples: int) -> dict[str, tuple[str, str]]:
    """Scene and motion with the largest and the smallest gain at so many samples."""
    gains = {
        (ours["scene"], case[0]): ours["psnr"] - rival["psnr"]
        for case in cases(points)
        if case[1] == samples
        for ours, rival in compared(points, case, XRDS, REACH)
    }
    if not gains:
        return {}
    ordered = sorted(gains, key=lambda shot: gains[shot])
    return {"best": ordered[-1], "worst": ordered[0]}


def write(path: Path, clip: Clip) -> None:
    """Write all frames of a shot as an animated WebP: Cycles + OIDN, then XRDS."""
    frames = [
        beside(
            to_srgb(clip.oidn(number, DEFAULT_DENOISING), clip.stops),
            to_srgb(clip.xrds(number, REACH), clip.stops),
        )
        for number in sorted(clip.frames)
    ]
    save(path, frames)


def save(
    path: Path,
    frames: Sequence[Image.Image],
    largest: int = LARGEST,
    there_and_back: bool = True,
) -> None:
    """Write pictures as an animated WebP that runs without end.

    In the best of QUALITIES that takes no more than `largest` bytes, or in the last.
    """
    back = frames[-2:0:-1] if there_and_back else []
    for quality in QUALITIES:
        film = io.BytesIO()
        frames[0].save(
            film,
            "WEBP",
            save_all=True,
            append_images=[*frames[1:], *back],
            duration=FRAME_MILLISECONDS if there_and_back else FILM_MILLISECONDS,
            loop=0,
            quality=quality,
        )
        if film.tell() <= largest:
            break
    with replacing(path) as part:
        part.write_bytes(film.getvalue())


def beside(left: Array, right: Array) -> Image.Image:
    """Two pictures (H, W, 3), sRGB from 0 to 1, with a white line between them."""
    from PIL import Image

    gap = np.ones((left.shape[0], _GAP, 3), np.float32)
    both = np.concatenate([left, gap, right], axis=1)
    return Image.fromarray(np.round(both * 255).astype(np.uint8))
