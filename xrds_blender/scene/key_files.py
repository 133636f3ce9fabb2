"""Which pixels an image or a file on disk holds, without reading more than needed."""

from __future__ import annotations

import hashlib
import os
import re
from pathlib import Path
from typing import Any

import numpy as np


def image_digest(image: Any) -> tuple[Any, ...]:
    """What identifies an image's pixels."""
    image = image.original or image
    if image.is_dirty or image.source == "VIEWER":
        return "painted", _pixels(image)
    if image.packed_files:
        packed = [each.packed_file for each in image.packed_files]
        return "packed", *(_hash(each.data) for each in packed if each)
    if image.source == "GENERATED":
        return ("generated",)  # its settings, hashed elsewhere, decide
    return file_digest(image.filepath, image.library, image.source == "SEQUENCE")


def file_digest(
    path: str, library: Any = None, is_sequence: bool = False
) -> tuple[Any, ...]:
    """Name, size and times of a file, or of all tiles and frames of one."""
    import bpy

    where = Path(bpy.path.abspath(path, library=library))
    return tuple(_stat(file) for file in files_of(where, is_sequence))


def files_of(where: Path, is_sequence: bool = False) -> list[Path]:
    """The file at a path, there or not, or all tiles and frames of one."""
    pattern = re.escape(where.name)
    for word in ("<UDIM>", "<UVTILE>"):
        pattern = pattern.replace(re.escape(word), ".*")
    if is_sequence:
        # The last number of the name, whatever its digits, counts the frames.
        pattern = re.sub(r"\d+(?=\D*$)", r"\\d+", pattern)
    if pattern == re.escape(where.name):
        return [where]
    try:
        files = [x for x in where.parent.iterdir() if re.fullmatch(pattern, x.name)]
    except OSError:
        return [where]
    return sorted(files) or [where]


_ENDS = 1 << 16  # bytes


def trace(file: Path) -> tuple[str, int, int, str]:
    """Name, size and time of a file on any machine, and what it begins and ends with.

    Copies keep times in whole seconds, on some disks.
    """
    try:
        with file.open("rb") as opened:
            about = os.fstat(opened.fileno())
            ends = opened.read(_ENDS)
            opened.seek(max(about.st_size - _ENDS, 0))
            ends += opened.read(_ENDS)
    except OSError:
        return file.name, -1, -1, ""
    return file.name, about.st_size, int(about.st_mtime), _hash(ends)


def _stat(file: Path) -> tuple[str, int, int, int]:
    """Beside the time of writing, which can be set, that of the last change."""
    try:
        status = file.stat()
    except (OSError, ValueError):
        return str(file), -1, -1, -1
    return str(file), status.st_size, status.st_mtime_ns, status.st_ctime_ns


def _pixels(image: Any) -> str:
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    return _hash(pixels.data)


def _hash(data: Any) -> str:
    return hashlib.blake2b(data, digest_size=20).hexdigest()
