"""What a render leaves that the user has stopped: the picture so far, denoised.

Cycles writes the samples that it has taken when it is stopped. The quickest denoiser is
taken, and nothing can stop it: the user waits for Blender to be free again.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from xrds_core.arrays import Array

from ..cycles import session
from ..cycles.passes import CyclesPasses
from ..cycles.rendered import Beauty
from ..cycles.samples import samples_in
from .denoisers import in_process, load_denoiser
from .enlarging import bilinear
from .job import RenderJob


def keep_samples(engine: Any, layer_name: str, job: RenderJob) -> None:
    """Denoise the full-size samples that are in the result, if the job asks for it."""
    if not job.stop_keeps:
        return
    denoiser = load_denoiser(_quick(job))
    noisy = samples_in(engine, layer_name)
    pictures = {
        view: denoiser(each.picture, each.albedo, each.normal).radiance
        for view, each in noisy.items()
        if each.picture.any()
    }
    session.write_combined(engine, layer_name, pictures)


def stopped_beauties(passes: CyclesPasses, job: RenderJob) -> dict[str, Beauty]:
    """The low-resolution picture that is in the result, denoised; empty if none is."""
    denoise = in_process(_quick(job))
    return {
        view: low.place.beauty(low.samples.picture)
        if denoise is None
        else low.denoised(denoise)
        for view, low in passes.stopped_samples(job.scale).items()
        if low.samples.picture.any()
    }


def keep_beauties(
    engine: Any, layer_name: str, job: RenderJob, beauties: dict[str, Beauty]
) -> None:
    """Make low-resolution pictures the result, enlarged, if the job asks for it."""
    if job.stop_keeps:
        result = engine.get_result()
        size = result.resolution_y, result.resolution_x
        pictures = enlarged(beauties, job.scale, size)
        session.write_combined(engine, layer_name, pictures)


def enlarged(
    beauties: dict[str, Beauty], scale: int, size: tuple[int, int]
) -> dict[str, Array]:
    """By view, the radiance and alpha of a region of `size` (H, W) without a network.

    They are (H, W, 4).
    """
    return {
        view: bilinear(np.dstack((low.radiance, low.alpha)), scale, low.offset, size)
        for view, low in beauties.items()
    }


def _quick(job: RenderJob) -> RenderJob:
    return replace(job, denoise="fast", denoiser=None)
