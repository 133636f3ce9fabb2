"""Limits on what an OpenEXR header may claim, checked before memory is allocated."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..errors import PictureError

_LARGEST_SIDE = 1 << 16  # pixels; more is a damaged header
_ALWAYS_READ = 1 << 30  # bytes of pixels
_USUAL_RATIO = 1000  # of pixels to file; ZIP, the default, packs no picture smaller
_ALWAYS_PADDED = 4096 * 2304  # pixels, of a 4K picture
_USUAL_PADDING = 16  # times the pixels that a crop holds
_BYTES = 4  # of a number; the header as read does not say half or float

_allowed = 0


def allow(size: int | None) -> None:
    """Let this process read files of `size` bytes of pixels; None: the usual again."""
    global _allowed
    _allowed = size or 0


def is_mostly_empty(pixels: int, whole: int) -> bool:
    """Whether a large window holds so few pixels of a file that it may be a mistake."""
    return not _allowed and whole > _ALWAYS_PADDED and whole > _USUAL_PADDING * pixels


def limit_of(size: int) -> int:
    """The bytes of pixels that are read of a file of `size` bytes."""
    return _allowed or max(_ALWAYS_READ, size * _USUAL_RATIO)


def check_claims(path: object, headers: Sequence[Any], limit: float) -> None:
    """Raise PictureError for impossible windows, or ones with too many pixels.

    The data window is inside the display window, or both inside one around them. Deep
    pixels have any number of samples, which no header states: they are rejected.
    """
    claimed = 0
    for header in headers:
        if "deep" in str(header.get("type", "")):
            raise PictureError(
                f"{path} is deep; save it with flat channels of full resolution"
            )
        windows = [_window(path, header, x) for x in ("dataWindow", "displayWindow")]
        claimed += _area_around(windows) * len(header["channels"]) * _BYTES
    if claimed > limit:
        raise PictureError(
            f"{path} claims {claimed / 1e9:.1f} GB of pixels, more than a file of its "
            "size should hold; if it is sound, raise --read-limit above that"
        )


def _window(path: object, header: Any, name: str) -> list[int]:
    """Return left, top, right and bottom, exclusive."""
    (left, top), (right, bottom) = header[name]
    left, top, right, bottom = int(left), int(top), int(right) + 1, int(bottom) + 1
    width, height = right - left, bottom - top
    if not (0 < width <= _LARGEST_SIDE and 0 < height <= _LARGEST_SIDE):
        raise PictureError(f"{path} is damaged: its {name} is {width}x{height} pixels")
    return [left, top, right, bottom]


def _area_around(windows: list[list[int]]) -> int:
    lefts, tops, rights, bottoms = zip(*windows, strict=True)
    return (max(rights) - min(lefts)) * (max(bottoms) - min(tops))
