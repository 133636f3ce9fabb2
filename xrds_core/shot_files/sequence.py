"""Denoising a sequence of files whose frames share their samples."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import errors, exr
from ..accumulation.object_motion import Movement
from ..denoising.light_passes import passes_of
from ..errors import PictureError, UsageError
from ..files import check_folder, check_places
from ..finish import AROUND, Finished, finish_frame
from ..frame_source import FrameSource, Neighbourhood, finish_frames
from ..frames import (
    RADIUS,
    check_pattern,
    frame_numbers,
    frame_path,
    in_words,
    misnamed,
)
from ..progress import Callback, Clock, Progress
from ..shot import Shot
from ..version import package_version
from .frame_file import FrameFile, Reading
from .loading import Loader, NeighbourSelection
from .made_of import MADE_OF, Recipe, is_complete, is_made_of, states_of

if TYPE_CHECKING:
    from ..arrays import Array
    from ..denoising import Denoiser
    from ..exr import Window as PixelWindow
    from ..finish import Rectangle


Say = Callable[[str], object]


@dataclass(frozen=True)
class Files:
    """Inputs and outputs of a sequence; # stands for digits of the frame number.

    Attributes
    ----------
    source, output : str
        Patterns of the frames' files and of the finished ones.
    picture_only : bool
        Whether the output gets R, G, B and A alone; otherwise all other channels of the
        input as well, unchanged.
    others : tuple of Path
        Files that are read besides the frames.
    halves : str or None
        Pattern of the second half buffers.
    also : tuple of str
        Patterns of further files of each frame.
    crop : Window or None
        The part of the picture to denoise and write: first and last pixel in the
        coordinates of the files.
    """

    source: str
    output: str
    picture_only: bool = False
    others: tuple[Path, ...] = ()
    halves: str | None = None
    also: tuple[str, ...] = ()
    crop: PixelWindow | None = None

    @property
    def patterns(self) -> tuple[str, ...]:
        """Those of all files of a frame."""
        return (
            self.source,
            *self.also,
            *([] if self.halves is None else [self.halves]),
        )

    def write(
        self,
        number: int,
        views: Mapping[str, tuple[FrameFile, Finished]],
        metadata: Mapping[str, str],
        check: Callable[[], None] = lambda: None,
    ) -> Path:
        """Write the finished views of a frame, or none.

        Parameters
        ----------
        number : int
            Frame number.
        views : mapping of str to (FrameFile, Finished)
            The views as read and as finished, by name.
        metadata : mapping of str to str
            Attributes of the header.
        check : callable
            Raises PictureError if nothing is to be written.

        Returns
        -------
        path : Path
            The file.

        Raises
        ------
        PictureError
            If the file cannot be written.
        """
        by_part: dict[int, dict[str, Array]] = {}
        first, _ = next(iter(views.values()))
        for view, (frame, finished) in views.items():
            names, part = frame.channels, frame.part
            if self.picture_only:
                ahead = f"{view}." if view else ""
                names, part = [f"{ahead}{letter}" for letter in "RGBA"], first.part
            planes = np.moveaxis(finished.picture, 2, 0)
            by_part.setdefault(part, {}).update(zip(names, planes, strict=False))
            if not self.picture_only:
                for name, plane in _light_planes(frame, finished).items():
                    part, own = frame.places[name]
                    by_part.setdefault(part, {})[own] = plane
        path = frame_path(self.output, number)
        exr.copy_picture(
            frame_path(self.source, number),
            path,
            by_part,
            alone=self.picture_only,
            window=self.crop,
            metadata=metadata,
            check=check,
        )
        return path

    def is_done(self, number: int, digest: str) -> bool:
        """Whether a complete output of these inputs and settings exists.

        One whose input is gone cannot be made again, and stays.
        """
        output = frame_path(self.output, number)
        if not output.is_file():
            return False
        if frame_path(self.source, number).is_file():
            return is_made_of(output, digest)
        return is_complete(output)

    def check(self, numbers: Sequence[int], existing: Sequence[int]) -> None:
        """Reject impossible outputs, and make their folder.

        Parameters
        ----------
        numbers : sequence of int
            The frames to denoise.
        existing : sequence of int
            All frames that have a file: none may be overwritten.

        Raises
        ------
        UsageError
            If the patterns fit no sequence.
        PictureError
            If an output cannot be written or is an input.
        """
        if Path(self.output).suffix.lower() != ".exr":
            raise UsageError(f"output {self.output!r} must end in .exr")
        if len(numbers) > 1 and "#" not in Path(self.output).name:
            raise UsageError(
                f"all {len(numbers)} frames would be written to {self.output!r}; add "
                "#### for the frame number"
            )
        for pattern in self.patterns[1:]:
            self._check_beside(pattern, existing)
        inputs = [frame_path(pattern, n) for pattern in self.patterns for n in existing]
        known = set(existing)
        outputs = (frame_path(self.output, n) for n in numbers if n in known)
        check_places(outputs, [*inputs, *self.others])
        check_folder(Path(self.output).parent)

    def _check_beside(self, pattern: str, existing: Sequence[int]) -> None:
        """Reject one file beside many frames, and the frames themselves."""
        if "#" in Path(self.source).name and "#" not in Path(pattern).name:
            raise UsageError(
                f"{pattern!r} is one file for all frames; add #### for the frame number"
            )
        for number in existing:
            source, path = (frame_path(x, number) for x in (self.source, pattern))
            if path.exists() and source.samefile(path):
                raise UsageError(
                    f"{path} is the frame itself, no further file of it; give another"
                )


def denoise_sequence(
    files: Files,
    denoiser: Denoiser,
    *,
    frames: Iterable[int] | None = None,
    radius: int | None = None,
    strength: float = 1.0,
    reading: Reading | None = None,
    resume: bool = False,
    say: Say = lambda _: None,
    progress: Callback | None = None,
) -> dict[str, Any]:
    """Denoise the frames of a sequence, each with its neighbours' samples, in order.

    Parameters
    ----------
    files : Files
        Inputs and outputs.
    denoiser : Denoiser
        The denoiser.
    frames : iterable of int, optional
        Frame numbers; all that exist by default. Samples of other existing frames,
        between these or next to them, are reused, too.
    radius : int, optional
        How many frames before and after are neighbours; by default what the files
        recommend, or 4.
    strength : float
        How much neighbours count, 0 to 1, times what a pass of the files says.
    reading : Reading, optional
        Options for reading.
    resume : bool
        Skip outputs that are complete and made of these settings and of the inputs as
        they are now.
    say : callable
        Takes a line about a frame that is finished, left out, or not reusable.
    progress : callable, optional
        Takes the fraction of all frames that is done; False as its result cancels.

    Returns
    -------
    result : dict
        What `xrds denoise --json` prints; `left_out` says why frames were not read.

    Raises
    ------
    UsageError
        If there are no frames, or outputs are impossible.
    PictureError
        If no frame can be read, the first lacks passes, or an output cannot be written;
        outputs before it are complete.
    Cancelled
        If `progress` requests it; outputs that are there are complete.
    """
    if not 0.0 <= strength <= 1.0:
        raise UsageError(f"strength is {strength}; it must be from 0 to 1")
    numbers = _choose_numbers(files, frames, say)
    existing = _existing_frames(files.source, numbers)
    files.check(numbers, existing)
    if not strength:
        radius = 0
    radius = radius if "#" in Path(files.source).name else radius or 0  # or one frame
    recipe = _make_recipe(files, reading or Reading(), denoiser, strength)
    loader = Loader(files.source, recipe, reusable=radius != 0, say=say)
    loader.look(numbers, set(existing))
    readable = [n for n in numbers if n not in loader.failed]
    first = loader.first(readable)
    if radius is None:
        radius = RADIUS if first is None or first.radius is None else first.radius
    beside = (*numbers, *existing)
    shot = Shot((), radius, others=beside)
    done = _find_done(files, recipe, shot, numbers, say) if resume else set()
    if first is None and not done:
        raise PictureError(f"no frame can be read: {loader.failed[numbers[0]]}")
    shot = Shot(tuple(n for n in readable if n not in done), radius, others=beside)
    source = _Frames(
        files,
        denoiser,
        shot,
        loader,
        recipe,
        resume,
        say,
        Progress(progress),
        strength,
    )
    entries = [x for x in finish_frames(shot, source, source.finish) if x is not None]
    source.selection.report()
    return {
        "output": files.output,
        "temporal_radius": radius,
        "device": denoiser.device,
        "frames": entries,
        "kept": sorted(done),
        "left_out": _list_left_out(loader, [n for n in numbers if n not in done]),
    }


@dataclass
class _Frames(FrameSource[FrameFile]):
    """The frames of a sequence, read, finished and written.

    A frame that cannot be finished or written is left out; two of them in a row are an
    error.
    """

    files: Files
    denoiser: Denoiser
    shot: Shot
    loader: Loader
    recipe: Recipe
    resume: bool
    say: Say
    progress: Progress
    strength: float
    selection: NeighbourSelection = field(init=False)
    movement: Movement = field(default_factory=Movement)
    clock: Clock = field(default_factory=Clock)
    fails: bool = False

    def __post_init__(self) -> None:
        self.selection = NeighbourSelection(self.say)

    def load(self, number: int) -> FrameFile | None:
        self.progress.monitor(0.0)
        self.progress.check()
        return self.loader.load(number)

    def is_done(self, frame: Neighbourhood[FrameFile]) -> bool:
        if not self.resume:
            return False
        return self.files.is_done(frame.number, self._digest(frame.number))

    def finish(self, frame: Neighbourhood[FrameFile]) -> dict[str, Any] | None:
        """Finish and write a frame; returns its record, None where it is left out."""
        try:
            record = self._finish(frame)
        except PictureError as error:
            if self.fails:
                raise
            self.fails = True
            self.loader.leave_out(frame.number, error)
            return None
        self.fails = False
        errors.finished.append(record)
        return record

    def _finish(self, frame: Neighbourhood[FrameFile]) -> dict[str, Any]:
        number, own = frame.number, frame.own
        views, others = {}, {}
        self.progress.begin_stage(1.0 / len(self.shot.frames))
        for view, file in {"": own, **own.others}.items():
            others[view] = self.selection.select(
                number, file, _neighbours_in_view(frame, view)
            )
            region, within = _find_regions(file, self.files.crop)
            done = finish_frame(
                file.stored,
                others[view],
                self.denoiser,
                self.movement,
                self.progress.monitor,
                region=region,
                light=file.light,
                strength=self.strength,
            )
            views[view] = file, done.within(within)
        finished = views[""][1]
        started = time.perf_counter()
        made_of = {MADE_OF: self._digest(number)}
        metadata = _make_metadata(own, finished, self.denoiser) | made_of
        check = partial(self.loader.check, number)
        path = self.files.write(number, views, metadata, check)
        self.selection.record(others[""], finished.accumulated)
        seconds = {"read": self.loader.seconds()}
        for stage in finished.seconds:
            seconds[stage] = sum(done.seconds[stage] for _, done in views.values())
        seconds["write"] = time.perf_counter() - started
        failed = self.loader.failed
        left = sum(n > number and n not in failed for n in self.shot.frames)
        self.say(f"frame {number}: {path}, {self.clock.lap(left)}")
        return _make_entry(number, path, self.shot.radius, finished, seconds)

    def _digest(self, number: int) -> str:
        near = sorted((number, *self.shot.neighbours(number)))
        states = {n: self.loader.states.get(n, ()) for n in near}
        return self.recipe.digest(states, number)


def _make_recipe(
    files: Files, reading: Reading, denoiser: Denoiser, strength: float
) -> Recipe:
    settings = denoiser.quality, files.picture_only, files.crop
    of_strength = () if strength == 1.0 else (strength,)
    return Recipe(files.patterns, reading, (*settings, *of_strength))


def _find_done(
    files: Files, recipe: Recipe, shot: Shot, numbers: Sequence[int], say: Say
) -> set[int]:
    """Return the frames that are complete; a line reports those that are made anew."""
    written = set(_existing_frames(files.output, numbers))
    written.intersection_update(numbers)
    near = {n: sorted((n, *shot.neighbours(n))) for n in sorted(written)}
    states = states_of(recipe, {x for numbers in near.values() for x in numbers})
    done = {
        n
        for n, others in near.items()
        if files.is_done(n, recipe.digest({x: states[x] for x in others}, n))
    }
    if anew := sorted(written - done):
        say(
            f"made anew, as they are damaged or were made with other settings or of "
            f"other inputs: frames {in_words(anew)}"
        )
    return done


def _make_metadata(
    own: FrameFile, finished: Finished, denoiser: Denoiser
) -> dict[str, str]:
    """Return what made a frame, in the attributes that `xrds render` writes."""
    frames = finished.accumulated.frames
    return {
        "xrds.version": package_version(),
        "xrds.mode": "denoised",
        "xrds.preset": denoiser.quality,
        "xrds.samples": f"{own.stored.samples:g}",
        "xrds.frames": f"{frames[0]} to {frames[-1]}",
    }


def _neighbours_in_view(
    neighbourhood: Neighbourhood[FrameFile], view: str
) -> dict[int, FrameFile]:
    """Return the same view of a frame's neighbours; "" is the first view."""
    if not view:
        return neighbourhood.neighbours
    near = neighbourhood.neighbours.items()
    return {
        n: neighbour.others[view] for n, neighbour in near if view in neighbour.others
    }


def _find_regions(
    own: FrameFile, crop: PixelWindow | None
) -> tuple[Rectangle, Rectangle]:
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


def _light_planes(frame: FrameFile, finished: Finished) -> dict[str, Array]:
    """The planes of a frame's AOVs and light passes, by full channel name."""
    passes = passes_of(frame.light, finished.parts)
    return {
        name: plane
        for names, pixels in passes.items()
        for name, plane in zip(names, np.moveaxis(pixels, 2, 0), strict=True)
    }


def _list_left_out(loader: Loader, todo: Sequence[int]) -> list[dict[str, Any]]:
    failed = {n: loader.failed[n] for n in todo if n in loader.failed}
    return [{"frame": n, "reason": why} for n, why in failed.items()]


def _choose_numbers(files: Files, frames: Iterable[int] | None, say: Say) -> list[int]:
    """The frames to denoise, in order."""
    for pattern in (*files.patterns, files.output):
        check_pattern(pattern)
    if others := misnamed(files.source):
        say(
            f"{len(others)} files have another number of digits than # in "
            f"{files.source} and are left out, such as {others[0]}"
        )
    return sorted(set(frames)) if frames else _find_all_frames(files.source)


def _find_all_frames(pattern: str) -> list[int]:
    if "#" not in Path(pattern).name:
        return [0]
    numbers = frame_numbers(pattern)
    if not numbers:
        raise PictureError(f"no file is called {pattern}; # are digits of its number")
    return numbers


def _existing_frames(pattern: str, numbers: Sequence[int]) -> Sequence[int]:
    """Return the frames that have a file; without # there is one for every number."""
    if "#" in Path(pattern).name:
        return frame_numbers(pattern)
    return numbers if os.path.lexists(pattern) else []


def _make_entry(
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
