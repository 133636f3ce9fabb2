"""What renders here, loaded and kept from frame to frame: our denoiser, a network."""

from __future__ import annotations

from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from xrds_core.errors import XRDSError
from xrds_core.superres.weights_header import WeightsHeader, headers, read_header

from ..cycles import session
from ..planning.estimates import Capabilities
from ..planning.request import Machine
from ..planning.settings import Denoising, Network
from . import torch_folder

if TYPE_CHECKING:
    from xrds_core import Upscaler
    from xrds_core.denoising import Denoiser

    from ..cycles.passes import InProcess


def load_denoiser(quality: str, machine: Machine) -> Denoiser:
    """Our denoiser of a quality; the last two stay for the next frame.

    The network's graphics card may be one that this library does not know: it takes
    the fastest device by itself. Raises XRDSError where it cannot be loaded.
    """
    device = "cpu" if machine.device == "cpu" else "auto"
    return _open_denoiser(quality, device, machine.threads or 0, machine.memory_limit)


def has_library() -> bool:
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
def _open_denoiser(
    quality: str, device: str, threads: int, memory_limit: int | None
) -> Denoiser:
    from xrds_core.denoising import Denoiser

    return Denoiser(quality, device, threads=threads, memory_limit=memory_limit)


def load_upscaler(network: Network, machine: Machine) -> Upscaler:
    """A network, loaded; the last one stays for the next frame."""
    weights = None if machine.weights is None else str(machine.weights)
    upscaler = _load_network(network, machine.device, weights)
    if machine.threads is not None:
        import torch

        torch.set_num_threads(machine.threads)
    return upscaler


@lru_cache(maxsize=1)
def _load_network(network: Network, device: str, weights: str | None) -> Upscaler:
    preset, scale = network
    upscaler_class: type[Upscaler] = torch_folder.load("superres.upscaler").Upscaler
    return upscaler_class(preset, scale, device=device, weights=weights)


def capabilities(weights: str | Path | None = None) -> Capabilities:
    """What is installed; nothing of it is loaded. `weights` as in a Machine."""
    return Capabilities(
        denoiser=has_library(),
        cycles_denoiser=session.has_denoiser(),
        torch=torch_folder.is_there(),
        networks=frozenset(networks_at_hand(weights)),
    )


def networks_at_hand(weights: str | Path | None = None) -> list[Network]:
    """Those whose weights are there."""
    return [Network(each.preset, each.scale) for each in weights_headers(weights)]


def weights_headers(weights: str | Path | None = None) -> list[WeightsHeader]:
    """What the weights at hand are for; of the shipped ones by default."""
    if weights is None:
        return headers()
    path = Path(weights)
    if path.is_dir():
        return headers(path)
    header = read_header(path)
    return [] if header is None else [header]
