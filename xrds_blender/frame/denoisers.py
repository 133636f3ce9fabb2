"""The denoiser of a job, kept from frame to frame."""

from __future__ import annotations

from functools import lru_cache
from importlib.util import find_spec
from typing import TYPE_CHECKING

from xrds_core.errors import XRDSError

from ..cycles import session
from .job import RenderJob

if TYPE_CHECKING:
    from xrds_core.denoising import Denoiser

    from ..cycles.passes import InProcess


def load_denoiser(job: RenderJob) -> Denoiser:
    """The denoiser of a job; the last two stay for the next frame.

    The network's graphics card may be one that this library does not know: it takes
    the fastest device by itself. Raises XRDSError where it cannot be loaded.
    """
    device = "cpu" if job.device == "cpu" else "auto"
    return _load(job.denoise, device, job.threads or 0, job.memory_limit)


def is_there() -> bool:
    """Whether the library is installed; nothing is loaded, so a panel may ask."""
    return find_spec("mitsuba_oidn") is not None


def in_process(job: RenderJob) -> InProcess | None:
    """Our denoiser for the low-resolution picture, in the place of Cycles'.

    None where Cycles' own is asked for and there, or ours cannot be loaded.
    """
    if job.denoiser is not None and session.has_denoiser():
        return None
    try:
        denoiser = load_denoiser(job)
    except XRDSError:
        return None
    return lambda picture, albedo, normal: denoiser(picture, albedo, normal).radiance


@lru_cache(maxsize=2)  # alpha and stopped pictures take another quality
def _load(
    quality: str, device: str, threads: int, memory_limit: int | None
) -> Denoiser:
    from xrds_core.denoising import Denoiser

    return Denoiser(quality, device, threads=threads, memory_limit=memory_limit)
