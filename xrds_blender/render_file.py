"""`xrds render`: a .blend file in, one picture file per frame out."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from xrds_core.errors import SceneError

from . import picture_file
from .picking import known_networks

if TYPE_CHECKING:
    from .job import Picture, RenderJob


def render_file(
    path: Path,
    output: str,
    job: RenderJob,
    *,
    frames: Sequence[int] | None = None,
    resolution: tuple[int, int] | None = None,
) -> dict[str, Any]:
    """Render frames of a .blend file and return what `xrds render --json` prints.

    Args:
        path: the .blend file; whatever Blender has open is replaced by it.
        output: .exr or .png; # stands for digits of the frame number.
        job: scale, samples and the rest.
        frames: numbers of the frames; the file's current one by default.
        resolution: width and height in pixels instead of the file's.

    Raises:
        UsageError, SceneError, PictureError, WeightsError: before anything is
            rendered, if it could not succeed.
    """
    picture_file.check_output(output, len(frames or [0]))
    scene = open_scene(path)
    if resolution:
        scene.render.resolution_x, scene.render.resolution_y = resolution
        scene.render.resolution_percentage = 100
    _check_weights(job)
    numbers = list(frames or [scene.frame_current])
    told = [_frame(scene, job, output, number) for number in numbers]
    last = told[-1][1]
    job = last.job or job
    height, width = last.alpha.shape
    return {
        "output": output,
        "resolution": [width, height],
        "scale": 1 if job.is_plain else job.scale,
        "preset": None if job.is_plain else job.preset,
        "device": job.device,
        "frames": [frame for frame, _ in told],
        "plan": [dataclasses.asdict(decision) for decision in last.plan],
    }


def open_scene(path: Path) -> Any:
    """Open a .blend file and return its scene, ready to render.

    Raises SceneError if there is no such file, Blender cannot read it, or it has no
    camera.
    """
    import bpy

    if not path.is_file():
        raise SceneError(f"no file {path}")
    try:
        bpy.ops.wm.open_mainfile(filepath=str(path.resolve()), load_ui=False)
    except RuntimeError as error:
        told = " ".join(str(error).removeprefix("Error:").split())
        raise SceneError(f"Blender cannot open {path}: {told}") from error
    scene = bpy.context.scene
    if scene.camera is None:
        raise SceneError(f"{path} has no camera in scene {scene.name!r}; add one")
    return scene


def _check_weights(job: RenderJob) -> None:
    """Raise WeightsError now rather than after the Cycles renders."""
    if job.is_picked:
        known_networks(job)  # and PyTorch is loaded before the budget begins
    elif not job.is_plain:
        from xrds_core import Upscaler

        Upscaler(job.preset, job.scale, job.guides, job.device, weights=job.weights)


def _frame(
    scene: Any, job: RenderJob, output: str, number: int
) -> tuple[dict[str, Any], Picture]:
    """Render and write one frame; its entry for the JSON, and the picture."""
    from .render import render

    scene.frame_set(number)
    picture = render(scene, **vars(job))
    target = picture_file.frame_path(output, number)
    start = time.perf_counter()
    picture_file.save(target, picture.radiance, picture.alpha, scene)
    written = time.perf_counter() - start
    seconds = dict(picture.seconds)
    seconds["write"] += written
    seconds["total"] += written
    told = {
        "frame": number,
        "output": str(target),
        "seconds": seconds,
        "peak_memory": picture.peak_memory,
    }
    return told, picture
