"""Which networks there are, and the one that a job needs, loaded."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from xrds_core.errors import XRDSError

from ..planning.budget import Network
from . import torch_folder
from .job import RenderJob
from .means import networks_at_hand

if TYPE_CHECKING:
    from xrds_core import Upscaler


def load_upscaler(job: RenderJob) -> Upscaler:
    """The network of a job; the last one stays loaded for the next frame."""
    weights = None if job.weights is None else str(job.weights)
    upscaler = _load(job.preset, job.scale, job.device, weights)
    if job.threads is not None:
        import torch

        torch.set_num_threads(job.threads)
    return upscaler


@lru_cache(maxsize=1)
def _load(preset: str, scale: int, device: str, weights: str | None) -> Upscaler:
    upscaler_class: type[Upscaler] = torch_folder.load("superres.upscaler").Upscaler
    return upscaler_class(preset, scale, device, weights=weights)


def known_networks(job: RenderJob) -> list[Network]:
    """Those whose weights are there; none for plain renders or without PyTorch.

    By the files' headers alone: a budget has no seconds for the rest of them.
    """
    if job.plain:
        return []
    try:
        torch_folder.load("superres.weights")
    except XRDSError:
        return []
    if job.weights is not None and not Path(job.weights).is_dir():
        return [Network(job.preset, job.scale)]
    return networks_at_hand(job.weights)
