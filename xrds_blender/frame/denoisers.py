"""Our denoiser, loaded and cached from frame to frame."""

from __future__ import annotations

from functools import lru_cache
from importlib.util import find_spec
from typing import TYPE_CHECKING

from xrds_core.errors import XRDSError

from ..cycles import session
from ..planning.request import Machine
from ..planning.settings import Denoising

if TYPE_CHECKING:
    from xrds_core.denoising import Denoiser

    from ..cycles.passes import InProcess


def load_denoiser(quality: str, machine: Machine) -> Denoiser:
    """Our denoiser of a quality; the last two stay for the next frame.

    The network's graphics card may be one that this library does not know: it takes
    the fastest device by itself. Raises XRDSError where it cannot be loaded.
    """
    device = "cpu" if machine.device == "cpu" else "auto"
    return _load(quality, device, machine.threads or 0, machine.memory_limit)


def is_there() -> bool:
    """Whether the library is installed; nothing is loaded, so a panel may ask."""
    return find_spec("mitsuba_oidn") is not None


def in_process(denoising: Denoising | None, machine: Machine) -> InProcess | None:
    """Our denoiser for the low-resolution picture, in the place of Cycles'.

    None where Cycles' own is requested and there, or ours cannot be loaded.
    """
    if denoising is None:
        denoising = Denoising.XRDS_HIGH
    if not denoising.is_ours and session.has_denoiser():
        return None
    try:
        denoiser = load_denoiser(denoising.quality, machine)
    except XRDSError:
        return None
    return lambda picture, albedo, normal: denoiser(picture, albedo, normal).radiance


@lru_cache(maxsize=2)  # alpha and stopped pictures take another quality
def _load(
    quality: str, device: str, threads: int, memory_limit: int | None
) -> Denoiser:
    from xrds_core.denoising import Denoiser

    return Denoiser(quality, device, threads=threads, memory_limit=memory_limit)
