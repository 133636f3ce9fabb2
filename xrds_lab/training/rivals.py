"""Single-image networks that XRDS is compared with, as they were published.

They see no guides. RCAN and SwinIR are those of the library `spandrel`
(github.com/chaiNNer-org/spandrel), without pretrained weights.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from types import ModuleType

import torch
from torch import Tensor, nn

from xrds_core.errors import UsageError

RESIDUAL_SCALE = 0.1  # of EDSR's blocks, against divergence


class Rival(nn.Module):
    """A network of the radiance alone, called as `XRDS` is."""

    def __init__(self, network: nn.Module) -> None:
        super().__init__()
        self.network = network

    def forward(
        self, radiance: Tensor, guides: Tensor, noisy: Tensor | None = None
    ) -> Tensor:
        """(B, 3, h, w) to (B, 3, s h, s w), both in the transfer domain."""
        return self.network(radiance.clone())  # RCAN writes into what it is given


class EDSR(nn.Module):
    """Lim et al., "Enhanced Deep Residual Networks for Single Image SR" (2017)."""

    def __init__(self, scale: int, channels: int = 256, blocks: int = 32) -> None:
        super().__init__()

        def conv(outputs: int) -> nn.Conv2d:
            return nn.Conv2d(channels, outputs, 3, padding=1)

        self.head = nn.Conv2d(3, channels, 3, padding=1)
        self.blocks = nn.ModuleList(
            nn.Sequential(conv(channels), nn.ReLU(), conv(channels))
            for _ in range(blocks)
        )
        self.end = conv(channels)
        steps = (
            nn.Sequential(conv(4 * channels), nn.PixelShuffle(2))
            for _ in range(int(math.log2(scale)))
        )
        self.tail = nn.Sequential(*steps, conv(3))

    def forward(self, x: Tensor) -> Tensor:
        x = head = self.head(x)
        for block in self.blocks:
            x = x + RESIDUAL_SCALE * block(x)
        return self.tail(head + self.end(x))


def rcan(scale: int) -> nn.Module:
    """Zhang et al., "Image SR Using Very Deep Residual Channel Attention" (2018)."""
    return _spandrel().RCAN.RCAN(scale=scale, norm=False)


def swinir(scale: int) -> nn.Module:
    """Liang et al., "SwinIR" (2021), its classical network."""
    network = _spandrel().SwinIR.SwinIR(
        upscale=scale,
        window_size=8,
        embed_dim=180,
        depths=[6] * 6,
        num_heads=[6] * 6,
        mlp_ratio=2,
        upsampler="pixelshuffle",
    )
    del network.mean  # of photographs, and on the CPU wherever the network is
    network.register_buffer("mean", torch.zeros(1, 3, 1, 1), persistent=False)
    return network


def _spandrel() -> ModuleType:
    try:
        from spandrel import architectures
    except (ImportError, RuntimeError) as error:  # torchvision of another torch
        raise UsageError(
            f"this network is the library spandrel's ({error}): "
            "pip install spandrel torchvision"
        ) from error
    return architectures


RIVALS: dict[str, Callable[[int], nn.Module]] = {
    "edsr": EDSR,
    "rcan": rcan,
    "swinir": swinir,
}


def build_rival(name: str, scale: int) -> nn.Module:
    """One of `RIVALS`, untrained; UsageError where its library is missing."""
    return Rival(RIVALS[name](scale))
