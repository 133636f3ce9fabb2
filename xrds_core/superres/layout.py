"""The two layouts of a picture: numpy's (H, W, C) and torch's (1, C, H, W)."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from ..arrays import Array


def to_planes(picture: Array) -> Tensor:
    """Return (H, W, C) as a float32 tensor (1, C, H, W) over the same memory.

    The channels stay side by side in it: convolutions add up such tensors in another
    order than those of separate planes, and so round otherwise.
    """
    pixels = torch.from_numpy(np.ascontiguousarray(picture, np.float32))
    return pixels.permute(2, 0, 1)[None]


def to_picture(planes: Tensor) -> Array:
    """Return a tensor (1, C, H, W) on any device as an array (H, W, C)."""
    return np.ascontiguousarray(planes[0].permute(1, 2, 0).cpu().numpy())
