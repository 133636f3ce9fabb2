"""Readers of the values that the commands' options take.

Each raises ArgumentTypeError or ValueError for text that it cannot read, of which
argparse then makes a line of wrong usage.
"""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Callable, Sequence
from pathlib import Path

LARGEST_NUMBER = 2**31 - 1  # Blender and the libraries count in 32 bits
LAST_FRAME = 1048574  # Blender's MAXFRAME
SMALLEST_SIDE, LARGEST_SIDE = 4, 65536  # pixels; Blender takes the nearest of these


def positive(text: str) -> int:
    """A whole number above 0."""
    return _within(int(text), 1)


def whole(text: str) -> int:
    """A whole number, 0 or above."""
    return _within(int(text), 0)


def _within(value: int, least: int) -> int:
    if not least <= value <= LARGEST_NUMBER:
        raise argparse.ArgumentTypeError(
            f"{value} must be from {least} to {LARGEST_NUMBER}"
        )
    return value


def factor(text: str) -> float:
    """A number above 0."""
    value = float(text)
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} must be a number above 0")
    return value


def share(text: str) -> float:
    """A number from 0 to 1."""
    value = float(text)
    if not 0.0 <= value <= 1.0:
        raise argparse.ArgumentTypeError(f"{text} must be from 0 to 1")
    return value


def seconds(text: str) -> float:
    """A time above 0, such as 8h, 1h30m, 90m or 45s; a number alone is of seconds."""
    number = r"(\d+(?:\.\d+)?)"
    parts = re.fullmatch(f"(?:{number}h)?(?:{number}m)?(?:{number}s?)?", text.lower())
    units = (3600.0, 60.0, 1.0)
    amounts = parts.groups() if parts else ()
    value = sum(
        float(part or 0) * unit for part, unit in zip(amounts, units, strict=False)
    )
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text!r} is not a time such as 8h or 1h30m")
    return value


def pair(text: str) -> tuple[float, float]:
    """Two numbers, such as 1,-1."""
    first, second = (float(part) for part in text.split(","))
    if not (math.isfinite(first) and math.isfinite(second)):
        raise argparse.ArgumentTypeError(f"{text} must be two numbers")
    return first, second


def factors(text: str) -> tuple[float, ...]:
    """Numbers above 0, such as 0.5,2."""
    return tuple(factor(part) for part in text.split(","))


def integers(text: str) -> tuple[int, ...]:
    """Whole numbers, such as 2,4."""
    return tuple(int(part) for part in text.split(","))


def words(text: str) -> tuple[str, ...]:
    """Any words, such as bmw27,house."""
    return tuple(text.split(","))


def names(known: Sequence[str]) -> Callable[[str], tuple[str, ...]]:
    """Make the reader of names out of `known`, such as fast,balanced."""

    def read(text: str) -> tuple[str, ...]:
        chosen = tuple(text.split(","))
        for name in chosen:
            if name not in known:
                raise argparse.ArgumentTypeError(
                    f"{name!r} is not one of {', '.join(known)}"
                )
        return chosen

    return read


def frame(text: str) -> list[int]:
    """One frame number, as a list."""
    return [_frame_number(text)]


def frames(text: str) -> list[int]:
    """Frame numbers, such as 1-24, 1-100x4 (every fourth) or 1-24,30; each once.

    1-100:4, as farms write it, is 1-100x4.
    """
    numbers: dict[int, None] = {}
    for part in text.split(","):
        match = re.fullmatch(r"(-?\d+)(?:-(-?\d+)(?:[x:](\d+))?)?", part)
        if not match:
            raise argparse.ArgumentTypeError(
                f"{text!r} is not frames such as 1-24, 1-100x4 or 1-24,30"
            )
        first = _frame_number(match[1])
        last, step = _frame_number(match[2] or match[1]), int(match[3] or 1)
        if last < first or step < 1:
            raise argparse.ArgumentTypeError(f"{part!r} holds no frame")
        numbers |= dict.fromkeys(range(first, last + 1, step))
    return list(numbers)


def _frame_number(text: str) -> int:
    number = int(text)
    if abs(number) > LAST_FRAME:
        raise argparse.ArgumentTypeError(
            f"frame {number} is beyond Blender's last, {LAST_FRAME}"
        )
    return number


def size(text: str) -> tuple[int, int]:
    """Width and height in pixels, such as 1920x1080."""
    match = re.fullmatch(r"(\d+)x(\d+)", text)
    if not match:
        raise argparse.ArgumentTypeError(f"{text!r} is not a size such as 1920x1080")
    width, height = int(match[1]), int(match[2])
    if not all(SMALLEST_SIDE <= x <= LARGEST_SIDE for x in (width, height)):
        raise argparse.ArgumentTypeError(
            f"{text} is not a size that Blender takes: each side has {SMALLEST_SIDE} "
            f"to {LARGEST_SIDE} pixels"
        )
    return width, height


def crop(text: str) -> tuple[tuple[int, int], tuple[int, int]]:
    """A part of a picture, such as 640x360+100+50: first and last pixel."""
    match = re.fullmatch(r"(\d{1,6})x(\d{1,6})([+-]\d{1,6})([+-]\d{1,6})", text)
    if not match or not int(match[1]) or not int(match[2]):
        raise argparse.ArgumentTypeError(
            f"{text!r} is not a part of a picture such as 640x360+100+50: width, "
            "height, and how far it is from the left and from the top"
        )
    width, height, left, top = (int(x) for x in match.groups())
    return (left, top), (left + width - 1, top + height - 1)


def sizes(text: str) -> tuple[tuple[int, int], ...]:
    """Sizes, such as 960x540,1920x1080."""
    return tuple(size(part) for part in text.split(","))


def folder(text: str) -> Path:
    """A folder, there or to be made."""
    try:
        is_file = Path(text).is_file()
    except OSError as error:
        raise argparse.ArgumentTypeError(f"{text}: {error.strerror}") from error
    if is_file:
        raise argparse.ArgumentTypeError(f"{text} is a file; name a folder")
    return Path(text)


def size_in_bytes(text: str) -> int:
    """Bytes, such as 500M or 4G."""
    match = re.fullmatch(r"(\d+)([KMG]?)", text.upper())
    if not match:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not an amount such as 500M or 4G"
        )
    size = int(match[1]) << {"": 0, "K": 10, "M": 20, "G": 30}[match[2]]
    if not 0 < size < 2**63:
        raise argparse.ArgumentTypeError(f"{text} is no amount that memory can have")
    return size
