"""OpenEXR files in and out: passes as arrays, parts, headers.

`render_passes` finds passes by name, `openexr_io` reads and writes files, `raw_header`
bounds what a hostile one may claim.
"""

from __future__ import annotations

from .openexr_io import Part, Window
from .render_passes import (
    CYCLES,
    Beauty,
    File,
    Guides,
    Names,
    attributes,
    copy_picture,
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
    "Window",
    "attributes",
    "copy_picture",
    "read_beauty",
    "read_guides",
    "write_part",
    "write_picture",
]
