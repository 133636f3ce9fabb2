"""How an OpenEXR file holds its pixels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

Pixels = np.ndarray[Any, Any]

CODECS = (
    *("none", "rle", "zips", "zip", "piz"),
    *("pxr24", "b44", "b44a", "dwaa", "dwab"),  # these lose some of the picture
)
LARGEST_HALF = 65504.0


@dataclass(frozen=True)
class Encoding:
    """16 bits for each number or 32, compressed by one of CODECS."""

    half: bool = False
    codec: str = "zip"

    @property
    def dtype(self) -> Any:
        """NumPy's name of the number format."""
        return np.float16 if self.half else np.float32

    def plane(self, pixels: Pixels) -> Pixels:
        """(H, W) numbers as they are written."""
        return np.ascontiguousarray(fitting(pixels, self.dtype))


FLOAT_ZIP = Encoding()


def fitting(pixels: Pixels, dtype: Any) -> Pixels:
    """Pixels in another number format; what half floats cannot hold is bounded.

    Infinity stays what it is.
    """
    if dtype == np.float16:
        bounded = np.clip(pixels, -LARGEST_HALF, LARGEST_HALF)
        pixels = np.where(np.isinf(pixels), pixels, bounded)
    return pixels.astype(dtype, copy=False)
