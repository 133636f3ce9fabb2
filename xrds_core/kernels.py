"""The base of the small presets: predicted kernels over demodulated radiance.

Not from the paper. Shape letters as in `network`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional as F

# Added to albedo before it divides radiance: bounds the quotient on black surfaces.
ALBEDO_EPSILON = 0.02
# The same for the radiance of `full` guides, in units of k e x.
RADIANCE_EPSILON = 0.05
# Unit of the predicted sharpness: logits per squared distance between guides.
SHARPNESS_UNIT = 4.0
# Bicubic interpolation may leave bilinear by this share of it: spikes do not ring.
SHARPENING_LIMIT = 0.3
# The base may brighten or darken what its kernels gather by this factor at most.
GAIN_LIMIT = 4.0


class Source(NamedTuple):
    """Linear radiance for kernels to gather, and what then multiplies it."""

    low: Tensor  # (B, 3, h, w)
    modulator: Tensor  # (B, 3 or 1, H, W)


Sources = list[Source]


def find_sources(radiance: Tensor, guides: Tensor, scale: int) -> Sources:
    """The radiance as it is, and demodulated by each guide that can modulate it.

    `radiance` (B, 3, h, w) is in the transfer domain. The division is by the area mean
    of the modulator, so that modulating again keeps the mean of the low-resolution
    pixel.
    """
    low = torch.expm1(radiance.float())
    guides = guides.float()
    plain = Source(low, torch.ones_like(guides[:, :1]))
    modulators = [guides[:, :3] + ALBEDO_EPSILON]
    if guides.shape[1] > 6:
        modulators.append(torch.expm1(guides[:, 6:9]) + RADIANCE_EPSILON)
    return [plain, *(Source(low / F.avg_pool2d(m, scale), m) for m in modulators)]


def neighbours(low: Tensor) -> list[Tensor]:
    """The 3x3 neighbours of every pixel, edge clamped: nine of (B, C, 1, h, w)."""
    h, w = low.shape[-2:]
    padded = F.pad(low, (1, 1, 1, 1), mode="replicate")
    return [
        padded[:, :, None, y : y + h, x : x + w] for y in range(3) for x in range(3)
    ]


def bilinear_logits(scale: int) -> Tensor:
    """(9, s * s): log of the bilinear weights of the 3x3 neighbours.

    The floor keeps neighbours that bilinear interpolation leaves out within reach.
    """
    offset = (torch.arange(scale) + 0.5) / scale - 0.5  # of output pixels in their cell
    axis = torch.stack((-offset, 1 - offset.abs(), offset)).clamp(min=0)  # (3, s)
    weights = axis[:, None, :, None] * axis[None, :, None, :]  # (3, 3, s, s)
    return (weights + 0.01).log().view(9, scale * scale)


class KernelTail(nn.Module):
    """The demodulated base, its kernels predicted.

    Every output pixel is a convex combination of its 3x3 low-resolution neighbours in
    every source: the radiance as it is, and demodulated by the albedo and, with `full`
    guides, by the full-resolution radiance, then modulated at the pixel. What bicubic
    interpolation adds to bilinear is added to each source: a low-resolution pixel is
    the mean over its area, which is smoother than the picture. A gain, bounded by
    `GAIN_LIMIT`, scales the result. So nothing turns negative or becomes coloured by
    itself. Kernels start from bilinear weights and fall with the distance between
    guides, as a joint bilateral filter's, as fast as the network asks; untrained, the
    result is bicubic interpolation of the demodulated radiance.
    """

    def __init__(
        self, scale: int, cell: int, channels: int, width: int, sources: int
    ) -> None:
        super().__init__()
        self.scale, self.cell = scale, cell
        # unbounded features make every softmax a hard choice, which no longer learns
        self.norm = nn.LayerNorm(channels)
        self.expand = nn.Conv2d(channels, width * cell**2, 3, padding=1)
        # features, guides, and how the other sources differ from plain radiance
        inputs = width + 3 * sources + 3 * (sources - 1)
        self.mix = nn.Conv2d(inputs, width, 3, padding=1)
        # per pixel: logits of each source, sharpness by albedo and by normal, gain
        self.predict = nn.Conv2d(width, 9 * sources + 3, 1)
        for parameter in self.predict.parameters():
            nn.init.zeros_(parameter)
        prior = torch.tensor([-3.0] + [0.0] * (sources - 1))  # plain radiance, others
        logits = prior[:, None, None] + bilinear_logits(scale)
        self.prior: Tensor
        self.register_buffer("prior", logits, persistent=False)

    def forward(self, features: Tensor, guides: Tensor, sources: Sources) -> Tensor:
        cells = self.norm(features.permute(0, 2, 3, 1)).permute(0, 3, 1, 2)
        x = F.pixel_shuffle(self.expand(cells), self.cell)
        plain, *others = [
            torch.log1p(self.enlarge(source.low, "bilinear") * source.modulator)
            for source in sources
        ]
        differences = [other - plain for other in others]
        x = F.relu(self.mix(torch.cat((x, guides, *differences), dim=1)))
        x = F.pixel_unshuffle(self.predict(x), self.scale)
        # sums over radiance need float32, whatever the precision of the layers above
        return torch.log1p(self.combine(x.float(), guides.float(), sources))

    def enlarge(self, low: Tensor, mode: str) -> Tensor:
        return F.interpolate(low, scale_factor=self.scale, mode=mode)

    def combine(self, predicted: Tensor, guides: Tensor, sources: Sources) -> Tensor:
        predicted = predicted.unflatten(1, (-1, self.scale**2))  # (B, n, s*s, h, w)
        kernels = self.kernels(predicted, guides)
        out = torch.zeros((), device=guides.device)
        for m, (low, modulator) in enumerate(sources):
            kernel = kernels[:, m]  # (B, 9, s*s, h, w)
            sharp = self.fold(self.sharpening(low))
            gathered = self.gather(kernel, low) + kernel.sum(1, True) * sharp
            out = out + gathered * self.fold(modulator)
        gain = torch.exp(math.log(GAIN_LIMIT) * torch.tanh(predicted[:, -1:]))
        return F.pixel_shuffle((out * gain).clamp(min=0).flatten(1, 2), self.scale)

    def sharpening(self, low: Tensor) -> Tensor:
        smooth = self.enlarge(low, "bilinear")
        most = SHARPENING_LIMIT * smooth
        return (self.enlarge(low, "bicubic") - smooth).clamp(-most, most)

    def fold(self, x: Tensor) -> Tensor:
        """(B, C, H, W) to (B, C, s*s, h, w)."""
        return F.pixel_unshuffle(x, self.scale).unflatten(1, (x.shape[1], -1))

    def kernels(self, predicted: Tensor, guides: Tensor) -> Tensor:
        """Softmax over the neighbours of all sources: (B, sources, 9, s*s, h, w)."""
        logits = predicted[:, :-3].unflatten(1, (-1, 9)) + self.prior[..., None, None]
        distance = torch.zeros_like(logits[:, 0])
        for channel, guide in ((-3, guides[:, :3]), (-2, guides[:, 3:6])):
            sharpness = SHARPNESS_UNIT * predicted[:, channel, None]
            distance = distance + sharpness * self.distances(guide)
        logits = logits - distance[:, None]
        return logits.flatten(1, 2).softmax(dim=1).unflatten(1, (-1, 9))

    def distances(self, guide: Tensor) -> Tensor:
        """Squared distance of pixels' guides to neighbours': (B, 9, s*s, h, w)."""
        cells = self.fold(guide)
        means = neighbours(F.avg_pool2d(guide, self.scale))
        return torch.stack([(cells - mean).square().sum(1) for mean in means], dim=1)

    @staticmethod
    def gather(kernel: Tensor, low: Tensor) -> Tensor:
        """Kernels (B, 9, s*s, h, w) over (B, 3, h, w): (B, 3, s*s, h, w)."""
        taps = (kernel[:, k, None] * x for k, x in enumerate(neighbours(low)))
        return sum(taps, torch.zeros((), device=low.device))
