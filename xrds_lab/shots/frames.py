"""The frames of a shot: rendered once by the product's code, kept in a folder."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from xrds_core.errors import SceneError

from .. import packing
from ..bench.inputs import Arrays, Folder, open_scene
from ..cards.cycles import CPU
from .motions import FILE, animate

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from xrds_core.accumulation.frame import Frame

    from ..bench.journal import Journal, Strict
    from ..bench.windows import Shot

GENERATION = 3  # counts up whenever the same request is rendered otherwise
MIDDLE = 9
"""The number of the frame that shows the file's own view."""
REACH = 4
"""Frames to each side of it in a shot of nine, the standard."""
_STILL_CAMERA = ("still", "objects", FILE)  # of a file it may stand still
_SEED_STEP = 15_485_863  # larger than seeds of a shot's frames lie apart
_EXPOSURE = "view_exposure"


@dataclass(frozen=True)
class FrameRequest:
    """One frame of one shot.

    `reach` is how many frames the shot has on each side of the middle one: under a
    camera that stands still the part of the sample sequence depends on it. Another
    `seed` gives other noise; that of 0 is the file's own.
    """

    motion: str
    samples: int
    number: int
    reach: int = REACH
    seed: int = 0

    def file_name(self, shot: Shot) -> str:
        """A name that depends on everything the pixels depend on."""
        import bpy

        length = 2 * self.reach + 1
        of = f"of{length}" if self.motion in _STILL_CAMERA else ""
        seed = f"-seed{self.seed}" if self.seed else ""
        what = f"{self.motion}-noisy-{self.samples}spp-{self.number:02}{of}{seed}"
        version = bpy.app.version_string.replace(" ", "")
        card = "" if shot.device == CPU else f"-{shot.device.lower()}"
        scene = f"{shot.name}-{shot.digest}-{shot.window.label}{card}"
        return f"{scene}-{what}-v{GENERATION}-blender{version}.npz"


def requests(
    motion: str, samples: int, reach: int, seed: int = 0
) -> list[FrameRequest]:
    """All noisy frames of a shot, the middle ones first: they count most."""
    numbers = sorted(
        range(MIDDLE - reach, MIDDLE + reach + 1), key=lambda n: abs(n - MIDDLE)
    )
    return [FrameRequest(motion, samples, n, reach, seed=seed) for n in numbers]


class ShotFrames:
    """The frames of one scene, in memory once they are read."""

    def __init__(self, shot: Shot, folder: Folder) -> None:
        self.shot, self.folder = shot, folder

    def has(self, request: FrameRequest) -> bool:
        """Whether it was rendered."""
        return self.folder.has(request.file_name(self.shot))

    def frame(self, request: FrameRequest) -> Frame:
        """A noisy frame as the renderer gave it; raises SceneError without one."""
        return next(iter(packing.unpack(self._read(request)).values()))

    def stops(self, request: FrameRequest) -> float:
        """The exposure of the scene's view."""
        return float(self._read(request)[_EXPOSURE])

    def _read(self, request: FrameRequest) -> Arrays:
        name = request.file_name(self.shot)
        arrays = self.folder.read(name)
        if arrays is None:
            path = self.folder.directory / name
            raise SceneError(f"{path} cannot be read: delete it and run again")
        return arrays

    def render(
        self,
        wanted: Sequence[FrameRequest],
        journal: Journal | Strict,
        done: Callable[[FrameRequest], object],
    ) -> None:
        """Render what is missing of `wanted`; failures go into the journal."""
        for motion, reach in dict.fromkeys((r.motion, r.reach) for r in wanted):
            part = [r for r in wanted if (r.motion, r.reach) == (motion, reach)]
            left = [r for r in part if not self.has(r)]
            left = [r for r in left if not journal.gives_up(self._named(r))]
            if not left:
                continue
            with journal.attempt(f"{self.shot.name}: {motion}"):
                self._render(left, motion, reach, journal, done)

    def _named(self, request: FrameRequest) -> str:
        return f"{self.shot.name}: {request.file_name(self.shot)}"

    def _render(
        self,
        wanted: Sequence[FrameRequest],
        motion: str,
        reach: int,
        journal: Journal | Strict,
        done: Callable[[FrameRequest], object],
    ) -> None:
        scene = open_scene(self.shot.path, self.shot.window, self.shot.device)
        animate(scene, self.shot.window, motion, MIDDLE, reach)
        apart = scene.frame_current - MIDDLE  # of a file's own motion
        scene.render.use_persistent_data = True  # one sync of the scene for all frames
        exposure = np.float32(scene.view_settings.exposure)
        for request in wanted:
            with journal.attempt(self._named(request)):
                scene.frame_set(request.number + apart)
                arrays, seconds = _noisy(scene, request)
                arrays[_EXPOSURE] = exposure
                self.folder.write(request.file_name(self.shot), arrays, seconds)
            done(request)


def _noisy(scene: Any, request: FrameRequest) -> tuple[Arrays, dict[str, float]]:
    """One frame's samples, exactly as `xrds render` takes them for a shot."""
    from xrds_blender.planning.request import render_request
    from xrds_blender.rendering.blender_job import call_engine
    from xrds_blender.rendering.sampling import noisy_frame

    job = render_request(
        scale=1,
        samples=request.samples,
        temporal_radius=request.reach,
        seed=(scene.cycles.seed + request.seed * _SEED_STEP) % 2**31,
    )
    place = request.number - (MIDDLE - request.reach)
    frames, seconds = call_engine(scene, lambda *given: noisy_frame(*given, job, place))
    return packing.pack(frames), seconds
