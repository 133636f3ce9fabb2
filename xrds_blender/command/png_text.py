"""Text in PNG files: chunks `tEXt`, as Blender writes them, `iTXt` beyond Latin-1."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from pathlib import Path

_SIGNATURE, _HEADER = 8, 25  # bytes: of the file, and of its first chunk, IHDR
_LONGEST = 79  # letters of a name


def add(path: Path, texts: Mapping[str, str]) -> None:
    """Put texts by name into a PNG that is whole; longer names are cut."""
    data = path.read_bytes()
    at = _SIGNATURE + _HEADER
    chunks = b"".join(_chunk(name[:_LONGEST], text) for name, text in texts.items())
    path.write_bytes(data[:at] + chunks + data[at:])


def _chunk(name: str, text: str) -> bytes:
    keyword = name.encode("latin-1", "replace")
    try:
        content = b"tEXt" + keyword + b"\0" + text.encode("latin-1")
    except UnicodeEncodeError:  # no compression, no language, no translated name
        content = b"iTXt" + keyword + b"\0\0\0\0\0" + text.encode()
    length = struct.pack(">I", len(content) - 4)
    return length + content + struct.pack(">I", zlib.crc32(content))
