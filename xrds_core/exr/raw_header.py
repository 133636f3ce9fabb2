"""The headers of an OpenEXR file, byte by byte.

The library reads texts as UTF-8, and refuses, drops or changes what it finds wrong, but
renderers and grading tools write what they like. What is of a kind that it does not
know it carries on as it is. So attributes that it would not give back get another kind,
of a name as long, in a copy that it reads, and their own again in what it has written.
"""

from __future__ import annotations

import math
import shutil
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..atomic import scratch_folder

_MAGIC = 20000630
_SEVERAL_PARTS = 0x1000
_MOST = 64 << 20  # bytes of headers
_NEEDED = frozenset(
    b"channels chunkCount compression dataWindow displayWindow lineOrder name "
    b"pixelAspectRatio screenWindowCenter screenWindowWidth tiles type version".split()
)
"""Attributes without which the library reads no file."""
_UNSAFE = frozenset(
    b"bytes chlist compression deepImageState envmap idmanifest keycode lineOrder "
    b"preview tiledesc".split()
)
"""Kinds that it refuses or changes wherever it finds a value impossible."""
_SIZES = {
    **dict.fromkeys((b"float", b"int"), 4),
    **dict.fromkeys((b"double", b"timecode", b"v2f", b"v2i"), 8),
    **dict.fromkeys((b"v3f", b"v3i"), 12),
    **dict.fromkeys((b"box2f", b"box2i", b"v2d"), 16),
    b"v3d": 24,
    b"chromaticities": 32,
    b"m33f": 36,
    b"m44f": 64,
    b"m33d": 72,
    b"m44d": 128,
}
_OF_FLOATS = (b"chromaticities", b"float", b"floatvector", b"m33f", b"m44f")


@dataclass(frozen=True)
class Attribute:
    """An attribute, and where its name begins in the file.

    `is_repeated`: an earlier one of the part has its name, which the library mixes up.
    """

    place: int
    name: bytes
    kind: bytes
    value: bytes
    is_repeated: bool = False

    @property
    def is_refused(self) -> bool:
        """Whether the library cannot read it, or would give back another."""
        if self.is_repeated or not _is_text(self.name + self.kind):
            return True
        if self.name in _NEEDED:
            return self.kind == b"string" and not _is_text(self.value)
        return not _is_carried(self.kind, self.value)

    @property
    def head(self) -> bytes:
        """Name and kind as they lie in the file."""
        return self.name + b"\0" + self.kind + b"\0"

    @property
    def veiled(self) -> bytes:
        """The same in as many bytes that the library reads, of a kind that it ignores.

        The `place` keeps apart names that are none. Written in order of names, they
        come last: of two of one name readers take the first.
        """
        name, kind = self.name, self.kind[:-1] + self.kind[-1:].swapcase()
        if self.is_repeated or not _is_text(name):
            mark = f"{self.place:x}".encode().rjust(len(name), b"\x7f")
            name = b"\x7f" + mark[len(mark) - len(name) + 1 :]
        if not _is_text(kind):
            kind = b"_" * len(kind)
        return name + b"\0" + kind + b"\0"


def header_bytes(path: str | Path) -> bytes:
    """Return the headers of a file, or its first bytes where it is damaged."""
    data = _beginning(path)
    try:
        *_, last = attributes_in(data)
    except ValueError:
        return data[:4096]
    return data[: last.place + len(last.head) + 4 + len(last.value)]


@contextmanager
def readable(path: str | Path) -> Iterator[Path]:
    """Yield a file that the library reads: the file itself but for one it refuses."""
    refused = _refused(path)
    if not refused:
        yield Path(path)
        return
    with scratch_folder() as folder:
        copy = folder / "readable.exr"
        shutil.copyfile(path, copy)
        _patch(copy, {x.place: x.veiled for x in refused})
        yield copy


def restore(source: str | Path, path: str | Path) -> None:
    """Give a file that was made of a `source` its names and kinds of attributes."""
    heads = {x.veiled: x.head for x in _refused(source)}
    if heads:
        found = attributes_in(_beginning(path))
        _patch(path, {x.place: heads[x.head] for x in found if x.head in heads})


def _refused(path: str | Path) -> list[Attribute]:
    try:
        return [x for x in attributes_in(_beginning(path)) if x.is_refused]
    except ValueError:  # damaged: the library says how
        return []


def _is_carried(kind: bytes, value: bytes) -> bool:
    """Whether the library gives back a value of a kind bit by bit."""
    if kind in _UNSAFE or len(value) != _SIZES.get(kind, len(value)):
        return False
    if kind in _OF_FLOATS and not _are_floats(value):
        return False
    check = {b"string": _is_text, b"stringvector": _are_texts, b"rational": _is_reduced}
    return kind not in check or check[kind](value)


def _are_floats(value: bytes) -> bool:
    """Whether they are some, and none is a NaN that another number format changes."""
    if not value or len(value) % 4:
        return False
    bits = np.frombuffer(value, "<u4")
    is_signal = (bits & 0x7FC00000 == 0x7F800000) & (bits & 0x3FFFFF != 0)
    return not is_signal.any()


def _are_texts(value: bytes) -> bool:
    """Whether they are texts, each behind its length, and at least one."""
    place = 0
    while place + 4 <= len(value):
        (size,) = struct.unpack_from("<i", value, place)
        text = value[place + 4 : place + 4 + max(size, 0)]
        if len(text) != size or not _is_text(text):
            return False
        place += 4 + size
    return place == len(value) > 0


def _is_reduced(value: bytes) -> bool:
    """Whether a fraction is in lowest terms, as the library writes it."""
    if len(value) != 8:
        return False
    above, below = struct.unpack("<iI", value)
    return math.gcd(above, below) == 1 and 0 < below < 1 << 31


def _is_text(value: bytes) -> bool:
    try:
        value.decode()
    except UnicodeDecodeError:
        return False
    return True


def _patch(path: str | Path, changes: dict[int, bytes]) -> None:
    with Path(path).open("r+b") as file:
        for place, value in changes.items():
            file.seek(place)
            file.write(value)


def _beginning(path: str | Path) -> bytes:
    """Return so much of a file that all its headers are in it."""
    with Path(path).open("rb") as file:
        data = file.read(1 << 16)
        while len(data) < _MOST and not _is_complete(data):
            more = file.read(len(data))
            if not more:
                break
            data += more
    return data


def _is_complete(data: bytes) -> bool:
    try:
        return all(True for _ in attributes_in(data))
    except ValueError:
        return False


def attributes_in(data: bytes) -> Iterator[Attribute]:
    """Yield the attributes of all parts; raises ValueError where headers do not end."""
    if len(data) < 8 or struct.unpack_from("<i", data)[0] != _MAGIC:
        raise ValueError("no OpenEXR file")
    has_parts = bool(struct.unpack_from("<I", data, 4)[0] & _SEVERAL_PARTS)
    place, names = 8, set[bytes]()
    while True:
        if data[place : place + 1] == b"\0":  # the end of a header, or of all
            if not names or not has_parts:
                return
            place, names = place + 1, set()
            continue
        end = data.index(b"\0", place)
        kind_end = data.index(b"\0", end + 1)
        begin = kind_end + 5
        if begin > len(data):
            raise ValueError("no size")
        (size,) = struct.unpack_from("<i", data, kind_end + 1)
        if size < 0 or begin + size > len(data):
            raise ValueError("no value")
        name, kind = data[place:end], data[end + 1 : kind_end]
        value = data[begin : begin + size]
        yield Attribute(place, name, kind, value, name in names)
        place = begin + size
        names.add(name)
