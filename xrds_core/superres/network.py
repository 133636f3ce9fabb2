"""XRDS, the Cross-modality Residual Densely-connected Swin Transformer.

A low-resolution radiance picture and full-resolution guides (albedo, normal) go in, the
full-resolution picture comes out. `NetworkConfig()` is the paper's network at scale 4.
What the paper leaves open (the number of guide residual blocks, the deshuffle, where
features are fused) is set so that its parameter and MAC counts come out to the last
printed digit.

Names: a *cell* is one position of the grid that the transformer works on. In the paper
it is one low-resolution pixel; the small presets use coarser cells. Shape letters: B
batch, C channels, h w cells or low-resolution pixels, H W output pixels, N tokens of a
window, s scale.

References
----------
.. [1] Hou, Q. and Liu, F. Auxiliary Features-Guided Super Resolution for Monte Carlo
   Rendering.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from .kernels import FACTS, GUIDE_COUNT, SOURCES, KernelTail, Sources, find_sources


@dataclass(frozen=True)
class NetworkConfig:
    """Hyper-parameters of `XRDS`; the defaults are the paper's, at scale 4."""

    scale: int = 4
    """Output pixels per low-resolution pixel along one axis, a power of two."""
    groups: int = 3
    """Number of cross-modality dense groups (XDG)."""
    blocks: int = 5
    """Number of RDST per group."""
    channels: int = 64
    guide_channels: int = 32
    """Width of the guide branch."""
    heads: int = 2
    window_size: int = 8
    """Cells per attention window along one axis."""
    dense_layers: int = 4
    """Convolution + Swin layers of one RDST."""
    block: str = "rdst"
    """`rdst`, or the ablations `rdb` (no Swin layers) and `rstb` (SwinIR's block)."""
    cross_attention: bool = True
    """False leaves out XM: guide features are then added to radiance features."""
    cell: int = 0
    """Output pixels per cell along one axis; 0 means `scale`, the paper's grid."""
    guide_stride: int = 1
    """Guides are unshuffled by this before their first layer; divides `cell`."""
    base: bool = False
    """Predict kernels over the (demodulated) radiance instead of the radiance."""
    tail_channels: int = 12
    """Full-resolution width of the kernel predictor; only with `base`."""

    def __post_init__(self) -> None:
        if self.cell == 0:
            object.__setattr__(self, "cell", self.scale)
        for name in ("scale", "cell", "guide_stride"):
            value = getattr(self, name)
            if value < 1 or value & (value - 1):
                raise ValueError(f"{name} is {value}; it must be a power of two")
        if self.cell % self.scale or self.cell % self.guide_stride:
            raise ValueError(
                f"cell {self.cell} must be a multiple of scale {self.scale} "
                f"and of guide_stride {self.guide_stride}"
            )
        if self.block not in BLOCKS:
            raise ValueError(f"block is {self.block!r}, not one of {[*BLOCKS]}")
        if self.channels % self.heads:
            raise ValueError(
                f"channels {self.channels} must be a multiple of heads {self.heads}"
            )

    @property
    def radiance_count(self) -> int:
        """Channels that the radiance branch is given: see `find_sources`."""
        return 3 * SOURCES + FACTS if self.base else 3

    @property
    def low_multiple(self) -> int:
        """Low-resolution height and width are padded to multiples of this."""
        return self.window_size * self.cell // self.scale

    def to_dict(self) -> dict[str, Any]:
        """Plain values, fit for JSON."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> NetworkConfig:
        """The inverse of `to_dict`; raises TypeError on unknown names."""
        return cls(**values)


# What differs from the paper in the presets that are the same class, but smaller.
SMALL_PRESETS: dict[str, dict[str, Any]] = {
    "balanced": {"groups": 2, "blocks": 2, "channels": 48, "tail_channels": 24},
    "fast": {"groups": 1, "blocks": 1, "channels": 32, "tail_channels": 16},
}
PRESETS = ("paper", *SMALL_PRESETS)


def preset_config(preset: str, scale: int) -> NetworkConfig:
    """Return the configuration of a named preset.

    `balanced` and `fast` are the same class as the published network with smaller
    numbers, a grid of at most a quarter of the output, and the kernel base.

    Parameters
    ----------
    preset : {'paper', 'balanced', 'fast'}
        `paper` is the published network.
    scale : int
        Output pixels per low-resolution pixel along one axis, a power of two.

    Returns
    -------
    config : NetworkConfig

    Raises
    ------
    ValueError
        If the preset is unknown.
    """
    paper = NetworkConfig(scale=scale)
    if preset == "paper":
        return paper
    if preset not in SMALL_PRESETS:
        raise ValueError(
            f"preset is {preset!r}; it must be one of {', '.join(PRESETS)}"
        )
    sizes = SMALL_PRESETS[preset]
    width, cell = sizes["channels"], max(scale, 4)
    grid = {"guide_channels": width, "cell": cell, "guide_stride": cell, "base": True}
    return replace(paper, **sizes, **grid)


def conv3(inputs: int, outputs: int) -> nn.Conv2d:
    """3x3, stride 1, padded, bias."""
    return nn.Conv2d(inputs, outputs, 3, padding=1)


# --- strips ---------------------------------------------------------------------------

# Cells that are computed at once: what comes between two layers then stays in the
# processor's caches, and its memory is used again.
STRIP_CELLS = 8192


def strips(x: Tensor, multiple: int = 1) -> list[slice]:
    """Rows of (B, C, h, w) in strips of whole multiples, of about `STRIP_CELLS`."""
    batch, _, height, width = x.shape
    rows = max(STRIP_CELLS // (batch * width * multiple), 1) * multiple
    return [slice(top, min(top + rows, height)) for top in range(0, height, rows)]


class JoinedConv(nn.Conv2d):
    """A convolution of features joined along their channels, strip by strip."""

    def __init__(self, inputs: int, outputs: int, size: int) -> None:
        super().__init__(inputs, outputs, size, padding=size // 2)

    def forward(self, *features: Tensor) -> Tensor:
        """(B, ., h, w) each; the result (B, outputs, h, w)."""
        height = features[0].shape[-2]
        mode = "constant" if self.padding_mode == "zeros" else self.padding_mode
        reach = self.kernel_size[0] // 2
        parts = []
        for rows in strips(features[0]):
            top, bottom = max(rows.start - reach, 0), min(rows.stop + reach, height)
            x = torch.cat([y[..., top:bottom, :] for y in features], dim=1)
            above, below = reach - rows.start + top, reach - bottom + rows.stop
            x = F.pad(x, (reach, reach, above, below), mode) if reach else x
            parts.append(F.conv2d(x, self.weight, self.bias))
        return torch.cat(parts, dim=2)


# --- attention in windows -------------------------------------------------------------


def to_windows(x: Tensor, size: int) -> Tensor:
    """(B, h, w, C) to (B * windows, size * size, C)."""
    b, h, w, c = x.shape
    x = x.view(b, h // size, size, w // size, size, c).transpose(2, 3)
    return x.reshape(-1, size * size, c)


def from_windows(windows: Tensor, size: int, h: int, w: int) -> Tensor:
    """The inverse of `to_windows`: (B * windows, N, C) to (B, h, w, C)."""
    c = windows.shape[-1]
    x = windows.view(-1, h // size, w // size, size, size, c).transpose(2, 3)
    return x.reshape(-1, h, w, c)


def shift_zones(h: int, w: int, size: int, shift: int, like: Tensor) -> Tensor:
    """(1, h, w, 1): cells of one number were neighbours before the cyclic shift."""
    zone = torch.zeros(1, h, w, 1, device=like.device, dtype=like.dtype)
    for i, rows in enumerate((slice(-size), slice(-size, -shift), slice(-shift, None))):
        zone[:, rows] += 3 * i
        zone[:, :, rows] += i
    return zone


def zone_mask(zones: Tensor, size: int) -> Tensor:
    """(windows, 1, N, N): -100 between tokens of different zones (1, h, w, 1)."""
    tokens = to_windows(zones, size).squeeze(-1)  # (windows, N)
    return (tokens[:, None, :, None] != tokens[:, None, None, :]).to(zones) * -100.0


def attend(q: Tensor, k: Tensor, v: Tensor, heads: int, bias: Tensor | None) -> Tensor:
    """Scaled dot-product attention; q, k, v and the result (windows, N, C)."""
    q, k, v = (x.unflatten(-1, (heads, -1)).transpose(1, 2) for x in (q, k, v))
    out = F.scaled_dot_product_attention(q, k, v, attn_mask=bias)  # (., heads, N, C')
    return out.transpose(1, 2).flatten(2)


class WindowAttention(nn.Module):
    """Self-attention with a learnt bias per relative position (Swin's W-MSA)."""

    def __init__(self, channels: int, heads: int, window_size: int) -> None:
        super().__init__()
        self.heads = heads
        self.qkv = nn.Linear(channels, 3 * channels)
        self.project = nn.Linear(channels, channels)
        span = 2 * window_size - 1
        self.position_bias = nn.Parameter(torch.zeros(span * span, heads))
        nn.init.trunc_normal_(self.position_bias, std=0.02)
        axis = torch.arange(window_size)
        y, x = (g.flatten() for g in torch.meshgrid(axis, axis, indexing="ij"))
        dy, dx = y[:, None] - y[None], x[:, None] - x[None]
        index = (dy + window_size - 1) * span + dx + window_size - 1  # (N, N)
        self.position_index: Tensor
        self.register_buffer("position_index", index, persistent=False)

    def forward(self, x: Tensor, mask: Tensor | None = None) -> Tensor:
        bias = self.position_bias[self.position_index].permute(2, 0, 1)
        bias = bias[None].to(x.dtype)  # (1, heads, N, N)
        if mask is not None:  # (windows, 1, N, N), the same for every picture
            bias = (bias + mask).repeat(x.shape[0] // mask.shape[0], 1, 1, 1)
        q, k, v = self.qkv(x).chunk(3, dim=-1)
        return self.project(attend(q, k, v, self.heads, bias))


class WindowCrossAttention(nn.Module):
    """Queries from one modality, keys and values from the other (W-MCA)."""

    def __init__(self, channels: int, heads: int) -> None:
        super().__init__()
        self.heads = heads
        self.query = nn.Linear(channels, channels)
        self.key_value = nn.Linear(channels, 2 * channels)
        self.project = nn.Linear(channels, channels)

    def forward(self, x: Tensor, context: Tensor) -> Tensor:
        k, v = self.key_value(context).chunk(2, dim=-1)
        return self.project(attend(self.query(x), k, v, self.heads, None))


class MLP(nn.Sequential):
    """Two linear layers, `ratio` times as wide between them."""

    def __init__(self, channels: int, ratio: int) -> None:
        hidden = channels * ratio
        super().__init__(
            nn.Linear(channels, hidden), nn.GELU(), nn.Linear(hidden, channels)
        )


class SwinLayer(nn.Module):
    """(Shifted) window self-attention and an MLP, each with a residual path."""

    def __init__(self, config: NetworkConfig, shifted: bool) -> None:
        super().__init__()
        c = config.channels
        self.window_size = config.window_size
        self.shift = config.window_size // 2 if shifted else 0
        self.norm1 = nn.LayerNorm(c)
        self.attention = WindowAttention(c, config.heads, config.window_size)
        self.norm2 = nn.LayerNorm(c)
        self.mlp = MLP(c, ratio=2)

    def forward(self, x: Tensor) -> Tensor:  # (B, C, h, w)
        h, w = x.shape[-2:]
        size, shift = self.window_size, self.shift
        z = x.permute(0, 2, 3, 1)
        if shift:
            z = z.roll((-shift, -shift), (1, 2))
            zones = shift_zones(h, w, size, shift, x)
        parts = []
        for rows in strips(x, size):
            tokens = to_windows(z[:, rows], size)
            mask = zone_mask(zones[:, rows], size) if shift else None
            tokens = tokens + self.attention(self.norm1(tokens), mask)
            tokens = tokens + self.mlp(self.norm2(tokens))
            parts.append(from_windows(tokens, size, rows.stop - rows.start, w))
        z = torch.cat(parts, dim=1)
        if shift:
            z = z.roll((shift, shift), (1, 2))
        return z.permute(0, 3, 1, 2)


# --- blocks of the radiance branch ----------------------------------------------------


class RDST(nn.Module):
    """Residual densely-connected Swin block: RDN's, a Swin layer in each layer."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        c, layers = config.channels, config.dense_layers
        self.convs = nn.ModuleList(JoinedConv(c * (k + 1), c, 3) for k in range(layers))
        self.layers = nn.ModuleList(self.layer(config, k) for k in range(layers))
        self.fuse = JoinedConv(c * (layers + 1), c, 1)

    def layer(self, config: NetworkConfig, index: int) -> nn.Module:
        return SwinLayer(config, shifted=index % 2 == 1)

    def forward(self, x: Tensor) -> Tensor:
        features = [x]
        for conv, layer in zip(self.convs, self.layers, strict=True):
            features.append(layer(conv(*features)))
        return x + self.fuse(*features)


class RDB(RDST):
    """RDN's residual dense block: `RDST` with ReLU in place of the Swin layers."""

    def layer(self, config: NetworkConfig, index: int) -> nn.Module:
        return nn.ReLU()


class RSTB(nn.Sequential):
    """SwinIR's residual block: Swin layers, then a convolution."""

    def __init__(self, config: NetworkConfig) -> None:
        layers = (SwinLayer(config, k % 2 == 1) for k in range(config.dense_layers))
        super().__init__(*layers, conv3(config.channels, config.channels))

    def forward(self, x: Tensor) -> Tensor:
        return x + super().forward(x)


BLOCKS: dict[str, type[RDST] | type[RSTB]] = {"rdst": RDST, "rdb": RDB, "rstb": RSTB}


class CrossModality(nn.Module):
    """XM: self-attention on radiance features, then cross-attention to the guides'."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        c = config.channels
        self.window_size = config.window_size
        self.norm1 = nn.LayerNorm(c)
        self.self_attention = WindowAttention(c, config.heads, config.window_size)
        self.norm2 = nn.LayerNorm(c)
        self.norm_guides = nn.LayerNorm(c)
        self.cross_attention = WindowCrossAttention(c, config.heads)
        self.norm3 = nn.LayerNorm(c)
        self.mlp = MLP(c, ratio=4)

    def forward(self, features: Tensor, guides: Tensor) -> Tensor:  # both (B, C, h, w)
        size, width = self.window_size, features.shape[-1]
        parts = []
        for rows in strips(features, size):
            x, context = (
                to_windows(y[..., rows, :].permute(0, 2, 3, 1), size)
                for y in (features, guides)
            )
            x = x + self.self_attention(self.norm1(x))
            x = x + self.cross_attention(self.norm2(x), self.norm_guides(context))
            x = x + self.mlp(self.norm3(x))
            parts.append(from_windows(x, size, rows.stop - rows.start, width))
        return torch.cat(parts, dim=1).permute(0, 3, 1, 2)


class XDG(nn.Module):
    """Cross-modality dense group: XM, RDSTs and a convolution inside a skip."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.cross = CrossModality(config) if config.cross_attention else None
        block = BLOCKS[config.block]
        self.blocks = nn.Sequential(*(block(config) for _ in range(config.blocks)))
        self.conv = conv3(config.channels, config.channels)

    def forward(self, features: Tensor, guides: Tensor) -> Tensor:
        x = self.cross(features, guides) if self.cross else features + guides
        return x + self.conv(self.blocks(x))


# --- the guide branch -----------------------------------------------------------------


class ResidualBlock(nn.Sequential):
    """Two convolutions inside a skip, without normalisation."""

    def __init__(self, channels: int) -> None:
        super().__init__(
            conv3(channels, channels), nn.ReLU(), conv3(channels, channels)
        )

    def forward(self, x: Tensor) -> Tensor:
        return x + super().forward(x)


class Deshuffle(nn.Sequential):
    """Guide features down to cells: unshuffle by 2 and convolve, step by step."""

    def __init__(self, inputs: int, outputs: int, steps: int) -> None:
        layers: list[nn.Module] = []
        for _ in range(steps - 1):
            layers += [nn.PixelUnshuffle(2), conv3(4 * inputs, inputs), nn.ReLU()]
        if steps:
            layers += [nn.PixelUnshuffle(2), conv3(4 * inputs, outputs)]
        else:
            layers += [conv3(inputs, outputs)]
        super().__init__(*layers, ResidualBlock(outputs))


# --- tails ----------------------------------------------------------------------------


class PixelTail(nn.Module):
    """The paper's: pixel shuffle by 2, step by step, then the picture itself."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        c = config.channels
        layers: list[nn.Module] = []
        for _ in range(int(math.log2(config.cell))):
            layers += [conv3(c, 4 * c), nn.PixelShuffle(2)]
        self.layers = nn.Sequential(*layers, conv3(c, 3))

    def forward(self, features: Tensor, guides: Tensor, sources: Sources) -> Tensor:
        return self.layers(features)


# --- the network ----------------------------------------------------------------------


class XRDS(nn.Module):
    """The network: low-resolution radiance and full-resolution guides to radiance."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.config = config
        c, g = config.channels, config.guide_channels
        fold = config.cell // config.scale  # low-resolution pixels per cell, one axis
        steps = int(math.log2(config.cell // config.guide_stride))
        self.radiance_head = nn.Sequential(
            nn.PixelUnshuffle(fold), conv3(config.radiance_count * fold**2, c)
        )
        self.guide_head = nn.Sequential(
            nn.PixelUnshuffle(config.guide_stride),
            conv3(GUIDE_COUNT * config.guide_stride**2, g),
        )
        self.guide_blocks = nn.ModuleList(
            ResidualBlock(g) for _ in range(config.groups)
        )
        self.deshuffles = nn.ModuleList(
            Deshuffle(g, c, steps) for _ in range(config.groups + 1)
        )
        self.groups = nn.ModuleList(XDG(config) for _ in range(config.groups))
        self.fuse = conv3(2 * c, c)
        if config.base:
            sizes = config.scale, config.cell, c, config.tail_channels
            self.tail: nn.Module = KernelTail(*sizes)
            # the paper pads with zeros, which darkens or tints the rim
            for layer in self.modules():
                if isinstance(layer, nn.Conv2d) and layer.padding != (0, 0):
                    layer.padding_mode = "replicate"
        else:
            self.tail = PixelTail(config)

    def forward(
        self, radiance: Tensor, guides: Tensor, noisy: Tensor | None = None
    ) -> Tensor:
        """Enlarge one batch.

        Parameters
        ----------
        radiance : (B, 3, h, w) Tensor
            Scene-linear radiance in the transfer domain log(1 + k e x).
        guides : (B, 6, s h, s w) Tensor
            Albedo in [0, 1] and camera-space normal.
        noisy : (B, 3, h, w) Tensor, optional
            Radiance before denoising, in the same domain; None where it was not
            denoised or that is lost. Of use to networks with a base alone.

        Returns
        -------
        enlarged : (B, 3, s h, s w) Tensor
            Radiance in the transfer domain.

        Raises
        ------
        ValueError
            If the guides have another size.
        """
        s = self.config.scale
        h, w = radiance.shape[-2:]
        expected = (GUIDE_COUNT, s * h, s * w)
        if guides.shape[1:] != expected:
            raise ValueError(f"guides are {tuple(guides.shape[1:])}, not {expected}")
        noisy = radiance if noisy is None else noisy
        radiance, noisy = self.pad(radiance, 1), self.pad(noisy, 1)
        guides = self.pad(guides, s)
        sources: Sources = []
        if self.config.base:
            sources, facts = find_sources(radiance, noisy, guides, s)
            logs = [torch.log1p(x.low) for x in sources]
            radiance = torch.cat((*logs, facts), dim=1)
        features = self.features(radiance, guides)
        return self.tail(features, guides, sources)[..., : s * h, : s * w]

    def features(self, radiance: Tensor, guides: Tensor) -> Tensor:
        """The transformer: (B, C, cells, cells)."""
        head = features = self.radiance_head(radiance)
        guide = self.guide_head(guides)
        detail = self.deshuffles[0](guide)
        for block, deshuffle, group in zip(
            self.guide_blocks, self.deshuffles[1:], self.groups, strict=True
        ):
            features = group(features, detail)
            guide = block(guide)
            detail = deshuffle(guide)
        return self.fuse(torch.cat((features, detail), dim=1)) + head

    def pad(self, x: Tensor, factor: int) -> Tensor:
        """Pad bottom and right to whole windows; `factor` pixels per low pixel."""
        multiple = self.config.low_multiple * factor
        bottom, right = (-size % multiple for size in x.shape[-2:])
        return F.pad(x, (0, right, 0, bottom), mode="replicate")
