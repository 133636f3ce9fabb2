"""What can render here: denoisers, PyTorch, weights. Cheap enough for a panel."""

from __future__ import annotations

from pathlib import Path

from xrds_core.superres.weights_header import WeightsHeader, headers, read_header

from ..cycles import session
from ..planning.budget import Network
from ..planning.ways import Means
from . import denoisers, torch_folder


def means(weights: str | Path | None = None) -> Means:
    """What is installed; nothing of it is loaded. `weights` as in a RenderJob."""
    return Means(
        denoiser=denoisers.is_there(),
        cycles_denoiser=session.has_denoiser(),
        torch=torch_folder.is_there(),
        networks=frozenset(networks_at_hand(weights)),
    )


def networks_at_hand(weights: str | Path | None = None) -> list[Network]:
    """Those whose weights are there."""
    found = weights_headers(weights)
    return [Network(each.preset, each.scale) for each in found]


def weights_headers(weights: str | Path | None = None) -> list[WeightsHeader]:
    """What the weights at hand are for; of the shipped ones by default."""
    if weights is None:
        return headers()
    path = Path(weights)
    if path.is_dir():
        return headers(path)
    header = read_header(path)
    return [] if header is None else [header]
