"""Whether frames of an animation can lend their samples to each other."""

from __future__ import annotations

from typing import Any

from ..cycles.view import can_track
from . import denoisers
from .job import RenderJob


def can_lend(scene: Any, job: RenderJob) -> bool:
    """Whether a job's frames can lend to each other, and are to.

    Not under most panoramic cameras, and full guides hold light of full size, too. What
    a time budget will choose can lend where it may choose our denoiser.
    """
    if job.plain or not job.temporal_radius:
        return False
    if job.is_picked and not denoisers.is_there():
        return False
    if job.is_enlarged and job.guides != "fast" and not job.is_picked:
        return False
    return scene.camera is not None and can_track(scene)
