"""A shot from outside of Blender's own animation render: one Blender job per frame.

A frame is finished when its last neighbour is there: their noisy samples are moved
along with what they show, and the sum is denoised once and, above scale 1, enlarged.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from xrds_core.accumulation.camera import Camera
from xrds_core.errors import SceneError
from xrds_core.frame_source import Neighbourhood, finish_frames
from xrds_core.progress import ShotClock
from xrds_core.shot import Shot, place_of

from ..cycles import session
from ..cycles.session import samples_on_card
from ..cycles.view import cameras_of
from ..planning.request import Request
from ..scene.contents import cuts
from ..scene.strength import is_keyed, neighbours_count, strength_of
from . import stages
from .blender_job import call_engine
from .methods import Method, MethodFrames
from .pace.more import Part, render_more
from .picture import Picture, joined
from .render import method_of
from .sample_cache import SampleCache
from .sampling import Sampled


def render_shot(
    scene: Any,
    request: Request,
    frames: Sequence[int],
    is_done: Callable[[int], bool] = lambda _: False,
    cache: SampleCache | None = None,
    clock: ShotClock | None = None,
) -> Iterator[tuple[int, Picture]]:
    """Render frames of a scene, each with its neighbours' samples, in order.

    Frames that `is_done` says are there are neighbours alone, and only where they are
    needed. A `cache` stores the samples of every frame rendered; what it has already is
    not rendered again, and may lie beyond the ends of these frames. Where Cycles has a
    card, a frame is finished while the next one is sampled. Yields numbers and
    pictures; the scene stays at the last frame rendered. A `clock` tells the time left
    once the caller has noted each frame as finished. Raises what `render` raises.
    """
    todo = tuple(number for number in frames if not is_done(number))
    request = request.in_shot(len(todo))
    if cache is None and not neighbours_count(scene, request):
        request = request.with_settings(temporal_radius=0)
    method = method_of(request, None if cache is None else cache.write)
    radius = request.settings.temporal_radius
    cached = cache.beside(frames, radius) if cache else []
    there = tuple(sorted({*frames, *cached}))
    shot = Shot(todo, radius, cuts(scene, there), others=there)
    if not cache:
        method.begin_shot(scene, shot)
    clock = clock or ShotClock()
    clock.add(len(_loaded(shot)), len(todo))
    source = _SceneFrames(scene, method, frames, shot, is_done, cache, clock)
    finish = partial(_finished, method)
    beside = samples_on_card(scene)
    yield from finish_frames(shot, source, finish, beside=beside)


@dataclass(frozen=True)
class _SceneFrames(MethodFrames):
    """Frames of an open scene, each a Blender job; `numbers` are those to render."""

    scene: Any
    method: Method
    numbers: Sequence[int]
    shot: Shot
    finished: Callable[[int], bool]
    cache: SampleCache | None
    clock: ShotClock

    def load(self, number: int) -> Sampled | None:
        try:
            return self._load(number)
        finally:
            self.clock.sampled()

    def _load(self, number: int) -> Sampled | None:
        sampled = self.cache.read(number) if self.cache else None
        if sampled is None:
            if number not in self.numbers:
                return None
            between = self.shot.is_between(number)
            sampled = _sample(self.scene, self.method, self.numbers, number, between)
        elif is_keyed(self.scene, self.method.request):
            self.scene.frame_set(number)
        strength = strength_of(self.scene, self.method.request)
        return replace(sampled, strength=strength)

    def is_done(self, frame: Neighbourhood[Sampled]) -> bool:
        return self.finished(frame.number)

    def sample_again(self, number: int) -> Sampled:
        return _sample(self.scene, self.method, self.numbers, number)

    def more(self, number: int, part: Part) -> Any:
        self.scene.frame_set(number)

        def work(engine: Any, depsgraph: Any) -> Any:
            session.allocate(engine)
            place = place_of(number, self.numbers)
            return render_more(engine, depsgraph, self.method.request, place, part)

        return call_engine(self.scene, work)


def _loaded(shot: Shot) -> set[int]:
    """The frames of a shot, and those that they reuse."""
    beside = (shot.neighbours(number) for number in shot.frames)
    return {*shot.frames}.union(*beside)


def _finished(method: Method, frame: Neighbourhood[Sampled]) -> tuple[int, Picture]:
    own, others = frame.own, list(frame.neighbours.values())
    pictures = {view: method.finish(own, others, view) for view in own.views}
    picture = joined(pictures, own.seconds)
    picture.seconds["total"] = sum(picture.seconds.values())
    return own.number, picture


def cache_samples(
    scene: Any, request: Request, frames: Sequence[int], cache: SampleCache
) -> Iterator[int]:
    """Render the samples of frames that are not cached yet; yields their numbers.

    Raises what `render` raises.
    """
    method = method_of(request, cache.write)
    for number in frames:
        if cache.read(number) is None:
            _sample(scene, method, frames, number)
            yield number


def _sample(
    scene: Any,
    method: Method,
    frames: Sequence[int],
    number: int,
    between: bool = False,
) -> Sampled:
    """Sample a frame of a shot, alike whatever part of the shot `frames` are."""
    scene.frame_set(number)
    place = place_of(number, frames)

    def work(engine: Any, depsgraph: Any) -> Sampled:
        try:
            return method.sample(engine, depsgraph, place, between)
        finally:
            stages.end()

    return call_engine(scene, work)


def shot_cameras(scene: Any, frames: Iterable[int]) -> dict[int, Camera]:
    """The cameras of some frames of a scene, of stereo the first view's.

    Nothing is rendered; the scene stays at the last frame. Raises SceneError under a
    camera that no matrix describes.
    """
    cameras = {}
    for number in frames:
        scene.frame_set(number)
        views = call_engine(scene, cameras_of)
        camera = next(iter(views.values()), None)
        if camera is None or camera.sphere is not None:
            raise SceneError(f"no matrix describes the panoramic camera of {number}")
        cameras[number] = camera
    return cameras
