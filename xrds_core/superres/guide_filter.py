"""Prefilter for albedo and normal of few samples, before a network sees them.

Guides of more samples are denoised by Open Image Denoise (`guide_noise`). Not from the
paper. A small network predicts for every pixel two kernels over its neighbours, one for
albedo and one for normal, as Bako et al. do, "Kernel-Predicting Convolutional Networks
for Denoising Monte Carlo Renderings" (2017). It learns from pairs of noisy renders
alone: Lehtinen et al., "Noise2Noise" (2018). Shape letters as in `network`.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

FEW_SAMPLES = 4
"""Guides of fewer samples per pixel are filtered; of more, it removes fine texture
that is worth as much as the noise."""

KERNEL = 3  # pixels along one side
TAPS = KERNEL**2
PICTURES = 2  # albedo and normal
STRIDE = 2  # pixels along one side that share the features their kernels are made of
WIDTH = 24
LAYERS = 2
# Logit of the kernels' centres, untrained: three quarters of the weight.
CENTRE = 3.0
ALBEDO_FLOOR = 0.02  # added to albedo before its logarithm
# Blend from the rendered to the filtered value; the rest preserves some of the texture
# that was mistaken for noise.
STRENGTH = 0.75
BAND = 128  # rows that are filtered at once
# As far as a pixel looks, rounded up to whole strides.
MARGIN = STRIDE * (LAYERS + KERNEL // 2)


def filter_guides(network: GuideFilter, guides: Tensor) -> Tensor:
    """Return guides of few samples, as `GuideFilter.forward`'s, with less noise."""
    return torch.lerp(guides, network(guides), STRENGTH)


class GuideFilter(nn.Module):
    """Means over each pixel's neighbours, weighted by predicted kernels."""

    def __init__(self) -> None:
        super().__init__()
        counts = [6 * STRIDE**2, *[WIDTH] * LAYERS]
        self.layers = nn.ModuleList(
            nn.Conv2d(inputs, WIDTH, 3, padding=1, padding_mode="replicate")
            for inputs in counts[:-1]
        )
        self.predict = nn.Conv2d(WIDTH, PICTURES * TAPS * STRIDE**2, 1)
        nn.init.zeros_(self.predict.weight)
        bias = torch.zeros(PICTURES, TAPS, STRIDE**2)
        bias[:, TAPS // 2] = CENTRE
        self.predict.bias = nn.Parameter(bias.flatten())

    def forward(self, guides: Tensor) -> Tensor:
        """Filter (B, 6, H, W): albedo in [0, 1] and normal, float32."""
        height = guides.shape[-2]
        bands = []
        for top in range(0, height, BAND):
            first = max(top - MARGIN, 0)
            bottom = min(top + BAND, height)
            seen = guides[..., first : min(bottom + MARGIN, height), :]
            bands.append(self.band(seen)[..., top - first : bottom - first, :])
        return torch.cat(bands, dim=-2)

    def band(self, guides: Tensor) -> Tensor:
        """The same of a few rows, the first and the last of which may lack some."""
        height, width = guides.shape[-2:]
        kernels = self.kernels(guides)
        side = KERNEL // 2
        around = F.pad(guides, (side, side, side, side), mode="replicate")
        sums = [torch.zeros_like(guides[:, :3]) for _ in range(PICTURES)]
        for tap in range(TAPS):
            y, x = divmod(tap, KERNEL)
            near = around[..., y : y + height, x : x + width].split(3, dim=1)
            sums = [
                torch.addcmul(total, kernels[:, i, tap, None], picture)
                for i, (total, picture) in enumerate(zip(sums, near, strict=True))
            ]
        return torch.cat(sums, dim=1)

    def kernels(self, guides: Tensor) -> Tensor:
        """Softmax over the neighbours: (B, 2, 9, H, W) of (B, 6, H, W)."""
        height, width = guides.shape[-2:]
        even = (0, width % STRIDE, 0, height % STRIDE)
        albedo, normal = guides.split(3, dim=1)
        # about as large as the normal's components
        albedo = (albedo + ALBEDO_FLOOR).log() / 2 + 0.8
        x = F.pad(torch.cat((albedo, normal), dim=1), even, mode="replicate")
        x = F.pixel_unshuffle(x, STRIDE)
        for layer in self.layers:
            x = layer(x).relu()
        logits = F.pixel_shuffle(self.predict(x), STRIDE)[..., :height, :width]
        return logits.unflatten(1, (PICTURES, TAPS)).softmax(dim=2)
