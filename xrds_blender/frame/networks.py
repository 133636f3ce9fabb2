"""The network that an enlargement needs, loaded."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

from xrds_core.errors import XRDSError

from ..planning.request import Machine
from ..planning.settings import Network
from . import torch_folder

if TYPE_CHECKING:
    from xrds_core import Upscaler


def load_upscaler(network: Network, machine: Machine) -> Upscaler:
    """A network, loaded; the last one stays for the next frame."""
    weights = None if machine.weights is None else str(machine.weights)
    upscaler = _load(network, machine.device, weights)
    if machine.threads is not None:
        import torch

        torch.set_num_threads(machine.threads)
    return upscaler


@lru_cache(maxsize=1)
def _load(network: Network, device: str, weights: str | None) -> Upscaler:
    preset, scale = network
    upscaler_class: type[Upscaler] = torch_folder.load("superres.upscaler").Upscaler
    return upscaler_class(preset, scale, device=device, weights=weights)


def is_ready() -> bool:
    """Whether PyTorch can be loaded; it then is."""
    try:
        torch_folder.load("superres.weights")
    except XRDSError:
        return False
    return True
