"""One PNG that compares the methods at a glance."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from xrds_core.arrays import Array
from xrds_core.atomic import replacing
from xrds_core.metrics import to_srgb

# Crops of the 960 x 540 picture: left, top; each CROP pixels wide and high.
CROP = (100, 68)
SPOTS = ((395, 103), (345, 195), (700, 238), (40, 355), (560, 395))
ZOOM = 3
GAP = 6
LABEL = 46
PAPER, INK = (24, 24, 26), (235, 235, 230)


def to_bytes(linear: Array) -> Array:
    """Scene-linear (H, W, 3) to sRGB bytes."""
    return np.round(to_srgb(linear) * 255.0).astype(np.uint8)


def enlarged(low: Array, height: int, width: int) -> Array:
    """Repeat low-resolution pixels, to show the network's input."""
    scale = -(-height // low.shape[0])
    grown = low.repeat(scale, axis=0).repeat(scale, axis=1)
    return grown[:height, :width]


def compare(columns: Sequence[tuple[str, Array]], path: Path) -> None:
    """Write the crops of every method side by side.

    Args:
        columns: label of at most two lines, picture (H, W, 3) scene-linear; all of
            one size.
        path: the PNG.
    """
    height, width = columns[0][1].shape[:2]
    cell = (CROP[0] * ZOOM, CROP[1] * ZOOM)
    sheet = Image.new(
        "RGB",
        (
            GAP + len(columns) * (cell[0] + GAP),
            LABEL + len(SPOTS) * (cell[1] + GAP),
        ),
        PAPER,
    )
    draw = ImageDraw.Draw(sheet)
    font = ImageFont.load_default(size=16)
    for number, (label, linear) in enumerate(columns):
        left = GAP + number * (cell[0] + GAP)
        draw.multiline_text((left + 2, 3), label, fill=INK, font=font, spacing=3)
        picture = Image.fromarray(to_bytes(linear))
        for row, spot in enumerate(SPOTS):
            box = _box(spot, width, height)
            crop = picture.crop(box).resize(cell, Image.Resampling.NEAREST)
            sheet.paste(crop, (left, LABEL + row * (cell[1] + GAP)))
    with replacing(path) as unfinished:
        sheet.save(unfinished, "PNG")


def _box(spot: tuple[int, int], width: int, height: int) -> tuple[int, int, int, int]:
    """The crop about a place of the 960 x 540 picture, in a picture of any size."""
    left = min(spot[0] * width // 960, max(0, width - CROP[0]))
    top = min(spot[1] * height // 540, max(0, height - CROP[1]))
    return left, top, left + CROP[0], top + CROP[1]
