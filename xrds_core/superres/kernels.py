"""The base of the small presets: predicted kernels over demodulated radiance.

Not from the paper. Shape letters: B batch, C channels, h w cells or low-resolution
pixels, H W output pixels, s scale.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from .regression import ALBEDO_EPSILON, FEATURES, explain

GUIDE_COUNT = 6
"""Channels of the guides: albedo 0-2, normal 3-5."""
SOURCES = 3
"""Pictures that the base is gathered from: see `find_sources`."""

# Unit of the predicted sharpness: logits per squared distance between guides.
SHARPNESS_UNIT = 4.0
# Bicubic interpolation may leave bilinear by this share of it: spikes do not ring.
SHARPENING_LIMIT = 0.3
# The base may brighten or darken what its kernels gather by this factor at most.
GAIN_LIMIT = 4.0
# Steps towards a picture whose area means are the low-resolution radiance, the factor
# that one step may change a pixel by, and what is added to both sides of its quotient.
MATCHING_STEPS, MATCHING_LIMIT, MATCHING_EPSILON = 4, 3.0, 0.02
# Logit of how far a step goes, untrained.
TRUST = 3.0
# Cells along the sides of what is enlarged at once.
AREA_SIDE = 48


class Source(NamedTuple):
    """Linear radiance for kernels to gather, and what then multiplies it."""

    low: Tensor  # (B, 3, h, w)
    modulator: Tensor  # (B, 3 or 1, H, W)


Sources = list[Source]

FACTS = FEATURES + 1


def find_sources(
    radiance: Tensor, noisy: Tensor, guides: Tensor, scale: int
) -> tuple[Sources, Tensor]:
    """Return the pictures that kernels gather from, and facts about them.

    The pictures are the radiance as it is, divided by albedo, and divided by what
    albedo and normal explain of it around every pixel: see `regression.explain`, which
    also restores what denoising took away. The division is by the area mean of the
    modulator, so that modulating again keeps the mean of the low-resolution pixel.

    Parameters
    ----------
    radiance, noisy : (B, 3, h, w) Tensor
        Radiance, denoised and before, in the transfer domain.
    guides : (B, 6, H, W) Tensor
        Albedo in [0, 1] and normal.
    scale : int
        Output pixels per low-resolution pixel along one axis.

    Returns
    -------
    sources : list of Source
        Linear radiance, and what then multiplies it.
    facts : (B, 5, h, w) Tensor
        The slopes of the regression, and the mean of the grain over the colours.
    """
    guides = guides.float()
    low, grain, explained, slopes = explain(
        torch.expm1(radiance.float()), torch.expm1(noisy.float()), guides, scale
    )
    plain = Source(low, torch.ones_like(guides[:, :1]))
    modulators = (guides[:, :3] + ALBEDO_EPSILON, explained)
    demodulated = [Source(low / F.avg_pool2d(m, scale), m) for m in modulators]
    return [plain, *demodulated], torch.cat((slopes, grain.mean(1, True)), dim=1)


def neighbours(low: Tensor) -> list[Tensor]:
    """The 3x3 neighbours of every pixel: nine (B, C, 1, h, w) of (B, C, h+2, w+2)."""
    h, w = (size - 2 for size in low.shape[-2:])
    return [low[:, :, None, y : y + h, x : x + w] for y in range(3) for x in range(3)]


def with_rim(x: Tensor) -> Tensor:
    """Repeat the edge once: (B, C, h, w) to (B, C, h+2, w+2)."""
    return F.pad(x, (1, 1, 1, 1), mode="replicate")


def bilinear_logits(scale: int) -> Tensor:
    """(9, s * s): log of the bilinear weights of the 3x3 neighbours.

    The floor keeps neighbours that bilinear interpolation leaves out within reach.
    """
    offset = (torch.arange(scale) + 0.5) / scale - 0.5  # of output pixels in their cell
    axis = torch.stack((-offset, 1 - offset.abs(), offset)).clamp(min=0)  # (3, s)
    weights = axis[:, None, :, None] * axis[None, :, None, :]  # (3, 3, s, s)
    return (weights + 0.01).log().view(9, scale * scale)


class Area(NamedTuple):
    """A rectangle: rows from `top` to `bottom`, columns from `left` to `right`.

    Of cells, unless its name says what else.
    """

    top: int
    bottom: int
    left: int
    right: int

    def times(self, unit: int) -> Area:
        """The same of what its grid has `unit` squared of for each cell."""
        return Area(*(unit * edge for edge in self))

    def grown(self, margin: int, height: int, width: int) -> Area:
        """With a margin, as far as a grid of that size has it."""
        return Area(
            max(self.top - margin, 0),
            min(self.bottom + margin, height),
            max(self.left - margin, 0),
            min(self.right + margin, width),
        )

    def of(
        self, x: Tensor, unit: int, within: Area | None = None, rim: int = 0
    ) -> Tensor:
        """Crop planes to the area.

        Parameters
        ----------
        x : (..., H, W) Tensor
            Planes of the whole grid, or of the area `within`, with a rim around it.
        unit : int
            Pixels per cell along one axis.
        within : Area, optional
            What `x` shows, if not the whole grid.
        rim : int
            Width of the rim, which the result has as well.

        Returns
        -------
        cropped : (..., h, w) Tensor
        """
        top, left = (0, 0) if within is None else (within.top, within.left)
        return x[
            ...,
            (self.top - top) * unit : (self.bottom - top) * unit + 2 * rim,
            (self.left - left) * unit : (self.right - left) * unit + 2 * rim,
        ]


def replicated(x: Tensor, seen: Area, area: Area) -> Tensor:
    """What is seen of an area with the edge repeated where its rim was cut off."""
    missing = (
        seen.left - area.left + 1,
        area.right - seen.right + 1,
        seen.top - area.top + 1,
        area.bottom - seen.bottom + 1,
    )
    return F.pad(x, missing, mode="replicate") if any(missing) else x


def areas(height: int, width: int, side: int) -> list[list[Area]]:
    """Rows of rectangles, of at most `side` squared cells, that cover a grid."""
    return [
        [
            Area(top, min(top + side, height), left, min(left + side, width))
            for left in range(0, width, side)
        ]
        for top in range(0, height, side)
    ]


class PixelLayer(nn.Conv2d):
    """A 1x1 convolution of (B, C, ...), as one product of matrices.

    On a processor that is several times faster.
    """

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__(inputs, outputs, 1)

    def forward(self, x: Tensor) -> Tensor:
        assert self.bias is not None
        out = torch.matmul(self.weight.flatten(1), x.flatten(2)) + self.bias[:, None]
        return out.unflatten(2, x.shape[2:])


class KernelTail(nn.Module):
    """The demodulated base, its kernels predicted.

    Every output pixel is a convex combination of its 3x3 low-resolution neighbours in
    every source of `find_sources`, modulated at the pixel. What bicubic interpolation
    adds to bilinear is added to each source: a low-resolution pixel is the mean over
    its area, which is smoother than the picture. A gain, bounded by `GAIN_LIMIT`,
    scales the result. So nothing turns negative or becomes coloured by itself. At last
    the picture's area means are brought near the low-resolution radiance. Kernels start
    from bilinear weights and fall with the distance between guides, like those of a
    joint bilateral filter, as fast as the network predicts; untrained, the result is
    almost bicubic interpolation of the last source.

    The kernels of a whole frame are dozens of planes of its size. They are made, used
    and forgotten area by area, small enough for the processor's caches.

    Parameters
    ----------
    scale, cell : int
        Output pixels per low-resolution pixel and per cell, along one axis.
    channels : int
        Channels of the features.
    width : int
        Full-resolution channels of the kernel predictor.
    """

    def __init__(self, scale: int, cell: int, channels: int, width: int) -> None:
        super().__init__()
        self.scale, self.cell = scale, cell
        self.area_side = AREA_SIDE
        # unbounded features make every softmax a hard choice, which no longer learns
        self.norm = nn.LayerNorm(channels)
        # what these two are given has a rim
        self.expand = nn.Conv2d(channels, width * cell**2, 3)
        # features, guides, and how the other sources differ from plain radiance
        inputs = width + GUIDE_COUNT + 3 * (SOURCES - 1)
        self.mix = nn.Conv2d(inputs, width, 3)
        # per pixel: logits of sources, sharpness by albedo and by normal, gain, trust
        self.predict = PixelLayer(width, 9 * SOURCES + 4)
        for parameter in self.predict.parameters():
            nn.init.zeros_(parameter)
        prior = torch.tensor([-3.0] * (SOURCES - 1) + [0.0])
        logits = prior[:, None, None] + bilinear_logits(scale)
        self.prior: Tensor
        self.register_buffer("prior", logits, persistent=False)

    def forward(self, features: Tensor, guides: Tensor, sources: Sources) -> Tensor:
        cells = self.norm(features.permute(0, 2, 3, 1)).permute(0, 3, 1, 2)
        height, width = cells.shape[-2:]
        cells = with_rim(cells.contiguous())
        means = F.avg_pool2d(guides.float(), self.scale)
        squares = (x.square().sum(1, True) for x in means.split(3, dim=1))
        means = with_rim(torch.cat((means, *squares), dim=1))
        rims = [with_rim(source.low) for source in sources]
        pictures, trusts = [], []
        for row in areas(height, width, self.area_side):
            parts = []
            for area in row:
                predicted, sharp = self.look(area, cells, guides, sources)
                kernels = self.kernels(area, predicted, guides, means)
                picture = self.combine(area, kernels, sharp, rims, sources)
                gain = torch.exp(math.log(GAIN_LIMIT) * torch.tanh(predicted[:, -2:-1]))
                parts.append((self.unfold(picture * gain), predicted[:, -1:].mean(2)))
            pictures.append(torch.cat([picture for picture, _ in parts], dim=3))
            trusts.append(torch.cat([trust for _, trust in parts], dim=3))
        picture, trust = torch.cat(pictures, dim=2), torch.cat(trusts, dim=2)
        return torch.log1p(self.match(picture, trust, sources[0].low))

    def look(
        self, area: Area, cells: Tensor, guides: Tensor, sources: Sources
    ) -> tuple[Tensor, list[Tensor]]:
        """Predict the kernels of every pixel of an area.

        The last convolution sees a pixel around the area, and replicates those that the
        picture does not have.

        Parameters
        ----------
        area : Area
            The area, in cells.
        cells : (B, C, h, w) Tensor
            Features of all cells, with a rim.
        guides : (B, 6, H, W) Tensor
            Albedo and normal.
        sources : list of Source
            What kernels gather from.

        Returns
        -------
        predicted : (B, 9 * SOURCES + 4, s*s, h, w) Tensor
            Logits, sharpness by albedo and by normal, gain and trust.
        sharpening : list of (B, 3, s*s, h, w) Tensor
            What is added to each source.
        """
        height, width = guides.shape[-2:]
        pixels = area.times(self.cell)
        seen = pixels.grown(1, height, width)
        near = area.grown(1, height // self.cell, width // self.cell)
        x = F.pixel_shuffle(self.expand(near.of(cells, 1, rim=1)), self.cell)
        # bicubic interpolation takes two low-resolution pixels to each side
        lows = area.times(self.cell // self.scale)
        lows = lows.grown(2, height // self.scale, width // self.scale)
        enlarged = lows.times(self.scale)
        logs, sharp = [], []
        for source in sources:
            low = lows.of(source.low, 1)
            smooth = self.enlarge(low, "bilinear")
            most = SHARPENING_LIMIT * smooth
            added = (self.enlarge(low, "bicubic") - smooth).clamp(-most, most)
            sharp.append(self.fold(pixels.of(added, 1, enlarged)))
            smooth = seen.of(smooth, 1, enlarged) * seen.of(source.modulator, 1)
            logs.append(torch.log1p(smooth))
        differences = [other - logs[0] for other in logs[1:]]
        known = (
            seen.of(x, 1, near.times(self.cell)),
            seen.of(guides, 1),
            *differences,
        )
        x = F.relu(self.mix(replicated(torch.cat(known, dim=1), seen, pixels)))
        # this layer does not care where pixels lie: fewer planes to fold before it
        # sums over radiance need float32, whatever the precision of the layers above
        return self.predict(self.fold(x)).float(), sharp

    def kernels(
        self, area: Area, predicted: Tensor, guides: Tensor, means: Tensor
    ) -> Tensor:
        """Return the weights of the neighbours in all sources.

        They fall with the squared distance between the pixel's guides and a neighbour's
        means. The square of the pixel's own is the same for all, and left out.

        Parameters
        ----------
        area : Area
            The area, in cells.
        predicted : (B, 9 * SOURCES + 4, s*s, h, w) Tensor
            What `look` predicts.
        guides : (B, 6, H, W) Tensor
            Albedo and normal.
        means : (B, 8, h, w) Tensor
            Area means of the guides and their squared lengths, with a rim.

        Returns
        -------
        kernels : (B, SOURCES, 9, s*s, h, w) Tensor
            A softmax over sources and neighbours.
        """
        pixels = self.fold(area.of(guides, self.cell)).float()
        albedo, normal = (SHARPNESS_UNIT * predicted[:, -4:-2]).split(1, dim=1)
        twice = torch.cat((pixels[:, :3] * albedo, pixels[:, 3:] * normal), dim=1) * 2
        twice = twice.split(1, dim=1)
        near = []
        for mean in neighbours(area.of(means, self.cell // self.scale, rim=1)):
            *guide, albedo_square, normal_square = mean.split(1, dim=1)
            logit = -albedo * albedo_square
            logit = torch.addcmul(logit, normal, normal_square, value=-1)
            for x, y in zip(twice, guide, strict=True):
                logit = torch.addcmul(logit, x, y)
            near.append(logit)
        logits = predicted[:, :-4].unflatten(1, (-1, 9)) + self.prior[..., None, None]
        logits = logits + torch.cat(near, dim=1)[:, None]
        return logits.flatten(1, 2).softmax(dim=1).unflatten(1, (-1, 9))

    def combine(
        self,
        area: Area,
        kernels: Tensor,
        sharp: list[Tensor],
        rims: list[Tensor],
        sources: Sources,
    ) -> Tensor:
        """What the kernels gather of all sources, modulated: (B, 3, s*s, h, w)."""
        out = torch.zeros_like(sharp[0])
        for m, source in enumerate(sources):
            kernel = kernels[:, m]  # (B, 9, s*s, h, w)
            filtered = kernel.sum(1, keepdim=True) * sharp[m]
            low = area.of(rims[m], self.cell // self.scale, rim=1)
            for k, neighbour in enumerate(neighbours(low)):
                filtered = torch.addcmul(filtered, kernel[:, k, None], neighbour)
            modulator = self.fold(area.of(source.modulator, self.cell))
            out = torch.addcmul(out, filtered, modulator)
        return out.clamp(min=0)

    def match(self, picture: Tensor, trust: Tensor, low: Tensor) -> Tensor:
        """Bring the area means of the picture near the low-resolution radiance.

        Back-projection [1]_ by factors, so that black stays black; where the radiance
        is noise rather than picture, `trust` can withhold it.

        Parameters
        ----------
        picture : (B, 3, H, W) Tensor
            Linear radiance.
        trust : (B, 1, h, w) Tensor
            Predicted logit of how far a step goes.
        low : (B, 3, h, w) Tensor
            Linear low-resolution radiance.

        Returns
        -------
        matched : (B, 3, H, W) Tensor

        References
        ----------
        .. [1] Irani, M. and Peleg, S. (1991). Improving resolution by image
           registration.
        """
        power = torch.sigmoid(trust + TRUST)
        most = math.log(MATCHING_LIMIT)
        for _ in range(MATCHING_STEPS):
            means = F.avg_pool2d(picture, self.scale) + MATCHING_EPSILON
            factor = ((low + MATCHING_EPSILON) / means).log() * power
            factor = factor.clamp(-most, most).exp()
            picture = picture * self.enlarge(factor, "bilinear")
        return picture

    def enlarge(self, low: Tensor, mode: str) -> Tensor:
        return F.interpolate(low, scale_factor=self.scale, mode=mode)

    def fold(self, x: Tensor) -> Tensor:
        """(B, C, H, W) to (B, C, s*s, h, w)."""
        return F.pixel_unshuffle(x, self.scale).unflatten(1, (x.shape[1], -1))

    def unfold(self, x: Tensor) -> Tensor:
        """(B, C, s*s, h, w) to (B, C, H, W)."""
        return F.pixel_shuffle(x.flatten(1, 2), self.scale)
