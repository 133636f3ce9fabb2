"""Which part of which frame is measured: the windows file and its scenes."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from xrds_core import exr
from xrds_core.errors import UsageError

from ..cards.cycles import CPU

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from xrds_core.arrays import Array


@dataclass(frozen=True)
class Window:
    """A rectangle of a frame, in pixels from its top-left corner."""

    frame_width: int
    frame_height: int
    x: int
    y: int
    width: int
    height: int
    floor_psnr: float | None = None

    @property
    def whole(self) -> Window:
        """The frame itself as a window."""
        size = self.frame_width, self.frame_height
        return Window(*size, 0, 0, *size)

    def around(self, width: int, height: int) -> Window:
        """A larger window with this one in its middle, as far as the frame reaches.

        Raises UsageError where it does not hold this one or the frame does not hold it.
        """
        inner, frame = (self.width, self.height), (self.frame_width, self.frame_height)
        starts = []
        for start, size, wanted, limit in zip(
            (self.x, self.y), inner, (width, height), frame, strict=True
        ):
            if not size <= wanted <= limit:
                raise UsageError(
                    f"{width}x{height} is not between the window, "
                    f"{inner[0]}x{inner[1]}, and its frame, {frame[0]}x{frame[1]}"
                )
            first = start + size // 2 - wanted // 2
            starts.append(min(max(first, 0), limit - wanted))
        return replace(self, x=starts[0], y=starts[1], width=width, height=height)

    def within(self, other: Window) -> tuple[slice, slice]:
        """Its rows and columns in a picture of another window."""
        top, left = self.y - other.y, self.x - other.x
        return slice(top, top + self.height), slice(left, left + self.width)

    @property
    def label(self) -> str:
        """Name in files: frame size, then x, y, width and height."""
        place = f"{self.x}_{self.y}_{self.width}_{self.height}"
        return f"{self.frame_width}x{self.frame_height}-{place}"

    def apply(self, scene: Any) -> None:
        """Give a Blender scene this frame size and this cropped border."""
        render = scene.render
        render.resolution_x, render.resolution_y = self.frame_width, self.frame_height
        render.resolution_percentage = 100
        bordered = (self.width, self.height) != (self.frame_width, self.frame_height)
        render.use_border = render.use_crop_to_border = bordered
        # Blender truncates; a quarter of a pixel keeps its float32 off the edge
        bottom = self.frame_height - self.y - self.height
        render.border_min_x = (self.x + 0.25) / self.frame_width
        render.border_max_x = (self.x + self.width + 0.25) / self.frame_width
        render.border_min_y = (bottom + 0.25) / self.frame_height
        render.border_max_y = (bottom + self.height + 0.25) / self.frame_height


@dataclass(frozen=True)
class Shot:
    """A scene file seen through a window, with the reference to compare with.

    Without one, a bench renders its own. Cycles renders on a `device`: the
    processor, or a kind of card as `find_card` names it. Of shots that are timed
    pictures of a `size` are rendered, width and height, and judged in the window.
    """

    path: Path
    window: Window
    reference: Path | None
    digest: str
    device: str = CPU
    size: tuple[int, int] | None = None

    @property
    def rendered(self) -> Window:
        """What is rendered of shots that are timed."""
        return self.window if self.size is None else self.window.around(*self.size)

    @property
    def name(self) -> str:
        """Name of the scene: the file's without its suffix."""
        return self.path.stem

    @property
    def identity(self) -> str:
        """Scene, frame size and card, for the names of files of seconds."""
        frame = f"{self.window.frame_width}x{self.window.frame_height}"
        card = "" if self.device == CPU else f"-{self.device.lower()}"
        return f"{self.name}-{self.digest}-{frame}{card}"


def read_windows(path: Path) -> dict[str, Window]:
    """Windows by scene name; raises UsageError when the file does not hold them."""
    try:
        entries = json.loads(path.read_text("utf-8"))
        return {
            name: Window(*entry["resolution"], *entry["window"], entry["floor_psnr"])
            for name, entry in entries.items()
        }
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise UsageError(
            f"{path} is not a windows file ({error}): it maps scene names to "
            "resolution, window and floor_psnr"
        ) from error


def find_shots(
    scenes: Sequence[Path],
    windows: Path | None,
    references: Path | None,
    resolution: tuple[int, int] | None = None,
    device: str = CPU,
) -> list[Shot]:
    """A shot of each scene file, of the whole frame without `windows`.

    `resolution` replaces the files' own. `device` is as in `Shot`. Raises UsageError
    for what is missing or contradicts.
    """
    if windows is not None and resolution is not None:
        raise UsageError(
            "windows lie in frames of their own size: give --windows or --resolution"
        )
    if references is not None and windows is None:
        raise UsageError("references show windows: give --windows with --references")
    known = {} if windows is None else read_windows(windows)
    names = [path.stem for path in scenes]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise UsageError(f"two scenes are named {twice[0]}; rename one")
    shots = []
    for path in scenes:
        if not path.is_file():
            raise UsageError(f"there is no scene {path}")
        if windows is not None and path.stem not in known:
            raise UsageError(
                f"{windows} has no window for {path.stem}; it has {', '.join(known)}"
            )
        reference = None if references is None else references / f"{path.stem}.exr"
        if reference is not None and not reference.is_file():
            raise UsageError(f"there is no reference {reference} for {path}")
        window = known.get(path.stem) or _whole(path, resolution)
        shots.append(Shot(path, window, reference, digest(path), device))
    return shots


@lru_cache(maxsize=2)
def read_reference(path: Path) -> Array:
    """The radiance (H, W, 3) of a reference's file."""
    return np.asarray(exr.read_beauty(path).radiance[..., :3])


def _whole(path: Path, resolution: tuple[int, int] | None) -> Window:
    if resolution is None:
        from xrds_blender.command.scene_file import open_scene

        render = open_scene(path).render
        share = render.resolution_percentage
        resolution = (
            render.resolution_x * share // 100,
            render.resolution_y * share // 100,
        )
    return Window(*resolution, 0, 0, *resolution)


def digest(path: Path) -> str:
    """A short checksum of a scene file, part of every cached file's name."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:12]
