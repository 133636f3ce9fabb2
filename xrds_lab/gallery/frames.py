"""What is rendered of a shot: noisy frames and references, kept in a folder."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from xrds_core.accumulation.frame import Frame
from xrds_core.arrays import LARGEST_HALF, Array
from xrds_core.errors import SceneError
from xrds_core.files import replacing

from .. import packing
from .stage import SIZE
from .table import SAMPLES, SHOTS, Shot

NOISY, REFERENCE = "noisy", "reference"
GENERATION = {NOISY: 3, REFERENCE: 1}
"""Each counts up whenever the same request is rendered otherwise."""
REACH = 4
"""Frames to each side that lend to a frame."""
REFERENCE_SAMPLES = 512
PART_SAMPLES = 256
"""References are means of parts, so that they can grow."""
_FIRST_SEED = 1_000_003  # no noisy frame has a seed near it


@dataclass(frozen=True)
class Request:
    """One rendered frame of a shot; `seed` of references alone."""

    shot: str
    kind: str
    samples: int
    number: int
    seed: int = 0
    size: tuple[int, int] = SIZE

    @property
    def file_name(self) -> str:
        """A name that depends on everything the pixels depend on."""
        import bpy

        shot, (width, height) = SHOTS[self.shot], self.size
        what = f"{self.kind}-{self.samples}spp-{self.number:02}"
        seed = f"-seed{self.seed}" if self.seed else ""
        version = bpy.app.version_string.replace(" ", "")
        made = f"v{shot.version}.{GENERATION[self.kind]}-blender{version}"
        return f"{self.shot}-{width}x{height}-{what}{seed}-{made}.npz"

    def as_dict(self) -> dict[str, Any]:
        """Plain values, to be told to another process."""
        return asdict(self) | {"size": list(self.size)}

    @classmethod
    def of(cls, values: dict[str, Any]) -> Request:
        """What `as_dict` gave."""
        return cls(**values | {"size": tuple(values["size"])})


@dataclass(frozen=True)
class Measure:
    """What of the gallery is measured, and how."""

    samples: tuple[int, ...] = SAMPLES
    reference_samples: int = REFERENCE_SAMPLES
    size: tuple[int, int] = SIZE
    middle_only: bool = False

    def judged(self, shot: Shot) -> tuple[int, ...]:
        """Numbers of the frames that are judged, the middle one first."""
        return shot.judged[:1] if self.middle_only else shot.judged

    def references(self, shot: Shot, number: int) -> tuple[list[Request], ...]:
        """The parts of the two references of a frame."""
        count = min(self.reference_samples, PART_SAMPLES)
        parts = -(-self.reference_samples // count)

        def part(which: int) -> Request:
            seed = _FIRST_SEED * (which + 1)
            return Request(shot.name, REFERENCE, count, number, seed, self.size)

        both = ([part(2 * i + which) for i in range(parts)] for which in (0, 1))
        return tuple(both)

    def rank(self, shot: Shot, request: Request) -> tuple[int, int]:
        """The order of references of all shots: parts, then frames."""
        part = (request.seed // _FIRST_SEED - 1) // 2
        return part, shot.judged.index(request.number)

    def noisy(self, shot: Shot, samples: int) -> list[Request]:
        """All noisy frames of a shot at some samples per pixel."""
        return [
            Request(shot.name, NOISY, samples, number, size=self.size)
            for number in shot.frames
        ]

    def all_of(self, shot: Shot) -> list[Request]:
        """All that a shot's figures need, the middle frame's references first."""
        wanted = [
            request
            for number in self.judged(shot)
            for parts in self.references(shot, number)
            for request in parts
        ]
        for samples in shot.counts(self.samples):
            wanted += self.noisy(shot, samples)
        return wanted


class Store:
    """Rendered frames on disk."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        directory.mkdir(parents=True, exist_ok=True)

    def has(self, request: Request) -> bool:
        """Whether it was rendered; no file is ever half there."""
        return (self.directory / request.file_name).is_file()

    def frames(self, request: Request) -> dict[str, Frame]:
        """Noisy frames by view; raises SceneError without them."""
        return packing.unpack(self._read(request))

    def reference(self, parts: Sequence[Request]) -> Array:
        """Radiance and alpha (H, W, 4) of a reference; raises SceneError without."""
        pictures = [self._read(part)["picture"].astype(np.float32) for part in parts]
        return np.asarray(np.mean(pictures, axis=0))

    def keep_frames(self, request: Request, frames: dict[str, Frame]) -> None:
        """Write noisy frames."""
        self._write(request, packing.pack(frames))

    def keep_reference(self, request: Request, picture: Array) -> None:
        """Write a reference (H, W, 4), in half floats."""
        cut = np.clip(picture, -LARGEST_HALF, LARGEST_HALF)
        self._write(request, {"picture": cut.astype(np.float16)})

    def _write(self, request: Request, arrays: dict[str, Array]) -> None:
        path = self.directory / request.file_name
        with replacing(path) as part, part.open("wb") as file:
            np.savez(file, **arrays)

    def _read(self, request: Request) -> dict[str, Array]:
        path = self.directory / request.file_name
        try:
            with np.load(path) as file:
                return dict(file)
        except (OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error) as error:
            raise SceneError(
                f"{path} cannot be read: delete it and run again"
            ) from error
