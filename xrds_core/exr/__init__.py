"""OpenEXR files in and out: passes as arrays, and whole shots.

`render_passes` finds passes by name, `openexr_io` reads and writes files, `raw_header`
bounds what a hostile one may claim. `frame_file` reads a frame of a shot, `sequence`
finishes all of them.
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
