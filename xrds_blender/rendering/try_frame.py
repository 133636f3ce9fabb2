"""One frame both ways in the same seconds: by Cycles with its denoiser, and by XRDS.

All of it is one render job, inside which the neighbours are evaluated. Every sampling
syncs the scene anew, as the frames of an animation do, so what is measured here is what
a frame of one takes.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from xrds_core.arrays import Array
from xrds_core.denoising.light_passes import NONE
from xrds_core.errors import SceneError
from xrds_core.progress import duration
from xrds_core.shot import Shot

from ..cycles import session
from ..cycles.layer_session import LayerSession
from ..cycles.settings import subset_of_file
from ..internals.borrowed import write
from ..internals.engine_override import ENGINE
from ..planning.request import MOST_SAMPLES, Request
from ..planning.settings import DEFAULT_DENOISING, Mode
from ..scene.contents import cuts, frame_range, moves_in_time
from ..scene.strength import strength_of
from . import history, stages
from .blender_job import call_engine
from .engine_frames import go_to
from .full_size import FullSize
from .methods import CyclesOnly, Method
from .picture import joined
from .sampling import Sampled, has_neighbours

CYCLES = "CYCLES"
"""Blender's name for Cycles."""
FEWEST = 2
"""Samples of a frame with neighbours: fewer have no halves."""
_ALIKE = 0.1  # a frame of so nearly the right samples is not sampled again
_GUESSES, _GROWTH = 4, 4  # and how much larger each may be than the one before

Say = Callable[[str], object]
"""Takes a line about what comes next, and how long all will take."""


@dataclass(frozen=True)
class Way:
    """A frame as one of the two ways makes it.

    `pixels` (H, W, 4) are float32, scene-linear, row 0 on top. It has so many `samples`
    per pixel, or `at_most` so many where pixels may stop earlier. `seconds` are those
    of one frame of a long animation, `finishing` of them after its samples.
    """

    name: str
    pixels: Array
    samples: int
    seconds: float
    finishing: float = 0.0
    at_most: bool = False


@dataclass(frozen=True)
class Tried:
    """A frame both ways; `frames` are those whose samples XRDS' has, `notes` lines."""

    frame: int
    cycles: Way
    xrds: Way
    frames: tuple[int, ...]
    notes: tuple[str, ...] = ()


def try_frame(scene: Any, request: Request, say: Say = lambda _: None) -> Tried:
    """Render the scene's current frame both ways in the same seconds.

    Of the request it takes the temporal radius, the denoiser and the machine. The scene
    is afterwards as it was before. Raises SceneError where there is nothing to compare,
    and what `render` raises.
    """
    return call_engine(scene, work_of(scene, request, say))


def work_of(
    scene: Any, request: Request, say: Say = lambda _: None
) -> Callable[[Any, Any], Tried]:
    """What a `Job` is to do for `try_frame`; raises SceneError as that does."""
    request = replace(
        request.with_settings(mode=Mode.FULL_SIZE, samples=None),
        same_picture=False,
        deadline=None,
        time_budget=None,
        finish_stopped=False,
        passes=(NONE,),
        light_aovs=(),
    )
    numbers = _frames_of(scene, request)
    place, camera = (scene.frame_current, scene.frame_subframe), scene.camera

    def work(engine: Any, depsgraph: Any) -> Tried:
        try:
            with LayerSession(engine, depsgraph):
                try:
                    return _Trial(engine, depsgraph, request, numbers, say).render()
                finally:
                    engine.frame_set(*place)
                    if scene.camera != camera:  # markers bind another
                        write(scene, "camera", camera)
        finally:
            stages.end()

    return work


def _frames_of(scene: Any, request: Request) -> tuple[int, ...]:
    """The current frame and its neighbours; raises SceneError where there are none."""
    if scene.camera is None:
        raise SceneError(f"scene {scene.name!r} has no camera; add one")
    if scene.render.engine not in {CYCLES, ENGINE}:
        raise SceneError(
            f"scene {scene.name!r} is rendered by {scene.render.engine}; choose Cycles "
            "or XRDS, to try a frame against Cycles"
        )
    if not has_neighbours(scene, request):
        raise SceneError(
            "frames of this camera, or without a temporal radius, cannot reuse each "
            "other's samples; there is nothing to try"
        )
    whole = frame_range(scene)
    if len(whole) < 2 or not moves_in_time(scene):
        raise SceneError(
            f"scene {scene.name!r} is no animation; frames are tried with their "
            "neighbours' samples"
        )
    number, radius = scene.frame_current, request.settings.temporal_radius
    step = scene.frame_step
    near = range(number - radius * step, number + radius * step + 1, step)
    there = [n for n in near if n == number or whole[0] <= n <= scene.frame_end]
    shot = Shot((number,), radius, cuts(scene, there), others=tuple(there))
    numbers = tuple(sorted((number, *shot.neighbours(number))))
    if len(numbers) < 2:
        raise SceneError(
            f"frame {number} has no neighbours among frames {whole[0]} to {whole[-1]}; "
            "go to one of these"
        )
    return numbers


def wanted_samples(seconds: float, tried: Sequence[tuple[int, float]]) -> int:
    """Samples that take so many seconds, by those `tried` and what they took.

    Of a single try all is samples; two tell what a render takes beside them. That may
    be chance where both are alike, so the next is not far larger.
    """
    many, most = tried[-1]
    sample, beside, limit = most / many, 0.0, MOST_SAMPLES
    if len(tried) > 1:
        few, least = tried[-2]
        sample = max((most - least) / (many - few), 0.1 * sample)
        beside, limit = most - many * sample, _GROWTH * many
    return max(FEWEST, min(int((seconds - beside) / sample), limit))


@dataclass
class _Trial:
    """One try inside the engine's render, which is at the frame to try."""

    engine: Any
    depsgraph: Any
    request: Request
    numbers: tuple[int, ...]
    say: Say
    number: int = field(init=False)
    notes: list[str] = field(default_factory=list)
    _parts: int = 0  # that have begun
    _stages: dict[str, float] = field(default_factory=dict)  # of the last finishing

    def __post_init__(self) -> None:
        self.number = self.depsgraph.scene_eval.frame_current

    def render(self) -> Tried:
        known = history.layer_of(self.depsgraph)  # Cycles may free the scene
        layer = known.name
        near = min(self.numbers, key=lambda n: (n == self.number, abs(n - self.number)))
        # what only the first render and the first denoising wait for counts for nobody
        other, _ = self._sample(FEWEST, near, "warming up")
        others = [other] * (len(self.numbers) - 1)
        self._finish(self.request, other, others)
        cycles = self._render_by_cycles()
        request, own, sampled = self._choose(cycles.seconds, others)
        samples = request.settings.own_samples or FEWEST
        frames, seconds = [], [sampled]
        for place, number in enumerate(x for x in self.numbers if x != self.number):
            left = (len(self.numbers) - 1 - place) * cycles.seconds
            what = f"frame {number}, {samples} samples"
            frame, spent = self._sample(samples, number, what, left)
            frames.append(frame)
            seconds.append(spent)
        self._begin("denoising")
        pixels, finishing, used = self._finish(request, own, frames)
        session.write_combined(self.engine, layer, pixels)
        history.remember(known, request.settings, {**own.seconds, **self._stages})
        spent = sum(seconds) / len(seconds) + finishing
        ours = Way("XRDS", next(iter(pixels.values())), samples, spent, finishing)
        if samples == FEWEST and spent > (1 + _ALIKE) * cycles.seconds:
            self.notes.append(
                f"{duration(cycles.seconds)} are too short for {FEWEST} samples with "
                f"neighbours: XRDS took {duration(spent)}"
            )
        return Tried(self.number, cycles, ours, used, tuple(self.notes))

    def _begin(self, what: str, left: float | None = None) -> None:
        """Say and show what comes next; all takes so many seconds from here."""
        rest = "" if left is None else f", about {duration(left)} left"
        parts = len(self.numbers) + _GUESSES + 1
        begun, self._parts = self._parts, min(self._parts + 1, parts - 1)
        head = f"try of frame {self.number}{rest}"
        stages.begin_part(head, begun / parts, 1 / parts)
        self.say(f"frame {self.number}: {what}{rest}")

    def _render_by_cycles(self) -> Way:
        """The frame as the file has it, but denoised."""
        go_to(self.engine, self.depsgraph, self.number)
        scene, layer = self.depsgraph.scene_eval, self.depsgraph.view_layer_eval
        cycles = scene.cycles
        _, samples = subset_of_file(cycles, session.samples_of(self.depsgraph))
        at_most = cycles.use_adaptive_sampling or cycles.time_limit > 0.0
        alone, denoising = self.request.with_settings(temporal_radius=0), None
        if not session.has_denoiser():
            self.notes.append(
                "this Blender has no denoiser: Cycles' picture is denoised by XRDS'"
            )
        elif not (cycles.use_denoising and layer.cycles.use_denoising):
            denoising = DEFAULT_DENOISING
            self.notes.append(
                "the file's Denoise is off: Cycles' picture is denoised by Blender's "
                "default, OpenImageDenoise"
            )
        method: Method = FullSize(alone)
        if session.has_denoiser():
            method = CyclesOnly(
                alone.with_settings(mode=Mode.CYCLES_ONLY, denoising=denoising)
            )
        self._begin(f"Cycles, {samples} samples")
        session.free(self.engine)
        stages.begin(self.engine, stages.SAMPLES, 1, 1)
        started = time.perf_counter()
        own = method.sample(self.engine, self.depsgraph)
        pictures = [method.finish(own, (), view) for view in own.views]
        spent = time.perf_counter() - started
        return Way("Cycles", pictures[0].pixels, samples, spent, at_most=at_most)

    def _choose(
        self, seconds: float, others: Sequence[Sampled]
    ) -> tuple[Request, Sampled, float]:
        """The request of frames that take so many seconds, and the first of them.

        With the seconds of its samples. `others` stand for its neighbours.
        """
        own, spent = self._sample(FEWEST, self.number, "measuring")
        _, finishing, _ = self._finish(self.request, own, others)
        budget, tried = seconds - finishing, [(FEWEST, spent)]
        frames = [own]
        for _ in range(_GUESSES):
            count = tried[-1][0]
            wanted = wanted_samples(budget, tried)
            if abs(wanted - count) <= max(_ALIKE * count, 0.5):
                break
            left = len(self.numbers) * seconds
            own, spent = self._sample(wanted, self.number, f"{wanted} samples", left)
            tried.append((wanted, spent))
            frames.append(own)
        best = min(range(len(tried)), key=lambda i: abs(tried[i][1] - budget))
        return self._request(tried[best][0]), frames[best], tried[best][1]

    def _request(self, samples: int) -> Request:
        return self.request.with_settings(samples=samples)

    def _sample(
        self, samples: int, number: int, what: str, left: float | None = None
    ) -> tuple[Sampled, float]:
        """A frame with so many samples, and what they took."""
        self._begin(what, left)
        go_to(self.engine, self.depsgraph, number)
        session.free(self.engine)
        place = number // self.depsgraph.scene_eval.frame_step
        method = FullSize(self._request(samples))
        started = time.perf_counter()
        sampled = method.sample(self.engine, self.depsgraph, place)
        strength = strength_of(self.depsgraph.scene_eval, self.request)
        sampled = replace(sampled, strength=strength)
        return sampled, time.perf_counter() - started

    def _finish(
        self, request: Request, own: Sampled, others: Sequence[Sampled]
    ) -> tuple[dict[str, Array], float, tuple[int, ...]]:
        """The pictures by view, what they took, and the frames that they are of."""
        method = FullSize(request)
        report = method.begin_finishing(self.engine)
        started = time.perf_counter()
        pictures = {
            view: method.finish(own, others, view, report) for view in own.views
        }
        spent = time.perf_counter() - started
        first = next(iter(pictures.values()))
        self._stages = joined(pictures, {}).seconds
        frames = first.temporal.frames if first.temporal else (own.number,)
        return {view: x.pixels for view, x in pictures.items()}, spent, frames
