"""`xrds render`: a .blend file in, one picture file per frame out."""

from __future__ import annotations

import dataclasses
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from xrds_core.errors import PictureError, UsageError, XRDSError, finished, warn
from xrds_core.exr.openexr_io import FLOAT_ZIP, Encoding
from xrds_core.files import check_folder
from xrds_core.frames import frame_path, in_words
from xrds_core.overlap import Overlap
from xrds_core.progress import Clock, ShotClock, duration, what_is_left

from ..cycles.session import samples_on_card
from ..cycles.settings import subset_of_file
from ..cycles.view import picture_size
from ..planning.request import Request
from ..planning.settings import Mode
from ..rendering.loading import load_denoiser, load_upscaler
from ..rendering.picture import NetworkFailed, Picture, metadata_of, record_of
from ..rendering.render import render_scene
from ..rendering.sample_cache import SampleCache, cache_of
from ..rendering.sampling import has_neighbours
from ..rendering.shot import cache_samples, render_shot
from ..scene.contents import frame_range, moves_in_time
from ..scene.remarks import missing, remarks
from ..scene.strength import neighbours_count
from . import picture_file
from .picture_file import is_whole
from .scene_file import AS_SAVED, SceneChoice, frames_of, open_scene


def render_file(
    path: Path,
    output: str | None,
    request: Request,
    *,
    frames: Sequence[int] | None = None,
    animation: bool = False,
    choice: SceneChoice = AS_SAVED,
    encoding: Encoding = FLOAT_ZIP,
    resume: bool = False,
    sample_cache: Path | None = None,
) -> dict[str, Any]:
    """Render frames of a .blend file and return what `xrds render --json` prints.

    Parameters
    ----------
    path : Path
        The .blend file; whatever Blender has open is replaced by it.
    output : str or None
        .exr or .png; # stands for digits of the frame number. None keeps samples alone.
    request : Request
        Scale, samples and the rest.
    frames : sequence of int, optional
        Frame numbers; by default the file's current one, of an `animation` its range.
    animation : bool
        Whether to render the file's range of frames.
    choice : SceneChoice
        What comes in the place of what the file was saved with.
    encoding : Encoding
        How numbers are stored in .exr files.
    resume : bool
        Whether to leave frames as they are that lie there whole and of their size.
    sample_cache : Path, optional
        A folder for the samples of every frame, at scale 1; those that it has already
        are read, not rendered.

    Returns
    -------
    result : dict
        What `xrds render --json` prints.

    Raises
    ------
    UsageError, SceneError, PictureError, WeightsError
        Before anything is rendered, if it could not succeed.
    PictureError, NetworkFailed
        Later, for a frame that cannot be written, or a network that fails; both name
        the file with what there is.
    """
    if sample_cache is not None:
        _check_cache(request)
    if output is not None:
        picture_file.check_output(output, frames or [0], has_passes=bool(request.light))
    scene = open_scene(path, choice)
    _check_parts(request)
    numbers = _choose_numbers(scene, frames, animation, output)
    notes = _make_notes(scene, request, output)
    size = picture_size(scene.render)
    cache = None
    if sample_cache is not None:
        cache = _open_cache(scene, request, sample_cache, numbers, choice)

    def is_done(number: int) -> bool:  # anew: others may be writing the same frames
        return resume and is_whole(frame_path(str(output), number), size)

    written: list[dict[str, Any]] = []
    last, clock = None, ShotClock()

    def note(entry: dict[str, Any]) -> None:
        finished.append(entry)
        clock.finished()
        if numbers[1:]:
            _say_frame(entry, numbers, clock)
        written.append(entry)

    if output is not None:
        with Overlap[dict[str, Any]](_writes_behind(scene, output)) as writing:
            for number, last in _render_pictures(
                scene, request, output, numbers, is_done, cache, clock
            ):
                work = partial(_write, scene, output, number, last, request, encoding)
                for entry in writing.put(work):
                    note(entry)
            for entry in writing.rest():
                note(entry)
    if cache:
        _cache_others(scene, request, numbers, cache)
    return {
        "output": output,
        "resolution": list(size),
        **_describe(last, request),
        "frames": written,
        "kept": _kept(numbers, written) if output else [],
        "samples": cache and cache.report(numbers),
        "remarks": notes,
    }


def _writes_behind(scene: Any, output: str) -> bool:
    """Whether a file is written while the next frame is sampled, on a card.

    Blender's own writing, and scenes that move, are for its own thread alone.
    """
    is_exr = Path(output).suffix.lower() == ".exr"
    return samples_on_card(scene) and is_exr and not scene.animation_data


def _make_notes(scene: Any, request: Request, output: str | None) -> list[str]:
    """Print and return what the pictures, or the samples alone, will lack."""
    notes = [*missing()] if output is None else remarks(scene, request)
    for line in notes:
        warn(line)
    return notes


def _say_frame(entry: dict[str, Any], numbers: Sequence[int], clock: ShotClock) -> None:
    """Print which frame was written, and what is left."""
    left = what_is_left(sum(n > entry["frame"] for n in numbers), clock.left())
    took = duration(entry["seconds"]["total"])
    warn(f"frame {entry['frame']}: {entry['output']}, {took}{left}")


def _kept(numbers: Sequence[int], written: Sequence[dict[str, Any]]) -> list[int]:
    """Numbers of the frames that were there already."""
    rendered = {entry["frame"] for entry in written}
    return [number for number in numbers if number not in rendered]


def _choose_numbers(
    scene: Any, frames: Sequence[int] | None, animation: bool, output: str | None
) -> list[int]:
    """Numbers of the frames to render; says so where the file holds more."""
    whole_range = frame_range(scene)
    if chosen := frames_of(scene, frames, animation):
        if animation and output is not None:
            picture_file.check_output(output, whole_range)
        return chosen
    current = scene.frame_current
    if len(whole_range) > 1 and moves_in_time(scene):
        warn(
            f"frame {current} alone: the file has {in_words(whole_range)}; -a renders "
            "them, --frames some of them"
        )
    return [current]


def _describe(last: Picture | None, request: Request) -> dict[str, Any]:
    """What the pictures were rendered by, as the last one says."""
    settings = (last and last.settings) or request.settings
    return {
        "scale": settings.scale,
        "preset": settings.preset if settings.is_enlarged else None,
        "device": last.device if last else "",
        "plan": [
            dataclasses.asdict(decision) for decision in (last.plan if last else ())
        ],
    }


def _check_parts(request: Request) -> None:
    """Raise XRDSError now rather than after the Cycles renders."""
    settings, machine = request.settings, request.machine
    if request.guide_cache is not None:
        check_folder(Path(request.guide_cache))
    if settings.is_enlarged:
        load_upscaler(settings.network, machine)
    elif not settings.is_cycles_only:
        load_denoiser(settings.quality, machine)


def _render_pictures(
    scene: Any,
    request: Request,
    output: str,
    numbers: Sequence[int],
    is_done: Callable[[int], bool],
    cache: SampleCache | None,
    clock: ShotClock,
) -> Iterator[tuple[int, Picture]]:
    """Number and picture of every frame that is not done."""
    is_shot = len(numbers) > 1 and has_neighbours(scene, request)
    if request.deadline is not None and not is_shot:
        request = request.with_settings(temporal_radius=0)
    if is_shot or cache or request.deadline is not None:
        try:
            yield from render_shot(scene, request, numbers, is_done, cache, clock)
        except NetworkFailed as error:
            raise _network_error(error, scene, output, error.number or 0) from error
        return
    clock.add(0, sum(not is_done(number) for number in numbers))
    for number in numbers:
        if not is_done(number):
            yield number, _picture(scene, request, output, number)


def _check_cache(request: Request) -> None:
    """Raise UsageError for a request that has no samples to cache."""
    if request.time_budget is not None or request.settings.mode is not Mode.FULL_SIZE:
        raise UsageError(
            "--sample-cache needs --scale 1, without --plain and --time-budget"
        )
    if not request.settings.temporal_radius:
        raise UsageError("--sample-cache needs a --temporal-radius of 1 or more")
    if request.light:
        raise UsageError(
            "--sample-cache holds no parts of the light: leave out --passes"
        )


def _open_cache(
    scene: Any,
    request: Request,
    folder: Path,
    numbers: Sequence[int],
    choice: SceneChoice,
) -> SampleCache:
    """The cache of samples; raises UsageError where no frame could use them."""
    if not neighbours_count(scene, request):
        raise UsageError(
            "neighbours have a strength of 0: leave out --sample-cache, or give "
            "another --strength"
        )
    if not has_neighbours(scene, request):
        raise UsageError(
            "frames of such a panoramic camera cannot reuse samples: leave out "
            "--sample-cache"
        )
    # neither changes a sample; what scripts did not run is known otherwise
    decides = dataclasses.replace(choice, threads=None, trusted=False)
    return cache_of(scene, request, folder, numbers, decides, warn)


def _cache_others(
    scene: Any, request: Request, numbers: Sequence[int], cache: SampleCache
) -> None:
    """Render the samples of frames that no picture has asked for."""
    clock = Clock()
    for number in cache_samples(scene, request, numbers, cache):
        left = sum(n > number for n in numbers)
        warn(f"frame {number}: samples cached, {clock.lap(left)}")


def _picture(scene: Any, request: Request, output: str, number: int) -> Picture:
    scene.frame_set(number)
    try:
        return render_scene(scene, request)
    except NetworkFailed as error:
        raise _network_error(error, scene, output, number) from error


def _network_error(
    error: NetworkFailed, scene: Any, output: str, number: int
) -> XRDSError:
    """The error that ends the command, with what was rendered in a file."""
    target = frame_path(output, number)
    low = target.with_stem(f"{target.stem}_low")
    place = _save_aside(low, error.radiance, error.alpha, scene)
    return XRDSError(f"frame {number}: {error}, {place}")


def _write(
    scene: Any,
    output: str,
    number: int,
    picture: Picture,
    request: Request,
    encoding: Encoding,
) -> dict[str, Any]:
    """Write one frame; returns its entry for the JSON."""
    target = frame_path(output, number)
    settings = picture.settings or request.settings
    _, of_file = subset_of_file(scene.cycles, scene.cycles.samples)
    metadata = metadata_of(record_of(picture, settings, of_file))
    start = time.perf_counter()
    if scene.frame_current != number and scene.animation_data:
        scene.frame_set(number)  # its view settings may be animated
    first = next(iter(picture.views), "")
    try:
        for view, pixels in picture.views.items():
            if view != first:  # the first comes last: a file of it says all are there
                path = target.with_stem(target.stem + _view_suffix(scene, view))
                light = pixels[..., :3], pixels[..., 3]
                parts = picture.view_parts[view]
                picture_file.save(path, *light, scene, encoding, metadata, parts)
        light, parts = (picture.radiance, picture.alpha), picture.parts
        picture_file.save(target, *light, scene, encoding, metadata, parts)
    except PictureError as error:
        place = _save_elsewhere(target, picture.radiance, picture.alpha, scene)
        raise PictureError(f"{error}; the frame was {place}") from error
    written = time.perf_counter() - start
    seconds = dict(picture.seconds)
    seconds["write"] += written
    seconds["total"] += written
    return {
        "frame": number,
        "output": str(target),
        "seconds": seconds,
        "temporal": picture.temporal and dataclasses.asdict(picture.temporal),
        "samples": settings.count(of_file),
        "share": settings.share,
        "peak_memory": picture.peak_memory,
    }


def _view_suffix(scene: Any, view: str) -> str:
    """What the file of a view has after its name: that of Blender's own output."""
    return str(scene.render.views[view].file_suffix)


def _save_aside(target: Path, radiance: Any, alpha: Any, scene: Any) -> str:
    """Write what was rendered; say where, to end an error's line."""
    try:
        picture_file.save(target, radiance, alpha, scene)
    except PictureError:
        return _save_elsewhere(target, radiance, alpha, scene)
    return f"saved as {target}"


def _save_elsewhere(target: Path, radiance: Any, alpha: Any, scene: Any) -> str:
    """Write into the temporary folder what cannot be written in place."""
    try:
        place = Path(tempfile.mkdtemp(prefix="xrds-")) / target.name
        picture_file.save(place, radiance, alpha, scene)
    except (OSError, PictureError):
        return "lost: the temporary folder cannot be written to either"
    return f"saved as {place}"
