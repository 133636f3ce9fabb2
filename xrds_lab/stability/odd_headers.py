"""Attributes of every kind, with any name and any bytes, put into OpenEXR files.

The library writes few kinds, and valid ones alone.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from xrds_core.exr.raw_header import attributes_in, header_bytes

if TYPE_CHECKING:
    import random
    from pathlib import Path

_BY_SIZE = {
    1: "compression deepImageState envmap lineOrder",
    4: "float int",
    8: "double rational timecode v2f v2i",
    9: "tiledesc",
    12: "v3f v3i",
    16: "box2f box2i v2d",
    24: "v3d",
    28: "keycode",
    32: "chromaticities",
    36: "m33f",
    64: "m44f",
    72: "m33d",
    128: "m44d",
}
_SIZES = {kind: size for size, kinds in _BY_SIZE.items() for kind in kinds.split()}
_ANY_SIZE = ("string", "stringvector", "floatvector", "bytes", "preview", "chlist")
_KINDS = (*_SIZES, *_ANY_SIZE, *_ANY_SIZE, "aRendererKind", "k\xe9")
_NAMES = (
    *(
        "owner",
        "caf\xe9",
        "multiView",
        "view",
        "name",
        "cameraLabel",
        "framesPerSecond",
    ),
    *("xrds/samples", "xrds/radius", "xrds/key", "xrds.made_of", "xrds.samples"),
    *("cycles.V.samples", "worldToCamera", "n" * 31, "dwaCompressionLevel"),
    *("pixelAspectRatio", "chunkCount", "type", "timeCode", "a\nb", "wrapmodes"),
)
_TEXTS = (b"", b"4", b"\xff" * 9, b"caf\xe9", b"left\0right", b"scanlineimage", b"{}")
_LONG_NAMES = 0x400


def insert(path: Path, name: bytes, kind: bytes, value: bytes, spot: float) -> None:
    """Put an attribute before another one; `spot` from 0 to 1 says which."""
    data = path.read_bytes()
    try:
        places = [x.place for x in attributes_in(data)]
        header = header_bytes(path)
    except ValueError:  # damaged before
        return
    (flags,) = struct.unpack_from("<I", data, 4)
    place = places[int(spot * len(places))]
    table = len(header) + (2 if flags & 0x1000 else 1)
    if table + 8 > len(data):
        return
    (first,) = struct.unpack_from("<Q", data, table)
    extra = name + b"\0" + kind + b"\0" + struct.pack("<i", len(value)) + value
    offsets = data[table:first]
    count = len(offsets) // 8
    moved = (x + len(extra) for x in struct.unpack_from(f"<{count}Q", offsets))
    if len(name) > 31:
        flags |= _LONG_NAMES
    path.write_bytes(
        data[:4]
        + struct.pack("<I", flags)
        + data[8:place]
        + extra
        + data[place:table]
        + b"".join(struct.pack("<Q", min(x, 2**64 - 1)) for x in moved)
        + data[table + 8 * count :]
    )


def chance_attribute(dice: random.Random) -> tuple[bytes, bytes, bytes, float]:
    """What `insert` takes."""
    name = dice.choice(_NAMES).encode("latin-1")
    if dice.random() < 0.2:
        name = bytes(
            dice.randrange(1, 256) for _ in range(dice.choice((1, 8, 40, 255)))
        )
    kind = dice.choice(_KINDS)
    size = _SIZES.get(kind, dice.choice((0, 1, 4, 12, 100, 5000)))
    if dice.random() < 0.1:
        size = dice.choice((0, 3, 8, 100))
    value = dice.randbytes(size)
    if kind == "string" and dice.random() < 0.7:
        value = dice.choice(_TEXTS)
    if kind == "stringvector" and dice.random() < 0.7:
        texts = dice.choices(_TEXTS, k=dice.randrange(4))
        value = b"".join(struct.pack("<i", len(x)) + x for x in texts)
    return name, kind.encode("latin-1"), value, dice.random()
