"""The guides' alpha without the noise of its few samples.

Alpha is the share of samples that met something, so of four samples silhouettes are
ragged and glass is mottled. The denoiser takes alpha for a grey picture.
"""

from __future__ import annotations

import numpy as np

from xrds_core.arrays import Array
from xrds_core.errors import XRDSError

from ..cycles.rendered import Guides
from ..planning.request import Machine
from .denoisers import load_denoiser


def cover(guides: Guides, machine: Machine) -> Array:
    """Alpha (H, W) of the guides, denoised; as it is where nothing can denoise.

    Where it is 0 or 1 all around a pixel it stays so.
    """
    alpha = np.clip(guides.alpha, 0.0, 1.0)
    if guides.samples is None or alpha.min() >= 1.0:
        return guides.alpha
    try:
        denoiser = load_denoiser("fast", machine)
    except XRDSError:
        return guides.alpha
    grey = np.repeat(alpha[..., None], 3, axis=2)
    smooth = np.clip(denoiser(grey).radiance[..., :3].mean(-1), 0.0, 1.0)
    return np.where(_is_even(alpha), alpha, smooth).astype(np.float32)


def _is_even(alpha: Array) -> Array:
    """Where a pixel and its eight neighbours are all 0 or all 1."""
    around = np.pad(alpha, 1, mode="edge")
    rows, columns = alpha.shape
    parts = [around[y : y + rows, x : x + columns] for y in range(3) for x in range(3)]
    return (np.min(parts, axis=0) >= 1.0) | (np.max(parts, axis=0) <= 0.0)
