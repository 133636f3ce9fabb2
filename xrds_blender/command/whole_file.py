"""Whether a picture file is whole: Blender says nothing of a disk that was full."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

from xrds_core.errors import PictureError

_SIGNATURE = b"\x89PNG\r\n\x1a\n"


def is_whole(path: Path, size: tuple[int, int]) -> bool:
    """Whether `path`, .exr or .png, holds a whole picture of `size` (width, height)."""
    size_of = png_size if path.suffix.lower() == ".png" else _exr_size
    try:
        return size_of(path) == size
    except (OSError, PictureError):
        return False


def png_size(path: Path) -> tuple[int, int] | None:
    """Width and height of a PNG; None where any of its checksums is not right."""
    data = path.read_bytes()
    at, size = len(_SIGNATURE), None
    if not data.startswith(_SIGNATURE):
        return None
    while at + 12 <= len(data):  # length, kind, content, checksum
        length, kind = struct.unpack_from(">I4s", data, at)
        content, after = at + 8, at + 8 + length
        checksum = zlib.crc32(data[at + 4 : after])
        if data[after : after + 4] != checksum.to_bytes(4, "big"):
            return None
        if kind == b"IHDR":
            size = struct.unpack_from(">II", data, content)
        if kind == b"IEND":
            return size
        at = after + 4
    return None


def _exr_size(path: Path) -> tuple[int, int]:
    from xrds_core import exr

    height, width = exr.read_beauty(path).radiance.shape[:2]
    return width, height
