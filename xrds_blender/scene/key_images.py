"""Which pixels an image or a file on disk holds, without reading more than needed."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np


def image_digest(image: Any) -> tuple[Any, ...]:
    """What tells an image's pixels apart from all it could hold otherwise."""
    image = image.original or image
    if image.is_dirty or image.source == "VIEWER":
        return "painted", _pixels(image)
    if image.packed_files:
        packed = [each.packed_file for each in image.packed_files]
        return "packed", *(_hash(each.data) for each in packed if each)
    if image.source == "GENERATED":
        return ("generated",)  # its settings, hashed elsewhere, decide
    return file_digest(image.filepath, image.library)


def file_digest(path: str, library: Any = None) -> tuple[Any, ...]:
    """Name, size and time of a file, or of all tiles and frames of one."""
    import bpy

    where = Path(bpy.path.abspath(path, library=library))
    pattern = where.name.replace("<UDIM>", "*").replace("<UVTILE>", "*")
    files = sorted(where.parent.glob(pattern)) if "*" in pattern else [where]
    return tuple(_stat(file) for file in files)


def _stat(file: Path) -> tuple[str, int, int]:
    try:
        status = file.stat()
    except OSError:
        return str(file), -1, -1
    return str(file), status.st_size, status.st_mtime_ns


def _pixels(image: Any) -> str:
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    return _hash(pixels.data)


def _hash(data: Any) -> str:
    return hashlib.blake2b(data, digest_size=20).hexdigest()
