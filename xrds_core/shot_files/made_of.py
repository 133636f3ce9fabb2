"""What a finished frame was made of: settings, and the files that were read for it.

A digest of both stands in each output. So it shows whether a frame that is made now
would be another one, whatever the files' times say of each other.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from .. import exr
from ..errors import PictureError
from ..exr.raw_header import header_bytes
from ..frames import frame_path

if TYPE_CHECKING:
    from pathlib import Path

    from .frame_file import Reading


MADE_OF = "xrds.made_of"
"""The attribute."""

State = tuple[tuple[str, int, int, str] | None, ...]
"""Of the files of one frame: name, size, time, and a digest of the header."""


@dataclass(frozen=True)
class Recipe:
    """What all frames are made of.

    Attributes
    ----------
    patterns : tuple of str
        Patterns of the files of a frame.
    reading : Reading
        How they are read.
    settings : tuple
        Settings that change the picture.
    """

    patterns: tuple[str, ...]
    reading: Reading
    settings: tuple[object, ...]

    def state(self, number: int) -> State:
        """Return the state of a frame's files, as they are now."""
        return tuple(
            _read_state(frame_path(pattern, number)) for pattern in self.patterns
        )

    def digest(self, states: Mapping[int, State], number: int) -> str:
        """Return a digest of what a frame is made of.

        Parameters
        ----------
        states : mapping of int to State
            States of the files of the frame and of its neighbours.
        number : int
            Frame number.

        Returns
        -------
        digest : str
        """
        cameras = self.reading.cameras or {}
        seen = {n: cameras.get(n, cameras.get(None)) for n in states}
        # the states tell which files these are
        halves = self.reading.halves and "given"
        reading = replace(self.reading, cameras=None, halves=halves, also=())
        parts = (number, sorted(states.items()), sorted(seen.items()))
        text = repr((*parts, reading, self.settings))
        return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()


def is_made_of(path: Path, digest: str) -> bool:
    """Whether a file is complete and has this digest."""
    return digest in _read_digests(path)


def is_complete(path: Path) -> bool:
    """Whether a file can be read."""
    return bool(_read_digests(path))


def _read_digests(path: Path) -> list[str | None]:
    """Return the digests of all parts; none for a file that is damaged."""
    try:
        return [attributes.get(MADE_OF) for attributes in exr.attributes(path)]
    except PictureError:
        return []


def states_of(recipe: Recipe, numbers: Iterable[int]) -> dict[int, State]:
    """The states of some frames."""
    return {n: recipe.state(n) for n in numbers}


def _read_state(path: Path) -> tuple[str, int, int, str] | None:
    try:
        status = path.stat()
        header = header_bytes(path) if path.is_file() else b""
    except OSError:
        return None
    digest = hashlib.blake2b(header, digest_size=16).hexdigest()
    return path.name, status.st_size, status.st_mtime_ns, digest
