"""Samples of frames, cached in a folder, so that no frame is rendered twice.

Each frame is a file of its own, in the form that `xrds denoise` reads. Any number of
processes and machines may fill one folder, in any order.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from xrds_core.accumulation.frame import Frame, Stored
from xrds_core.errors import PictureError
from xrds_core.files import check_folder
from xrds_core.frames import frame_numbers, frame_path
from xrds_core.shot import place_of, step_of
from xrds_core.shot_files.frame_file import FrameFile, Reading, read_frame
from xrds_core.shot_files.sample_cache import Origin, write_cached_frame

from ..planning.request import Request
from ..scene.outer_files import outer_files, trace
from .sampling import Sampled, subset_at

_FORM = 4  # counts up where samples of the same settings become others


@dataclass(frozen=True)
class SampleCache:
    """A folder of samples of one file and one set of settings.

    `numbers` are the frames that are rendered: how far they lie apart decides what
    frames under a still camera take of the sequence that they share. `say` takes a line
    about samples that cannot be used; `rendered` are the frames that were written. Of a
    stereo pair each view has a file of its own.
    """

    folder: Path
    origin: Origin
    numbers: Sequence[int]
    views: tuple[str, ...]
    transparent: bool
    say: Callable[[str], object]
    rendered: set[int] = field(default_factory=set)

    def report(self, numbers: Sequence[int]) -> dict[str, Any]:
        """Say of frames which were rendered and which were there, for `--json`."""
        return {
            "folder": str(self.folder),
            "rendered": [n for n in numbers if n in self.rendered],
            "read": [n for n in numbers if n not in self.rendered],
        }

    def write(self, frames: Mapping[str, Frame]) -> None:
        """Write a frame's views; raises PictureError where that fails."""
        for view, frame in frames.items():
            # an opaque film's alpha says nothing, and would be another channel
            stored = frame if self.transparent else replace(frame, alpha=None)
            write_cached_frame(self._path(frame.number, view), stored, self.origin)
            self.rendered.add(frame.number)

    def read(self, number: int) -> Sampled | None:
        """Return a frame that is there whole and of these settings; else None."""
        views = {}
        for view in self.views:
            path = self._path(number, view)
            if not path.is_file():
                return None
            outcome = "rendered again" if number in self.numbers else "not reused"
            try:
                cached = read_frame(path, number, Reading())
            except PictureError as error:
                self.say(f"frame {number} is {outcome}: {error}")
                return None
            if why := self._difference(number, cached):
                self.say(f"frame {number} is {outcome}: {path} is of {why}")
                return None
            views[view] = _with_alpha(cached.stored)
        return Sampled(number, views, {})

    def beside(self, numbers: Sequence[int], radius: int) -> list[int]:
        """Return cached frames beyond the ends of these, near enough for them."""
        first, last = min(numbers), max(numbers)
        step = step_of(numbers) or 1
        there = frame_numbers(self._pattern(self.views[0]))
        reach = radius * step
        return [
            n
            for n in there
            if (first - reach <= n < first or last < n <= last + reach)
            and (n - first) % step == 0
        ]

    def _difference(self, number: int, cached: FrameFile) -> str:
        """What a stored frame is of that this one is not; "" if it is the same."""
        if cached.key != self.origin.key:
            return "another file or of other settings"
        if cached.subset is None:  # a sequence of its own
            return ""
        if number in self.numbers or step_of(self.numbers):
            place = place_of(number, self.numbers)
            if cached.subset == subset_at(place, self.origin.radius):
                return ""
        return "a shot in other steps"

    def _path(self, number: int, view: str) -> Path:
        return frame_path(self._pattern(view), number)

    def _pattern(self, view: str) -> str:
        return str(self.folder / (f"####_{view}.exr" if view else "####.exr"))


def cache_of(
    scene: Any,
    request: Request,
    folder: Path,
    numbers: Sequence[int],
    choice: object,
    say: Callable[[str], object],
) -> SampleCache:
    """Make the cache of an open file's samples, and its folder.

    `choice` is what came in the place of what the file holds. Raises PictureError where
    the folder takes no files.
    """
    check_folder(folder)
    layer = next((layer.name for layer in scene.view_layers if layer.use), "")
    views: tuple[str, ...] = ("",)
    if scene.render.use_multiview:
        views = tuple(view.name for view in scene.render.views if view.use)
    return SampleCache(
        folder,
        Origin(_key(request, choice), layer, request.settings.temporal_radius),
        numbers,
        views,
        scene.render.film_transparent,
        say,
    )


def _key(request: Request, choice: object) -> str:
    """Name what decides samples: all files that are read, what was asked, Blender.

    Other files than the .blend are identified by name, size, time of change, and by
    what they begin and end with.
    """
    import bpy

    digest = hashlib.blake2b(digest_size=16)
    with Path(bpy.data.filepath).open("rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    outer = [path for outer in outer_files() for path in outer.files]
    if colours := os.environ.get("OCIO", ""):  # textures are read by it
        outer.append(Path(colours))
    for path in dict.fromkeys(outer):
        digest.update(repr(trace(path)).encode())
    settings = (
        _FORM,
        bpy.app.version_string,
        bpy.app.autoexec_fail,  # drivers of the file did not run
        choice,
        request.settings.samples,
        request.settings.temporal_radius,
        request.seed,
    )
    digest.update(repr(settings).encode())
    return digest.hexdigest()


def _with_alpha(stored: Stored) -> Stored:
    """Add the alpha of an opaque film to a frame that was stored without."""
    if stored.picture.shape[1] == 10:
        return stored
    opaque = np.ones((len(stored.picture), 1), stored.picture.dtype)
    return replace(stored, picture=np.hstack((stored.picture, opaque)))
