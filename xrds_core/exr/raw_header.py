"""The headers of an OpenEXR file, byte by byte, and limits on what they may claim."""

from __future__ import annotations

import math
import shutil
import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import PictureError
from ..files import scratch_folder

_LARGEST_SIDE = 1 << 16  # pixels; more is a damaged header
_ALWAYS_READ = 1 << 30  # bytes of pixels
_USUAL_RATIO = 1000  # of pixels to file; ZIP, the default, packs no picture smaller
_ALWAYS_PADDED = 4096 * 2304  # pixels, of a 4K picture
_USUAL_PADDING = 16  # times the pixels that a crop holds
_BYTES = 4  # of a number; the header as read does not say half or float

_allowed = 0


def allow(size: int | None) -> None:
    """Let this process read `size` bytes of pixels; None for the default limit."""
    global _allowed
    _allowed = size or 0


def is_mostly_empty(pixels: int, whole: int) -> bool:
    """Whether a large window holds so few pixels of a file that it may be a mistake."""
    return not _allowed and whole > _ALWAYS_PADDED and whole > _USUAL_PADDING * pixels


def limit_of(size: int) -> int:
    """Return the bytes of pixels that may be read from a file of `size` bytes."""
    return _allowed or max(_ALWAYS_READ, size * _USUAL_RATIO)


def check_claims(path: object, headers: Sequence[Any], limit: float) -> None:
    """Check what headers claim before memory is allocated for it.

    The data window may lie inside the display window, or both inside one around them.
    Deep pixels have any number of samples, which no header states: they are rejected.

    Parameters
    ----------
    path : object
        The file, for error messages.
    headers : sequence of mapping
        Headers of its parts.
    limit : float
        Most bytes of pixels.

    Raises
    ------
    PictureError
        For impossible windows, more pixels than the limit, or deep pixels.
    """
    claimed = 0
    for header in headers:
        if "deep" in str(header.get("type", "")):
            raise PictureError(
                f"{path} is deep; save it with flat channels of full resolution"
            )
        windows = [
            _check_window(path, header, window)
            for window in ("dataWindow", "displayWindow")
        ]
        claimed += _area_around(windows) * len(header["channels"]) * _BYTES
    if claimed > limit:
        raise PictureError(
            f"{path} claims {claimed / 1e9:.1f} GB of pixels, more than a file of its "
            "size should hold; if it is sound, raise --read-limit above that"
        )


def _check_window(path: object, header: Any, name: str) -> list[int]:
    """Return left, top, right and bottom, exclusive."""
    (left, top), (right, bottom) = header[name]
    left, top, right, bottom = int(left), int(top), int(right) + 1, int(bottom) + 1
    width, height = right - left, bottom - top
    if not (0 < width <= _LARGEST_SIDE and 0 < height <= _LARGEST_SIDE):
        raise PictureError(f"{path} is damaged: its {name} is {width}x{height} pixels")
    return [left, top, right, bottom]


def _area_around(windows: list[list[int]]) -> int:
    lefts, tops, rights, bottoms = zip(*windows, strict=True)
    return (max(rights) - min(lefts)) * (max(bottoms) - min(tops))


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
    data = _read_beginning(path)
    try:
        *_, last = attributes_in(data)
    except ValueError:
        return data[:4096]
    return data[: last.place + len(last.head) + 4 + len(last.value)]


@contextmanager
def readable(path: str | Path) -> Iterator[Path]:
    """Yield a file that the library reads: the file itself but for one it refuses."""
    refused = _find_refused(path)
    if not refused:
        yield Path(path)
        return
    with scratch_folder() as folder:
        copy = folder / "readable.exr"
        shutil.copyfile(path, copy)
        _patch(copy, {attribute.place: attribute.veiled for attribute in refused})
        yield copy


def restore(source: str | Path, path: str | Path) -> None:
    """Give a file that was made of a `source` its names and kinds of attributes."""
    heads = {attribute.veiled: attribute.head for attribute in _find_refused(source)}
    if heads:
        attributes = attributes_in(_read_beginning(path))
        _patch(
            path,
            {
                attribute.place: heads[attribute.head]
                for attribute in attributes
                if attribute.head in heads
            },
        )


def _find_refused(path: str | Path) -> list[Attribute]:
    try:
        return [
            attribute
            for attribute in attributes_in(_read_beginning(path))
            if attribute.is_refused
        ]
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
    """Whether bytes are floats, without a NaN that conversion would change."""
    if not value or len(value) % 4:
        return False
    bits = np.frombuffer(value, "<u4")
    is_signal = (bits & 0x7FC00000 == 0x7F800000) & (bits & 0x3FFFFF != 0)
    return not is_signal.any()


def _are_texts(value: bytes) -> bool:
    """Whether bytes are texts, each behind its length, and at least one."""
    place = 0
    while place + 4 <= len(value):
        (size,) = struct.unpack_from("<i", value, place)
        text = value[place + 4 : place + 4 + max(size, 0)]
        if len(text) != size or not _is_text(text):
            return False
        place += 4 + size
    return place == len(value) > 0


def _is_reduced(value: bytes) -> bool:
    """Whether a fraction is in lowest terms, which is how the library writes it."""
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


def _read_beginning(path: str | Path) -> bytes:
    """Read the beginning of a file, up to the end of its headers."""
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
