"""Sheets of crops, enlarged: where the product gains most, and where it fails."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from xrds_core.files import replacing

from ..metrics import to_srgb
from .crops import largest
from .table import COLUMNS

if TYPE_CHECKING:
    from pathlib import Path

    from PIL.Image import Image

    from xrds_core.arrays import Array

    Pictures = dict[str, Array]

CROP, ZOOM, STEP = 80, 4, 8  # pixels of a crop, its enlargement, pixels between places
CAPTION = 18  # pixels above each crop
SHOWN = ("bicubic", "demodulated_bilinear", "xrds", "oidn_equal_spp")
QUALITY = 85  # of the JPEG


class Sheet:
    """One scene's crops: two rows of all methods and the reference for each case."""

    def __init__(self) -> None:
        self._rows: list[Image] = []

    def add(
        self, title: str, pictures: Pictures, reference: Array, stops: float
    ) -> None:
        """Linear pictures (H, W, 3) of one case by method; without XRDS no row."""
        if "xrds" not in pictures:
            return
        truth = to_srgb(reference, stops)
        shown = {name: to_srgb(pictures[name], stops) for name in SHOWN}
        errors = {
            name: np.square(picture - truth).mean(-1) for name, picture in shown.items()
        }
        places = {
            "most gained over bicubic": errors["bicubic"] - errors["xrds"],
            "most lost to OIDN": errors["xrds"] - errors["oidn_equal_spp"],
        }
        for what, difference in places.items():
            box = largest(difference, CROP, CROP, STEP)
            cells = [
                _cell(COLUMNS[name], picture[box], errors[name][box])
                for name, picture in shown.items()
            ]
            cells.append(_cell("reference", truth[box], None))
            y, x = box[0].start, box[1].start
            self._rows.append(_beside(f"{title}: {what}, at ({x}, {y})", cells))

    def write(self, path: Path) -> None:
        """Write a JPEG; nothing where there are no rows."""
        from PIL import Image

        if not self._rows:
            return
        size = self._rows[0].width, sum(row.height for row in self._rows)
        whole = Image.new("RGB", size, "white")
        top = 0
        for row in self._rows:
            whole.paste(row, (0, top))
            top += row.height
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as part:
            whole.save(part, "JPEG", quality=QUALITY)


def _cell(name: str, crop: Array, error: Array | None) -> Image:
    """A crop under its name and its own PSNR."""
    from PIL import Image, ImageDraw

    pixels = Image.fromarray(np.round(crop * 255).astype(np.uint8))
    size = pixels.width * ZOOM, pixels.height * ZOOM
    cell = Image.new("RGB", (size[0] + 2, size[1] + CAPTION), "white")
    cell.paste(pixels.resize(size, Image.Resampling.NEAREST), (0, CAPTION))
    if error is not None:
        name += f" {-10 * np.log10(max(float(error.mean()), 1e-10)):.1f} dB"
    ImageDraw.Draw(cell).text((2, 3), name, fill="black")
    return cell


def _beside(title: str, cells: list[Image]) -> Image:
    from PIL import Image, ImageDraw

    size = sum(cell.width for cell in cells), cells[0].height + CAPTION
    row = Image.new("RGB", size, "white")
    ImageDraw.Draw(row).text((2, 3), title, fill="black")
    left = 0
    for cell in cells:
        row.paste(cell, (left, CAPTION))
        left += cell.width
    return row
