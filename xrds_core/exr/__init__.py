"""OpenEXR files in and out: passes as arrays, parts, headers.

`pictures` names what a file holds, `library` reads and writes it, `limits` bounds what
a hostile file may claim.
"""

from __future__ import annotations

from .library import Part
from .pictures import (
    CYCLES,
    Beauty,
    File,
    Guides,
    Names,
    copy_picture,
    display_size,
    read_beauty,
    read_guides,
    write_part,
    write_picture,
)

__all__ = [
    "CYCLES",
    "Beauty",
    "File",
    "Guides",
    "Names",
    "Part",
    "copy_picture",
    "display_size",
    "read_beauty",
    "read_guides",
    "write_part",
    "write_picture",
]
