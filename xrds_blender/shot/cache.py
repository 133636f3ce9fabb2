"""Samples of frames, cached in a folder, so that no frame is rendered twice.

Each frame is a file of its own, in the form that `xrds denoise` reads. Any number of
processes and machines may fill one folder, in any order.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from xrds_core.errors import PictureError
from xrds_core.files import check_folder
from xrds_core.frames import frame_numbers, frame_path
from xrds_core.sequence.reading import Reading, read_frame
from xrds_core.sequence.sample_cache import Origin, write_cached_frame
from xrds_core.temporal.frame import Frame, Stored

from ..cycles.size import picture_size
from ..planning.request import Request
from .sampling import Sampled

_FORM = 2  # counts up where samples of the same settings become others


@dataclass(frozen=True)
class SampleCache:
    """A folder of samples of one file and one set of settings.

    `say` takes a line about samples that cannot be used; `rendered` are the frames
    that were written. Of a stereo pair each view has a file of its own.
    """

    folder: Path
    origin: Origin
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
            try:
                cached = read_frame(path, number, Reading())
            except PictureError as error:
                self.say(f"frame {number} is rendered again: {error}")
                return None
            if cached.key != self.origin.key:
                self.say(
                    f"frame {number} is rendered again: {path} is of another file or "
                    "of other settings"
                )
                return None
            views[view] = _with_alpha(cached.stored)
        return Sampled(number, views, {})

    def beside(self, numbers: Sequence[int], radius: int) -> list[int]:
        """Return cached frames beyond the ends of these, near enough for them."""
        first, last = min(numbers), max(numbers)
        there = frame_numbers(self._pattern(self.views[0]))
        return [
            n for n in there if first - radius <= n < first or last < n <= last + radius
        ]

    def _path(self, number: int, view: str) -> Path:
        return frame_path(self._pattern(view), number)

    def _pattern(self, view: str) -> str:
        return str(self.folder / (f"####_{view}.exr" if view else "####.exr"))


def cache_of(
    scene: Any, request: Request, folder: Path, say: Callable[[str], object]
) -> SampleCache:
    """Make the cache of an open file's samples, and its folder.

    Raises PictureError where the folder takes no files.
    """
    check_folder(folder)
    layer = next((layer.name for layer in scene.view_layers if layer.use), "")
    views: tuple[str, ...] = ("",)
    if scene.render.use_multiview:
        views = tuple(view.name for view in scene.render.views if view.use)
    return SampleCache(
        folder,
        Origin(_key(scene, request, layer), layer, request.settings.temporal_radius),
        views,
        scene.render.film_transparent,
        say,
    )


def _key(scene: Any, request: Request, layer: str) -> str:
    """Name what decides a frame's samples: files, settings, and Blender.

    Other files than the .blend are identified by name, size and time of change.
    """
    import bpy

    digest = hashlib.blake2b(digest_size=16)
    with Path(bpy.data.filepath).open("rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    for path in sorted(bpy.utils.blend_paths(absolute=True)):
        digest.update(repr(_trace(Path(path))).encode())
    settings = (
        _FORM,
        bpy.app.version_string,
        scene.name,
        layer,
        scene.camera.name_full,
        bpy.app.autoexec_fail,  # drivers of the file did not run
        picture_size(scene.render),
        request.settings.samples or scene.cycles.samples,
        scene.cycles.seed if request.seed is None else request.seed,
        request.settings.temporal_radius,
    )
    digest.update(repr(settings).encode())
    return digest.hexdigest()


def _trace(path: Path) -> tuple[str, int, int]:
    try:
        about = path.stat()
    except OSError:
        return path.name, 0, 0
    return path.name, about.st_size, int(about.st_mtime)


def _with_alpha(stored: Stored) -> Stored:
    """Add the alpha of an opaque film to a frame that was stored without."""
    if stored.picture.shape[1] == 10:
        return stored
    opaque = np.ones((len(stored.picture), 1), stored.picture.dtype)
    return replace(stored, picture=np.hstack((stored.picture, opaque)))
