"""Small parts of middle frames, kept beside the figures to be looked at."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from xrds_core.files import read_json, replacing, write_json

from ..bench.crops import largest
from ..metrics import to_srgb

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from xrds_core.arrays import Array

    Key = tuple[str, str, str, int, int]

SIZE = 128
"""Pixels of a crop in width and height, at most."""
REFERENCE = ("reference", 0, 0)
"""In the place of method, samples and radius in the key of a reference's crop."""
QUALITY = 75  # of WebP: a page holds hundreds, to be looked at and not measured
_STEP = 8  # pixels between the places that are tried


def crop_key(point: Mapping[str, Any]) -> Key:
    """Scene, motion, method, samples and radius of a point."""
    names = ("scene", "motion", "method", "samples", "radius")
    scene, motion, method, samples, radius = (point[name] for name in names)
    return scene, motion, method, samples, radius


class SceneCrops:
    """Crops of one scene as WebP files: all of one motion are of the same place."""

    def __init__(self, directory: Path, name: str) -> None:
        self._directory, self._name = directory, name
        self._places = directory / f"{name}-crops.json"
        self._known: dict[str, list[int]] = (
            read_json(self._places) if self._places.is_file() else {}
        )

    def path(self, key: str) -> Path:
        """The file of a picture, by the key of its figures."""
        return self._directory / f"{self._name}-crop-{key}.webp"

    def references(self) -> dict[str, Path]:
        """The files of the reference at the place of each motion."""
        return {motion: self._reference(motion) for motion in self._known}

    def _reference(self, motion: str) -> Path:
        return self.path(f"{motion}-reference")

    def has_place(self, motion: str) -> bool:
        """Whether it is settled where the crops of a motion are."""
        return motion in self._known

    def settle(
        self, motion: str, pair: tuple[Array, Array], reference: Array, stops: float
    ) -> None:
        """Crop where a `pair` of pictures (H, W, 3) differs most, in sRGB.

        Keeps the place, and the crop of the reference.
        """
        one, other = (to_srgb(picture, stops) for picture in pair)
        rows, columns = largest(np.abs(one - other).mean(-1), SIZE, SIZE, _STEP)
        self._known[motion] = [rows.start, columns.start]
        self._save(self._reference(motion), motion, reference, stops)
        write_json(self._places, self._known)

    def keep(self, key: str, motion: str, picture: Array, stops: float) -> None:
        """Keep the crop of a picture (H, W, 3), scene-linear, at the motion's place."""
        self._save(self.path(key), motion, picture, stops)

    def _save(self, path: Path, motion: str, picture: Array, stops: float) -> None:
        from PIL import Image

        top, left = self._known[motion]
        shown = to_srgb(picture[top : top + SIZE, left : left + SIZE], stops)
        pixels = np.round(shown * 255).astype(np.uint8)
        with replacing(path) as part:
            Image.fromarray(pixels).save(part, "WEBP", quality=QUALITY)
