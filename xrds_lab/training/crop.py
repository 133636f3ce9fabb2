"""Crops: aligned pictures of one place, and their form as network inputs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
import torch
from torch import Tensor

from xrds_core.arrays import Array
from xrds_core.superres.front_end import transfer


@dataclass(frozen=True)
class Crop:
    """Pictures of one place, float32 (height, width, 3), scene-linear."""

    low: Array
    noisy: Array
    """As `low`, before denoising; the same where it was not denoised."""
    reference: Array
    albedo: Array
    normal: Array
    exposure: float

    def with_light(self, change: Callable[[Array], Array]) -> Crop:
        """Change the radiance."""
        return replace(
            self,
            low=change(self.low),
            noisy=change(self.noisy),
            reference=change(self.reference),
        )

    def with_colours(self, change: Callable[[Array], Array]) -> Crop:
        """Change radiance and albedo alike."""
        return replace(self.with_light(change), albedo=change(self.albedo))

    def with_pictures(self, change: Callable[[Array], Array]) -> Crop:
        """Change all pictures alike."""
        return replace(self.with_colours(change), normal=change(self.normal))

    def to_batch(self) -> Batch:
        """A batch of one."""
        return Batch(
            to_tensor(transfer(self.low, self.exposure)),
            to_tensor(transfer(self.noisy, self.exposure)),
            to_tensor(np.concatenate((self.albedo, self.normal), axis=-1)),
            to_tensor(transfer(self.reference, self.exposure)),
        )


@dataclass(frozen=True)
class Batch:
    """What `XRDS.forward` takes and should give, radiance in the transfer domain."""

    radiance: Tensor  # (B, 3, h, w)
    noisy: Tensor  # (B, 3, h, w)
    guides: Tensor  # (B, 6, H, W)
    reference: Tensor  # (B, 3, H, W)

    @staticmethod
    def stack(batches: Sequence[Batch]) -> Batch:
        """Concatenate along B."""
        return Batch(
            *(
                torch.cat([getattr(b, field.name) for b in batches])
                for field in fields(Batch)
            )
        )

    def to(self, device: torch.device) -> Batch:
        """The same on a device."""
        tensors = (getattr(self, field.name) for field in fields(self))
        return Batch(*(x.to(device, non_blocking=True) for x in tensors))


def to_tensor(picture: Array) -> Tensor:
    """(H, W, C) to (1, C, H, W)."""
    channels_first = np.ascontiguousarray(picture.transpose(2, 0, 1), np.float32)
    return torch.from_numpy(channels_first)[None]
