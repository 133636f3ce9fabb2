"""Files that would run code, if whoever reads them let them."""

from __future__ import annotations

import os
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np


class Trigger:
    """Makes a folder when it is unpickled: a sign that code of a file has run."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self) -> Any:
        return os.mkdir, (str(self.mark),)


def write_odd_exr(
    path: Path,
    planes: Mapping[str, Any],
    *,
    levels: int = 0,
    attributes: bytes = b"",
    display: tuple[int, int, int, int] | None = None,
    data: tuple[int, int] = (0, 0),
) -> None:
    """Write, uncompressed, what the library reads but does not write.

    Planes (H, W) of float32 or uint32, or of half of the size; `levels` 1: mip-mapped
    in one tile a level, 2: rip-mapped. `attributes` as `attribute` makes them, `data`
    the data window's corner, `display` the display window.
    """
    height, width = (max(x.shape[i] for x in planes.values()) for i in (0, 1))
    names = sorted(planes)
    sizes = {name: width // planes[name].shape[1] for name in names}
    listed = b"".join(
        name.encode()
        + struct.pack(
            "<xi4xii", 2 * (planes[name].dtype.kind == "f"), *[sizes[name]] * 2
        )
        for name in names
    )
    window = (*data, data[0] + width - 1, data[1] + height - 1)
    head = struct.pack("<II", 20000630, 2 | (0x200 if levels else 0))
    head += attribute("channels", "chlist", listed + b"\0")
    head += attribute("compression", "compression", b"\0")
    head += attribute("dataWindow", "box2i", struct.pack("<4i", *window))
    head += attribute(
        "displayWindow", "box2i", struct.pack("<4i", *(display or window))
    )
    head += attribute("lineOrder", "lineOrder", b"\0")
    head += attribute("pixelAspectRatio", "float", struct.pack("<f", 1.0))
    head += attribute("screenWindowCenter", "v2f", bytes(8))
    head += attribute("screenWindowWidth", "float", struct.pack("<f", 1.0))
    if levels:
        side = 1 << (max(width, height) - 1).bit_length()
        head += attribute("tiles", "tiledesc", struct.pack("<IIB", side, side, levels))
        chunks = _tiles(planes, names, (height, width), levels)
    else:
        chunks = _rows(planes, names, sizes, height, data[1])
    head += attributes + b"\0"
    places = np.cumsum([len(head) + 8 * len(chunks), *map(len, chunks)])[:-1]
    path.write_bytes(head + places.astype("<u8").tobytes() + b"".join(chunks))


def attribute(name: str, kind: str, value: bytes) -> bytes:
    """One attribute of a header."""
    return f"{name}\0{kind}\0".encode() + struct.pack("<i", len(value)) + value


def _rows(
    planes: Mapping[str, Any], names: list[str], sizes: Any, height: int, top: int
) -> list[bytes]:
    chunks = []
    for y in range(height):
        shown = [planes[n][y // sizes[n]].tobytes() for n in names if y % sizes[n] == 0]
        packed = b"".join(shown)
        chunks.append(struct.pack("<ii", y + top, len(packed)) + packed)
    return chunks


def _tiles(
    planes: Mapping[str, Any], names: list[str], size: tuple[int, int], levels: int
) -> list[bytes]:
    """One tile a level, each pixel the first of its block."""
    height, width = size
    down, across = (range(x.bit_length()) for x in size)
    pairs = [(i, i) for i in range(max(height, width).bit_length())]
    if levels == 2:
        pairs = [(i, j) for j in down for i in across]
    chunks = []
    for i, j in pairs:
        rows, columns = max(height >> j, 1), max(width >> i, 1)
        kept = [planes[n][:: 1 << j, :: 1 << i][:rows, :columns] for n in names]
        packed = b"".join(x[y].tobytes() for y in range(rows) for x in kept)
        chunks.append(struct.pack("<5i", 0, 0, i, j, len(packed)) + packed)
    return chunks
