"""What the networks cost: parameters and operations, counted from their classes.

Counting takes seconds, so what `xrds info` prints was counted before (`write_costs`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import torch
from torch import Tensor, nn

from xrds_core.files import write_json
from xrds_core.info import COSTS
from xrds_core.superres.kernels import GUIDE_COUNT, KernelTail
from xrds_core.superres.network import (
    PRESETS,
    XRDS,
    NetworkConfig,
    WindowAttention,
    WindowCrossAttention,
    preset_config,
)

PAPER_ROWS = ((5, 3), (3, 3), (1, 3), (5, 2), (5, 1))  # RDST per XDG, XDG: table 5
PAPER_OUTPUT = 1024  # pixels along each side of the picture the paper counts for
SCALES = (2, 4, 8)

# Operations per element outside MACs, as the paper's profiler counts them.
ELEMENTWISE: dict[type[nn.Module], int] = {nn.LayerNorm: 5, nn.GELU: 1, nn.ReLU: 1}


@dataclass(frozen=True)
class Operations:
    """Operations of one forward pass; `macs` as the paper's profiler counted them."""

    parameters: int
    macs: int
    """Multiply-adds of Conv2d and Linear."""
    attention_macs: int
    """Those of the two products inside each attention, which the paper left out."""
    elementwise: int
    """Operations of norms, activations and softmax."""

    @property
    def macs_with_attention(self) -> int:
        return self.macs + self.attention_macs

    @property
    def flops(self) -> int:
        """As the paper's: without the products inside attention."""
        return 2 * self.macs + self.elementwise


class _Counter:
    """Sums the operations of a network's modules while it runs."""

    def __init__(self, network: XRDS) -> None:
        self.macs = self.attention = self.elementwise = 0
        for module in network.modules():
            if isinstance(module, nn.Conv2d):
                module.register_forward_hook(self._convolution)
            elif isinstance(module, nn.Linear):
                module.register_forward_hook(self._linear)
            elif isinstance(module, WindowAttention | WindowCrossAttention):
                module.register_forward_hook(self._attention)
            elif type(module) in ELEMENTWISE:
                module.register_forward_hook(self._elementwise)

    def _convolution(self, module: nn.Conv2d, _: Any, out: Tensor) -> None:
        self.macs += out.numel() * module.weight[0].numel()

    def _linear(self, module: nn.Linear, _: Any, out: Tensor) -> None:
        self.macs += out.numel() * module.in_features

    def _attention(
        self, module: WindowAttention | WindowCrossAttention, _: Any, out: Tensor
    ) -> None:
        tokens = out.shape[1]  # out is (windows, tokens, channels)
        self.attention += 2 * tokens * out.numel()
        self.elementwise += out.shape[0] * module.heads * tokens * tokens  # softmax

    def _elementwise(self, module: nn.Module, _: Any, out: Tensor) -> None:
        self.elementwise += ELEMENTWISE[type(module)] * out.numel()


@lru_cache(maxsize=64)
def count(config: NetworkConfig, size: int = PAPER_OUTPUT) -> Operations:
    """Count one forward pass for an output of `size` x `size` pixels.

    Runs on torch's meta device: shapes only, no memory, no arithmetic. `size` is a
    multiple of the scale; pixels padded to whole windows are counted.
    """
    low = size // config.scale
    with torch.device("meta"), torch.no_grad():
        network = XRDS(config).eval()
        if isinstance(network.tail, KernelTail):
            _leave_out_the_weightless(network.tail)
        counter = _Counter(network)
        network(torch.empty(1, 3, low, low), torch.empty(1, GUIDE_COUNT, size, size))
    parameters = sum(p.numel() for p in network.parameters())
    return Operations(parameters, counter.macs, counter.attention, counter.elementwise)


def _leave_out_the_weightless(tail: KernelTail) -> None:
    """Give what has no weights the right shapes alone: nine tenths of the time."""

    def enlarge(low: Tensor, _: str) -> Tensor:
        height, width = low.shape[-2:]
        return low.new_empty(*low.shape[:2], height * tail.scale, width * tail.scale)

    stubs: dict[str, Any] = {
        "enlarge": enlarge,
        "kernels": lambda *_: None,
        "combine": lambda _area, _kernels, sharp, *_: sharp[0],
    }
    for name, stub in stubs.items():
        setattr(tail, name, stub)


def paper_table() -> list[dict[str, int]]:
    """Recount the paper's ablation over depth (x4, 1024 x 1024 output)."""
    return [
        {
            "rdst": blocks,
            "xdg": groups,
            "parameters": cost.parameters,
            "macs": cost.macs,
            "macs_with_attention": cost.macs_with_attention,
            "flops": cost.flops,
        }
        for blocks, groups in PAPER_ROWS
        for cost in [count(NetworkConfig(groups=groups, blocks=blocks))]
    ]


def preset_costs() -> dict[str, dict[str, dict[str, int]]]:
    """Parameters and MACs per output pixel of every preset at every scale."""
    return {
        preset: {str(scale): _preset_cost(preset, scale) for scale in SCALES}
        for preset in PRESETS
    }


def _preset_cost(preset: str, scale: int) -> dict[str, int]:
    cost = count(preset_config(preset, scale))
    per_pixel = round(cost.macs / PAPER_OUTPUT**2)
    return {"parameters": cost.parameters, "macs_per_output_pixel": per_pixel}


def costs() -> dict[str, Any]:
    """Count {paper_table, presets}; takes ten seconds of a processor."""
    return {"paper_table": paper_table(), "presets": preset_costs()}


def write_costs() -> None:
    """Count anew, after a change of the networks or presets."""
    write_json(COSTS, costs())
