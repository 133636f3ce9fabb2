"""What a running render is doing now, how far it has come, and how long it will take.

Cycles reports to Blender how far each of its renders is, so Blender's own bar would run
several times. The status bar therefore shows what is worked out here: of an animation
from the seconds that frames took to be sampled and to be finished, of a still from
those of its stages so far and of each kind of stage before.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from xrds_core.progress import ShotClock, duration

from ..cycles import session
from ..internals import status
from ..internals.lifetimes import PROCESS, RENDER_JOB

LOADING = "Loading PyTorch"
LOW, GUIDES, NETWORK = "Low resolution", "Guides", "Network"
SAMPLES, DENOISE = "Samples", "Denoising"
STAGES = (
    "total",
    "sync",
    "beauty",
    "accumulate",
    "denoise",
    "again",
    "guides",
    "network",
    "write",
)
_KINDS = (LOW, GUIDES, NETWORK)
_LEAST = 0.02  # of a stage, before its seconds can be estimated from what is done
_LARGE = 0.1  # megapixels; of less, seconds say nothing about more


@dataclass
class _Run:
    """One frame's render; times are readings of perf_counter."""

    engine: Any
    megapixels: float
    start: float
    stage: str = ""
    number: int = 0
    of: int = 0
    since: float = 0.0
    reported: float = 0.0
    done: set[str] = field(default_factory=set)

    @property
    def kind(self) -> str:
        return self.stage.partition(" of frame")[0]


@dataclass
class Current:
    """The render that goes on, if any, and the frames of its animation.

    Of a longer job, which `head` names, it is a `share`, and so much was done `before`.
    """

    run: _Run | None = None
    head: str = ""
    clock: ShotClock | None = None
    before: float = 0.0
    share: float = 1.0


@dataclass
class Speeds:
    """Seconds per megapixel of each kind of stage.

    Until a stage has been measured they are those of two cores of a desktop.
    """

    seconds: dict[str, float] = field(
        default_factory=lambda: {DENOISE: 2.5, NETWORK: 1.5}
    )


def begin(engine: Any, stage: str, number: int, of: int = 3) -> None:
    """Note that the stage of this number has begun.

    At scale 1 the last one is the denoiser, and all before are samples.
    """
    state, now = RENDER_JOB.of(Current), time.perf_counter()
    if state.run is None:
        result = engine.get_result()
        pixels = result.resolution_x * result.resolution_y
        state.run = _Run(engine, max(pixels, 1) / 1e6, now)
    else:
        _learn(state.run, now)
    run = state.run
    run.engine, run.stage, run.number, run.of = engine, stage, number, of
    run.since, run.reported = now, 0.0
    engine.update_stats("XRDS", stage)


def begin_animation(to_sample: int, to_finish: int) -> None:
    """Note the frames of an animation, or of one more of its view layers."""
    state = RENDER_JOB.of(Current)
    if state.clock is None:
        state.clock = ShotClock()
    state.clock.add(to_sample, to_finish)


def begin_frame(number: int, of: int) -> None:
    """Note which frame of an animation has begun, and the number of the last."""
    RENDER_JOB.of(Current).head = f"frame {number} of {of}"


def end_sampling() -> None:
    """Note that a frame of an animation was sampled."""
    clock = RENDER_JOB.of(Current).clock
    if clock is not None:
        clock.sampled()


def end_frame() -> None:
    """Note that a frame of an animation is finished."""
    clock = RENDER_JOB.of(Current).clock
    if clock is not None:
        clock.finished()


def begin_part(text: str, before: float, share: float) -> None:
    """Note which part of a longer job has begun, and what of the job it is."""
    end()
    state = RENDER_JOB.of(Current)
    state.head, state.before, state.share = text, before, share


def reporter(engine: Any) -> Callable[[float], bool]:
    """Notes how far a stage is, from 0 to 1; False once the user has stopped it."""

    def report(done: float) -> bool:
        run = RENDER_JOB.of(Current).run
        if run is not None:
            run.reported = done
        engine.update_progress(done)
        return not session.is_stopped(engine)

    return report


def end() -> None:
    """Note that the render is over, however it ended."""
    state = RENDER_JOB.of(Current)
    if state.run is not None and state.run.reported >= 1.0:
        _learn(state.run, time.perf_counter())
    state.run, state.head = None, ""
    state.before, state.share = 0.0, 1.0


def current() -> str | None:
    """What is being done and how long all of it will take, None between renders."""
    state = RENDER_JOB.of(Current)
    run = state.run
    if run is None:
        return None
    if state.head:
        left = None if state.clock is None else state.clock.left()
        time_left = "" if left is None else f", all frames in {duration(left)}"
        return f"XRDS: {state.head}, {run.stage.lower()}{time_left}"
    left = _left(run)
    time_left = "" if left is None else f", {_clock(left)} left"
    return f"XRDS {run.number}/{run.of}: {run.stage}{time_left}"


def progress() -> float | None:
    """The part of all the work that is done, 0 to 1; None between renders."""
    state = RENDER_JOB.of(Current)
    run = state.run
    if run is None:
        return None
    if state.clock is not None:
        return state.clock.fraction()
    spent, left = time.perf_counter() - run.start, _left(run)
    part = 0.0 if left is None else spent / max(spent + left, 1e-6)
    return state.before + state.share * part


def show() -> None:
    """Set Blender's progress bar to the part of all the work that is done.

    For the main thread, while the engine renders.
    """
    run, part = RENDER_JOB.of(Current).run, progress()
    if run is not None and part is not None:
        run.engine.update_progress(part)


def _learn(run: _Run, now: float) -> None:
    """Keep what a stage has taken, for the next ones of its kind."""
    run.done.add(run.kind)
    if run.megapixels > _LARGE:
        PROCESS.of(Speeds).seconds[run.kind] = (now - run.since) / run.megapixels


def _left(run: _Run) -> float | None:
    """Seconds until the end; None where not even the first samples are there."""
    spent = time.perf_counter() - run.since
    part = run.reported or status.fraction(run.engine) or 0.0
    if part > _LEAST:
        whole = spent / part
    elif run.kind in (known := PROCESS.of(Speeds).seconds):
        whole = max(known[run.kind] * run.megapixels, spent)
    else:
        return None
    later = [_expected(run, kind, whole) for kind in _later(run)]
    return whole - spent + sum(later)


def _later(run: _Run) -> list[str]:
    """The kinds of the stages that are still to come."""
    if run.kind in (SAMPLES, DENOISE):
        return ([SAMPLES] * (run.of - 1) + [DENOISE])[run.number :]
    return [k for k in _KINDS if k not in run.done and k != run.kind]


def _expected(run: _Run, kind: str, this: float) -> float:
    """Seconds of a stage to come; where none was measured as many as this one takes."""
    known = PROCESS.of(Speeds).seconds.get(kind)
    return this if known is None else known * run.megapixels


def _clock(seconds: float) -> str:
    """Minutes and seconds, as 1:05."""
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes}:{rest:02}"
