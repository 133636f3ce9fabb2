"""OpenEXR files in and out: passes as arrays, parts, headers.

`render_passes` finds passes by name, `openexr_io` reads and writes files, `limits`
bounds what the header of a hostile file may claim.
"""

from __future__ import annotations

from .openexr_io import Part
from .render_passes import (
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
