"""Shots with bad frames, and one of a thousand frames."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from xrds_core.accumulation import virtual_images
from xrds_core.accumulation.accumulate import accumulate
from xrds_core.accumulation.frame import Stored
from xrds_core.accumulation.weighted_sums import MARGIN
from xrds_core.errors import PictureError
from xrds_core.frame_source import FrameSource, Window
from xrds_core.shot import Shot

from .accumulation import RADIUS, SAMPLES, film, finished
from .load import growth, resident
from .measured import Measured, faults, relative_difference

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from xrds_core.accumulation.accumulate import Accumulated

    Frames = dict[int, Stored]

LONG = 1000
_MIDDLE = 5
_BAD = (np.nan, np.inf, -np.inf)


def shots() -> Iterator[Measured]:
    """All of them, on the frames of one shot in which things and camera move."""
    frames = film("alpha_cards").frames
    yield from spoilt(frames)
    yield from missing(frames)
    yield Measured("accumulation.passes.crashes", float(crashes(frames)))
    yield long(frames)


def spoilt(frames: Frames) -> Iterator[Measured]:
    """NaN and infinities in one frame: a neighbour's, and the frame's own."""
    clean = accumulated(frames)
    height, width = frames[_MIDDLE].shape
    bad = np.zeros((height, width), bool)
    bad[height // 3, :] = bad[:, width // 4] = True
    near = np.zeros_like(bad)
    margin = MARGIN + virtual_images.reach((height, width))
    near[height // 3 - margin : height // 3 + margin + 1] = True
    near[:, width // 4 - margin : width // 4 + margin + 1] = True
    wrong, changed = 0, 0.0
    for number in (_MIDDLE, _MIDDLE + 1):
        for value in _BAD:
            these = frames | {number: _with(frames[number], bad, value)}
            wrong += faults(finished(these, _MIDDLE, RADIUS))
            if number == _MIDDLE:
                result = accumulated(these).radiance
                change = relative_difference(result[~near], clean.radiance[~near])
                changed = max(changed, change)
    yield Measured("accumulation.nan.faults", float(wrong))
    yield Measured("accumulation.nan.reach", changed)


def _with(frame: Stored, bad: np.ndarray, value: float) -> Stored:
    """A frame that the renderer gave with `value` in its radiance at `bad` pixels.

    `store` marks such pixels and empties them.
    """
    from xrds_core.accumulation.frame import Frame, store

    shape = frame.shape
    picture = frame.picture.astype(np.float32)
    radiance, albedo, normal = (
        picture[:, i : i + 3].reshape(*shape, 3) for i in (0, 3, 6)
    )
    radiance[bad] = value
    with np.errstate(divide="ignore"):
        depth = (1.0 / frame.inverse_depth).reshape(shape)
    vector = None if frame.vector is None else frame.vector.astype(np.float32)
    spoilt = store(
        Frame(
            number=frame.number,
            camera=frame.camera,
            radiance=radiance,
            albedo=albedo,
            normal=normal,
            depth=depth,
            samples=frame.samples,
            alpha=picture[:, 9].reshape(shape),
            vector=None if vector is None else vector.reshape(*shape, 4),
        )
    )
    noise = None if frame.noise is None else frame.noise.without(bad.ravel())
    return replace(spoilt, noise=noise, counts=frame.counts, image=frame.image)


class _Frames(FrameSource[Stored]):
    """Frames that a function makes of their numbers."""

    def __init__(self, load: Callable[[int], Stored | None]) -> None:
        self._load = load

    def load(self, number: int) -> Stored | None:
        return self._load(number)


def missing(frames: Frames) -> Iterator[Measured]:
    """A frame that could not be read is left out; the others are finished."""
    shot = Shot(tuple(frames), RADIUS)
    lost = _MIDDLE + 1
    wrong, number_of = 0, []
    for found in Window(shot, _Frames(lambda n: frames[n] if n != lost else None)):
        number_of.append(found.number)
        result = accumulate(found.own, list(found.neighbours.values()))
        wrong += faults(np.maximum(result.radiance, 0.0))
    expected = [number for number in frames if number != lost]
    yield Measured("accumulation.missing.faults", float(wrong))
    yield Measured("accumulation.missing.unfinished", float(number_of != expected))


def crashes(frames: Frames) -> int:
    """Count frames with other passes that neither lend nor are refused in one line."""
    own = frames[_MIDDLE]
    others: Sequence[Stored] = (
        replace(own, number=6, picture=own.picture[:, :9]),  # no alpha
        replace(own, number=6, vector=None),
        replace(own, number=6, inverse_depth=np.full_like(own.inverse_depth, np.nan)),
        replace(own, number=6, samples=64.0),
    )
    cases: list[tuple[Stored, type[Exception]]] = [(x, PictureError) for x in others]
    # numbers of another type are the caller's mistake, not a picture's
    cases += [
        (replace(own, number=6, picture=own.picture.astype(np.float32)), ValueError)
    ]
    failed = 0
    for other, refusal in cases:
        try:
            result = accumulate(own, [other])
            failed += not np.isfinite(result.radiance).all()
        except refusal as error:
            failed += "\n" in str(error)
    return failed


def long(frames: Frames) -> Measured:
    """Growth of memory in KiB per frame over a thousand frames, one after the other."""
    from xrds_blender.planning.request import render_request
    from xrds_blender.rendering.full_size import FullSize

    originals = list(frames.values())
    job = render_request(scale=1, samples=SAMPLES, temporal_radius=RADIUS, device="cpu")
    method, memory = FullSize(job), []

    def load(number: int) -> Stored:
        frame = originals[number % len(originals)]
        return replace(frame, number=number, picture=frame.picture.copy())

    for found in Window(Shot(tuple(range(LONG)), RADIUS), _Frames(load)):
        method.finish_stored(found.own, list(found.neighbours.values()))
        memory.append(resident() / 2**10)
    late = memory[len(memory) // 3 :: 4]
    above = {float(i): value - late[0] for i, value in enumerate(late)}
    return Measured("accumulation.long.memory", growth(late) / 4, above)


def accumulated(frames: Frames) -> Accumulated:
    """The middle frame with its neighbours' samples, before it is denoised."""
    others = [frames[n] for n in Shot(tuple(frames), RADIUS).neighbours(_MIDDLE)]
    return accumulate(frames[_MIDDLE], others)
