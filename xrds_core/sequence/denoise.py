"""Denoising a sequence of files whose frames share their samples."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import exr, notices
from ..errors import PictureError, UsageError
from ..files import check_folder, check_places
from ..frames import RADIUS, frame_numbers, frame_path
from ..light_parts.light import passes_of
from ..temporal.window import Shot, Window
from ..time_left import Clock
from .accumulator import Accumulator
from .finishing import AROUND, Finished, finish_frame
from .loading import Loader
from .neighbour_frames import NeighbourSelection
from .reading import FrameFile, Reading

if TYPE_CHECKING:
    from ..arrays import Array
    from ..denoising import Denoiser
    from ..exr import Window as PixelWindow
    from .rectangles import Rectangle

Say = Callable[[str], object]


@dataclass(frozen=True)
class Files:
    """Inputs and outputs; # stands for digits of the frame number.

    `picture_only`: the output gets R, G, B and A alone; otherwise all other channels of
    the input as well, unchanged. `others` are files that are read besides the frames,
    `halves` is the pattern of their second half buffers, `also` those of further files
    of each frame. `crop` is the part of the picture that is denoised and written, first
    and last pixel in the coordinates of the files.
    """

    source: str
    output: str
    picture_only: bool = False
    others: tuple[Path, ...] = ()
    halves: str | None = None
    also: tuple[str, ...] = ()
    crop: PixelWindow | None = None

    def write(self, number: int, frame: FrameFile, finished: Finished) -> Path:
        """Write a finished frame, or none of it; raises PictureError."""
        names = list("RGBA") if self.picture_only else frame.channels
        planes = dict(zip(names, np.moveaxis(finished.picture, 2, 0), strict=False))
        by_part: dict[int, dict[str, Array]] = {frame.part: planes}
        if not self.picture_only:
            for name, plane in _light(frame, finished).items():
                part, own = frame.places[name]
                by_part.setdefault(part, {})[own] = plane
        path = frame_path(self.output, number)
        source = frame_path(self.source, number)
        exr.copy_picture(
            source, path, by_part, alone=self.picture_only, window=self.crop
        )
        return path

    def is_done(self, number: int, neighbours: Iterable[int] = ()) -> bool:
        """Whether a complete output of the input's size exists, newer than all inputs.

        So a frame counts as missing if the samples of one of its `neighbours` came
        later.
        """
        source, output = (frame_path(x, number) for x in (self.source, self.output))
        inputs = [
            frame_path(pattern, n)
            for pattern in (self.source, *self.also)
            for n in (number, *neighbours)
        ]
        times = [path.stat().st_mtime_ns for path in inputs if path.is_file()]
        if not output.is_file() or output.stat().st_mtime_ns < max(times, default=0):
            return False
        try:
            display, areas = exr.windows(output, whole=True)
            if not source.is_file():
                return True
            whole, there = exr.windows(source)
            return display == whole and areas <= ({self.crop} if self.crop else there)
        except PictureError:
            return False

    def check(self, numbers: Sequence[int], there: Sequence[int]) -> None:
        """Reject impossible outputs; make their folder.

        `there` are all frames that have a file: none may be overwritten.
        """
        if Path(self.output).suffix.lower() != ".exr":
            raise UsageError(f"output {self.output!r} must end in .exr")
        if len(numbers) > 1 and "#" not in Path(self.output).name:
            raise UsageError(
                f"all {len(numbers)} frames would be written to {self.output!r}; add "
                "#### for the frame number"
            )
        patterns = [self.source, *self.also]
        patterns += [] if self.halves is None else [self.halves]
        inputs = [frame_path(pattern, n) for pattern in patterns for n in there]
        known = set(there)
        outputs = (frame_path(self.output, n) for n in numbers if n in known)
        check_places(outputs, [*inputs, *self.others])
        check_folder(Path(self.output).parent)


def denoise_sequence(
    files: Files,
    denoiser: Denoiser,
    *,
    frames: Iterable[int] | None = None,
    radius: int | None = None,
    reading: Reading | None = None,
    accumulate: Accumulator | None = None,
    resume: bool = False,
    say: Say = lambda _: None,
) -> dict[str, Any]:
    """Denoise the frames of a sequence, each with its neighbours' samples, in order.

    Args:
        files: inputs and outputs.
        frames: their numbers; by default all that exist. Samples of other existing
            frames, between these or next to them, are reused, too.
        radius: how many frames before and after are neighbours; by default what the
            files recommend, or 4.
        accumulate: by default on a graphics card where there is one.
        resume: skip outputs that are complete, of the right size, and newer than all
            inputs whose samples they reuse.
        say: takes a line about a frame that is finished, left out, or not reusable.

    Returns:
        What `xrds denoise --json` prints; `left_out` says why frames were not read.

    Raises:
        UsageError: no frames, or impossible outputs.
        PictureError: no frame can be read, the first lacks passes, or an output cannot
            be written; outputs before it are complete.
    """
    numbers = sorted(set(frames)) if frames else _all_frames(files.source)
    there = _there(files.source, numbers)
    files.check(numbers, there)
    radius = radius if "#" in Path(files.source).name else radius or 0  # or one frame
    loader = Loader(files.source, reading or Reading(), reusable=radius != 0, say=say)
    loader.look(numbers, set(there))
    readable = [n for n in numbers if n not in loader.failed]
    first = loader.first(readable)
    if radius is None:
        radius = RADIUS if first is None or first.radius is None else first.radius
    beside = (*numbers, *there)
    shot = Shot((), radius, others=beside)
    written = set(_there(files.output, numbers) if resume else ())
    done = {n for n in numbers if n in written and files.is_done(n, shot.neighbours(n))}
    if first is None and not done:
        raise PictureError(f"no frame can be read: {loader.failed[numbers[0]]}")
    shot = Shot(tuple(n for n in readable if n not in done), radius, others=beside)
    accumulate = accumulate or Accumulator()
    entries = list(_entries(files, denoiser, accumulate, shot, loader, resume, say))
    devices = {"device": denoiser.device, "accumulated_on": accumulate.device}
    return {
        "output": files.output,
        "temporal_radius": radius,
        **devices,
        "frames": entries,
        "kept": sorted(done),
        "left_out": _left_out(loader, [n for n in numbers if n not in done]),
    }


def _entries(
    files: Files,
    denoiser: Denoiser,
    accumulate: Accumulator,
    shot: Shot,
    loader: Loader,
    resume: bool,
    say: Say,
) -> Iterator[dict[str, Any]]:
    """Finish and write the frames of a shot; yields the record of each.

    A frame that cannot be finished or written is left out; two of them in a row are an
    error.
    """
    selection, fails = NeighbourSelection(say), False
    clock = Clock()
    for found in Window(shot, loader.load):
        number, own = found.number, found.own
        # another machine may have finished it
        if resume and files.is_done(number, shot.neighbours(number)):
            continue
        others = selection.select(number, own, found.neighbours)
        try:
            region, within = _regions(own, files.crop)
            finished = finish_frame(
                own.stored, others, denoiser, accumulate, region=region, light=own.light
            )
            started = time.perf_counter()
            path = files.write(number, own, finished.within(within))
            fails = False
        except PictureError as error:
            if fails:
                raise
            fails = True
            loader.leave_out(number, error)
            continue
        selection.record(others, finished.accumulated)
        seconds = {"read": loader.seconds(), **finished.seconds}
        seconds["write"] = time.perf_counter() - started
        left = sum(n > number and n not in loader.failed for n in shot.frames)
        say(f"frame {number}: {path}, {clock.lap(left)}")
        entry = _entry(number, path, shot.radius, finished, seconds)
        notices.finished.append(entry)
        yield entry
    selection.report()


def _regions(own: FrameFile, crop: PixelWindow | None) -> tuple[Rectangle, Rectangle]:
    """What to denoise of a frame's arrays, and which part of that to write.

    A crop is denoised with what a denoiser sees around it. Raises PictureError where
    the frame does not cover it.
    """
    if crop is None:
        return own.inner, (slice(None), slice(None))
    region, within = [], []
    for axis, inner in ((1, own.inner[0]), (0, own.inner[1])):
        first, last = (corner[axis] for corner in crop)
        begin, end = (corner[axis] for corner in own.data_window)
        if first < begin or last > end:
            raise PictureError("the crop lies outside of what the file holds")
        around = max(first - AROUND, begin), min(last + AROUND, end)
        offset = inner.start - begin
        region.append(slice(around[0] + offset, around[1] + offset + 1))
        within.append(slice(first - around[0], last - around[0] + 1))
    return (region[0], region[1]), (within[0], within[1])


def _light(frame: FrameFile, finished: Finished) -> dict[str, Array]:
    """The planes of the parts of a frame's light, by full channel name."""
    passes = passes_of(frame.light, finished.parts)
    return {
        name: plane
        for names, pixels in passes.items()
        for name, plane in zip(names, np.moveaxis(pixels, 2, 0), strict=True)
    }


def _left_out(loader: Loader, todo: Sequence[int]) -> list[dict[str, Any]]:
    failed = {n: loader.failed[n] for n in todo if n in loader.failed}
    return [{"frame": n, "reason": why} for n, why in failed.items()]


def _all_frames(pattern: str) -> list[int]:
    if "#" not in Path(pattern).name:
        return [0]
    numbers = frame_numbers(pattern)
    if not numbers:
        raise PictureError(f"no file is called {pattern}; # are digits of its number")
    return numbers


def _there(pattern: str, numbers: Sequence[int]) -> Sequence[int]:
    """The frames that have a file; without # there is one for every number."""
    if "#" in Path(pattern).name:
        return frame_numbers(pattern)
    return numbers if os.path.lexists(pattern) else []


def _entry(
    number: int, path: Path, radius: int, finished: Finished, seconds: dict[str, float]
) -> dict[str, Any]:
    accumulated = finished.accumulated
    return {
        "frame": number,
        "output": str(path),
        "seconds": seconds | {"total": sum(seconds.values())},
        "temporal": {
            "radius": radius,
            "frames": accumulated.frames,
            "mean_samples": float(accumulated.samples.mean()),
            "rejected": accumulated.rejected,
        },
        "bad_pixels": finished.denoised.bad_pixels,
    }
