"""What accumulation may spoil, on small shots whose frames differ, and on bad frames.

Needs Blender. Each judged frame is finished twice from the same samples, with those of
its neighbours and alone, and both are compared with a reference. Values are of the
display (sRGB at middle grey); errors are means of 3x3 pixels, because the noise of a
single pixel says nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .. import metrics
from .measured import Measured
from .stiff import stops

if TYPE_CHECKING:
    from collections.abc import Iterator

    from xrds_core.accumulation.frame import Stored
    from xrds_core.arrays import Array

SAMPLES, RADIUS, REFERENCE_SAMPLES = 2, 4, 128


@dataclass(frozen=True)
class FullSize:
    """What is judged: no network, full size, frames kept as half floats."""

    preset: str = "full_size"
    scale: int = 1
    precision: str = "fp16"
    device: str = "cpu"

    @property
    def name(self) -> str:
        """Name in the report, as `full_size x1 fp16`."""
        return f"{self.preset} x{self.scale} {self.precision}"


@dataclass(frozen=True)
class Filmed:
    """A shot: its frames' samples by number, and references of those judged."""

    frames: dict[int, Stored]
    truth: dict[int, Array]


def film(name: str) -> Filmed:
    """Render a shot's frames by the product, and references of those judged."""
    from xrds_blender import run_job
    from xrds_blender.planning.request import render_request
    from xrds_blender.planning.settings import DEFAULT_DENOISING
    from xrds_blender.rendering.blender_job import call_engine
    from xrds_blender.rendering.sampling import sample_frame

    from .moving_scenes import FRAMES, JUDGED, build, set_frame

    scene = build(name)
    job = render_request(scale=1, samples=SAMPLES, temporal_radius=RADIUS)
    frames, truth = {}, {}
    for place, number in enumerate(FRAMES):
        set_frame(scene, name, number)
        made = call_engine(scene, lambda *given, p=place: sample_frame(*given, job, p))
        frames[number] = next(iter(made.views.values()))
        if number in JUDGED:
            truth[number] = run_job(
                scene,
                lambda passes: passes.beauty(
                    1, REFERENCE_SAMPLES, seed=77, denoiser=DEFAULT_DENOISING
                ),
            ).radiance
    return Filmed(frames, truth)


def shot(name: str) -> Iterator[Measured]:
    """How far a frame with its neighbours' samples lies behind the frame alone."""
    filmed = film(name)
    lost, excess = [], []
    for number, truth in filmed.truth.items():
        shown = stops(truth)
        together, alone = (finished(filmed.frames, number, r) for r in (RADIUS, 0))
        lost.append(
            metrics.psnr(alone, truth, shown) - metrics.psnr(together, truth, shown)
        )
        errors = [_error(x, truth, shown) for x in (together, alone)]
        excess.append(float((errors[0] - errors[1]).max()))
    yield Measured(f"accumulation.{name}.below_single", max(lost))
    yield Measured(f"accumulation.{name}.excess", max(excess))
    if name == "cut":
        yield Measured(f"accumulation.{name}.ghost", ghost(filmed.frames))


def fisheye() -> Iterator[Measured]:
    """Frames under a fisheye that are not rendered each by itself."""
    import tempfile
    from pathlib import Path

    import bpy

    from xrds_blender.command.render_file import render_file
    from xrds_blender.planning.request import render_request

    from .moving_scenes import build

    build("fisheye")
    with tempfile.TemporaryDirectory() as folder:
        blend = Path(folder) / "fisheye.blend"
        bpy.ops.wm.save_as_mainfile(filepath=str(blend))
        job = render_request(scale=1, samples=1, temporal_radius=RADIUS, device="cpu")
        made = render_file(blend, f"{folder}/#.exr", job, frames=[1, 2, 3])
    lent = [frame for frame in made["frames"] if frame["temporal"] is not None]
    yield Measured("accumulation.fisheye.lent", float(len(lent)))


def finished(frames: dict[int, Stored], number: int, radius: int) -> Array:
    """A frame (H, W, 3) as the product finishes it."""
    from xrds_blender.planning.request import render_request
    from xrds_blender.rendering.full_size import FullSize
    from xrds_core.shot import Shot

    job = render_request(scale=1, samples=SAMPLES, temporal_radius=radius, device="cpu")
    lenders = [frames[n] for n in Shot(tuple(frames), radius).neighbours(number)]
    return FullSize(job).finish_stored(frames[number], lenders).radiance


def _error(picture: Array, truth: Array, shown: float) -> Array:
    """Absolute error of the display values (H - 2, W - 2), means of 3x3 pixels."""
    shown_picture, shown_truth = (metrics.to_srgb(x, shown) for x in (picture, truth))
    error = np.abs(shown_picture - shown_truth).mean(-1)
    windows = np.lib.stride_tricks.sliding_window_view(error, (3, 3))
    return np.asarray(windows.mean((-2, -1)))


def ghost(frames: dict[int, Stored]) -> float:
    """Light that frames on either side of a cut lend to the other: largest change."""
    from xrds_core.accumulation.accumulate import accumulate

    from .moving_scenes import JUDGED

    last, first = JUDGED
    sides = [n for n in frames if n <= last], [n for n in frames if n >= first]
    changes = []
    for number, others in ((last, sides[1]), (first, sides[0])):
        own = frames[number]
        result = accumulate(own, [frames[n] for n in others])
        before = own.picture[:, :3].reshape(*own.shape, 3)
        changes.append(float(np.abs(result.radiance - before).max()))
    return max(changes)
