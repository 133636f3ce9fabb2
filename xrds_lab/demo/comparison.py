"""Pictures that compare the ways at a glance: crops in a PNG, the shot as a film."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from xrds_core.files import replacing

from ..metrics import to_srgb
from ..shots import film

if TYPE_CHECKING:
    from xrds_core.arrays import Array

    Spot = tuple[int, int]
    Column = tuple[str, Array]

# Crops of the 960 x 540 picture: left, top; each CROP pixels wide and high.
CROP = (130, 84)
SPOTS: tuple[Spot, ...] = ((364, 96), (30, 345), (745, 205), (310, 200))
ZOOM = 3
GAP = 6
HEADING, LABEL = 30, 46  # pixels in height
FILM = (0.33, 0.71, 0.1, 0.64)  # of the frame: left, right, top, bottom
PAPER, INK = (24, 24, 26), (235, 235, 230)


def compare(heading: str, columns: Sequence[Column], path: Path) -> None:
    """Write the same enlarged crops of every picture side by side as a PNG.

    `columns`: labels of at most two lines, and pictures (H, W, 3), scene-linear, all
    of one size.
    """
    height, width = columns[0][1].shape[:2]
    cell = (CROP[0] * ZOOM, CROP[1] * ZOOM)
    top = HEADING + LABEL
    size = (
        GAP + len(columns) * (cell[0] + GAP),
        top + len(SPOTS) * (cell[1] + GAP),
    )
    sheet = Image.new("RGB", size, PAPER)
    draw = ImageDraw.Draw(sheet)
    draw.text((GAP, 6), heading, fill=INK, font=ImageFont.load_default(size=18))
    for number, (label, linear) in enumerate(columns):
        left = GAP + number * (cell[0] + GAP)
        _write(draw, (left, HEADING + 3), label)
        picture = Image.fromarray(_bytes(linear))
        for row, spot in enumerate(SPOTS):
            crop = picture.crop(_box(spot, width, height))
            shown = crop.resize(cell, Image.Resampling.NEAREST)
            sheet.paste(shown, (left, top + row * (cell[1] + GAP)))
    with replacing(path) as unfinished:
        sheet.save(unfinished, "PNG")


def move(shots: Sequence[Sequence[Array]], labels: Sequence[str], path: Path) -> None:
    """Write two shots side by side as an animated WebP that runs there and back.

    Of every frame (H, W, 3), scene-linear, the middle is shown in its own size.
    """
    parts = [[_middle(frame) for frame in frames] for frames in shots]
    film.save(path, _beside(parts, labels))


def play(
    shots: Sequence[Sequence[Array]], labels: Sequence[str], path: Path, largest: int
) -> None:
    """Write two shots (H, W, 3), scene-linear, side by side as one that begins anew."""
    film.save(path, _beside(shots, labels), largest, there_and_back=False)


def _beside(
    shots: Sequence[Sequence[Array]], labels: Sequence[str]
) -> list[Image.Image]:
    """Frames of two shots side by side, labels of two lines above."""
    frames = []
    for pair in zip(*shots, strict=True):
        picture = film.beside(*(to_srgb(frame) for frame in pair))
        sheet = Image.new("RGB", (picture.width, LABEL + picture.height), PAPER)
        for number, label in enumerate(labels):
            place = GAP + number * picture.width // 2, 3
            _write(ImageDraw.Draw(sheet), place, label)
        sheet.paste(picture, (0, LABEL))
        frames.append(sheet)
    return frames


def _write(draw: ImageDraw.ImageDraw, place: tuple[int, int], text: str) -> None:
    font = ImageFont.load_default(size=16)
    draw.multiline_text(place, text, fill=INK, font=font, spacing=3)


def _bytes(linear: Array) -> Array:
    """Scene-linear (H, W, 3) to sRGB bytes."""
    return np.round(to_srgb(linear) * 255.0).astype(np.uint8)


def _middle(frame: Array) -> Array:
    height, width = frame.shape[:2]
    left, right, top, bottom = FILM
    rows = slice(int(top * height), int(bottom * height))
    return frame[rows, int(left * width) : int(right * width)]


def _box(spot: Spot, width: int, height: int) -> tuple[int, int, int, int]:
    """The crop about a place of the 960 x 540 picture, in a picture of any size."""
    left = min(spot[0] * width // 960, max(0, width - CROP[0]))
    top = min(spot[1] * height // 540, max(0, height - CROP[1]))
    return left, top, left + CROP[0], top + CROP[1]
