"""The ways to render a scene here, and the job of the one that is taken."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ..planning import budget
from ..planning import ways as planned
from ..planning.ways import Means, Outlook, Way
from . import history
from .job import RenderJob
from .means import means

BEST_DENOISE = "high"
"""What automatic takes: `best` doubles the seconds for a tenth of a decibel."""


def outlooks(scene: Any, job: RenderJob, at_hand: Means) -> list[Outlook]:
    """What to expect of each way that can work, at the scene's present samples."""

    def seconds(way: Way, asked: planned.Asked) -> float | None:
        return history.seconds(scene, way, asked)

    asked = asked_of(scene, job)
    return planned.outlooks(asked, at_hand, budget.shipped(), seconds)


def asked_of(scene: Any, job: RenderJob) -> planned.Asked:
    """The settings of a job of this scene, as far as ways differ by them."""
    samples, mode = scene.cycles.samples, history.plain_denoiser(scene)
    return history.asked_of(job, samples, mode)


def best_way(scene: Any, job: RenderJob) -> Way:
    """The way with the least error expected at the scene's present samples.

    Whatever the denoising that is asked for at full size: that is chosen along.
    """
    job = replace(job, denoise=BEST_DENOISE)
    return planned.best(outlooks(scene, job, means(job.weights)))


def on_the_way(job: RenderJob, way: Way, scene: Any, temporal_radius: int) -> RenderJob:
    """The job made one of `way`; automatic is the best there is for the scene.

    What a time budget will choose stays open.
    """
    if job.is_picked:
        return replace(job, temporal_radius=temporal_radius)
    if way is Way.AUTOMATIC:
        way = best_way(scene, job)
        job = replace(job, denoise=BEST_DENOISE)
    return replace(
        job,
        scale=way.scale,
        plain=way is Way.PLAIN,
        temporal_radius=0 if way is Way.PLAIN else temporal_radius,
    )
