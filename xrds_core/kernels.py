"""The base of the small presets: predicted kernels over demodulated radiance.

Not from the paper. Shape letters as in `network`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from .regression import ALBEDO_EPSILON, FEATURES, explain

# Added to the radiance of `full` guides, in units of k e x, before it divides.
RADIANCE_EPSILON = 0.05
# Unit of the predicted sharpness: logits per squared distance between guides.
SHARPNESS_UNIT = 4.0
# Bicubic interpolation may leave bilinear by this share of it: spikes do not ring.
SHARPENING_LIMIT = 0.3
# The base may brighten or darken what its kernels gather by this factor at most.
GAIN_LIMIT = 4.0
# Steps towards a picture whose area means are the low-resolution radiance, the factor
# that one step may change a pixel by, and what is added to both sides of its quotient.
MATCHING_STEPS, MATCHING_LIMIT, MATCHING_EPSILON = 2, 3.0, 0.02
# Logit of how far a step goes, untrained.
TRUST = 3.0


class Source(NamedTuple):
    """Linear radiance for kernels to gather, and what then multiplies it."""

    low: Tensor  # (B, 3, h, w)
    modulator: Tensor  # (B, 3 or 1, H, W)


Sources = list[Source]

FACTS = FEATURES + 1


def find_sources(
    radiance: Tensor, noisy: Tensor, guides: Tensor, scale: int
) -> tuple[Sources, Tensor]:
    """The radiance as it is and demodulated in several ways, and facts (B, 5, h, w).

    By albedo, by the radiance of `full` guides, and last by what albedo and normal
    explain of it around every pixel; see `regression.explain`, which also restores
    what denoising took away. The facts are the slopes found there, and the mean over
    the colours of the grain.

    `radiance` and `noisy` (B, 3, h, w) are in the transfer domain. The division is by
    the area mean of the modulator, so that modulating again keeps the mean of the
    low-resolution pixel.
    """
    guides = guides.float()
    low, grain, explained, slopes = explain(
        torch.expm1(radiance.float()), torch.expm1(noisy.float()), guides, scale
    )
    plain = Source(low, torch.ones_like(guides[:, :1]))
    modulators = [guides[:, :3] + ALBEDO_EPSILON]
    if guides.shape[1] > 6:
        modulators.append(torch.expm1(guides[:, 6:9]) + RADIANCE_EPSILON)
    modulators.append(explained)
    demodulated = [Source(low / F.avg_pool2d(m, scale), m) for m in modulators]
    return [plain, *demodulated], torch.cat((slopes, grain.mean(1, True)), dim=1)


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
    every source of `find_sources`, modulated at the pixel. What bicubic
    interpolation adds to bilinear is added to each source: a low-resolution pixel is
    the mean over its area, which is smoother than the picture. A gain, bounded by
    `GAIN_LIMIT`, scales the result. So nothing turns negative or becomes coloured by
    itself. At last the picture's area means are brought near the low-resolution
    radiance. Kernels start from bilinear weights and fall with the distance between
    guides, as a joint bilateral filter's, as fast as the network asks; untrained, the
    result is all but bicubic interpolation of the last source.
    """

    def __init__(
        self,
        scale: int,
        cell: int,
        channels: int,
        width: int,
        guides: int,
        sources: int,
    ) -> None:
        super().__init__()
        self.scale, self.cell = scale, cell
        # unbounded features make every softmax a hard choice, which no longer learns
        self.norm = nn.LayerNorm(channels)
        self.expand = nn.Conv2d(channels, width * cell**2, 3, padding=1)
        # features, guides, and how the other sources differ from plain radiance
        inputs = width + guides + 3 * (sources - 1)
        self.mix = nn.Conv2d(inputs, width, 3, padding=1)
        # per pixel: logits of sources, sharpness by albedo and by normal, gain, trust
        self.predict = nn.Conv2d(width, 9 * sources + 4, 1)
        for parameter in self.predict.parameters():
            nn.init.zeros_(parameter)
        prior = torch.tensor([-3.0] * (sources - 1) + [0.0])
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
        # sums over radiance need float32, whatever the precision of the layers above
        x = self.predict(x).float()
        picture = self.combine(x[:, :-1], guides.float(), sources)
        return torch.log1p(self.match(picture, x[:, -1:], sources[0].low))

    def enlarge(self, low: Tensor, mode: str) -> Tensor:
        return F.interpolate(low, scale_factor=self.scale, mode=mode)

    def combine(self, predicted: Tensor, guides: Tensor, sources: Sources) -> Tensor:
        predicted = self.fold(predicted)  # (B, n, s*s, h, w)
        kernels = self.kernels(predicted, guides)
        out = torch.zeros((), device=guides.device)
        for m, (low, modulator) in enumerate(sources):
            kernel = kernels[:, m]  # (B, 9, s*s, h, w)
            sharp = self.fold(self.sharpening(low))
            gathered = self.gather(kernel, low) + kernel.sum(1, True) * sharp
            out = out + gathered * self.fold(modulator)
        gain = torch.exp(math.log(GAIN_LIMIT) * torch.tanh(predicted[:, -1:]))
        return F.pixel_shuffle((out * gain).clamp(min=0).flatten(1, 2), self.scale)

    def match(self, picture: Tensor, trust: Tensor, low: Tensor) -> Tensor:
        """Bring the area means of the picture near the low-resolution radiance.

        Back-projection (Irani and Peleg, 1991) by factors, so that black stays black;
        where the radiance is noise rather than picture, `trust` can withhold it.
        """
        power = torch.sigmoid(F.avg_pool2d(trust, self.scale) + TRUST)
        most = math.log(MATCHING_LIMIT)
        for _ in range(MATCHING_STEPS):
            means = F.avg_pool2d(picture, self.scale) + MATCHING_EPSILON
            factor = ((low + MATCHING_EPSILON) / means).log() * power
            factor = factor.clamp(-most, most).exp()
            picture = picture * self.enlarge(factor, "bilinear")
        return picture

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
