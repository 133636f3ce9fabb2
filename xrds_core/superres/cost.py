"""What a network costs per output pixel, found by watching one tiny forward pass."""

from __future__ import annotations

import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor, nn
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves

from ..progress import Progress
from .kernels import GUIDE_COUNT, KernelTail
from .network import XRDS

_SMALL_AREA = 4  # cells


@dataclass(frozen=True)
class Cost:
    """Per output pixel of a network's forward pass."""

    bytes: float
    """Most bytes of tensors alive at the same time, inputs left out."""
    values: float
    """Values that the layers return, in all: a measure of how far a pass has come."""


class _LiveBytes(TorchDispatchMode):
    """Follows every tensor that operations allocate until it is freed."""

    def __init__(self) -> None:
        super().__init__()
        self.now = self.peak = 0
        self.alive: set[int] = set()

    def __torch_dispatch__(
        self, func: Any, types: Any, args: Any = (), kwargs: Any = None
    ) -> Any:
        result = func(*args, **(kwargs or {}))
        for tensor in tree_leaves(result):
            if isinstance(tensor, Tensor):
                self.follow(tensor.untyped_storage())
        return result

    def follow(self, storage: torch.UntypedStorage) -> None:
        key, size = storage._cdata, storage.nbytes()
        if key not in self.alive:
            self.alive.add(key)
            self.now += size
            self.peak = max(self.peak, self.now)
            weakref.finalize(storage, self.forget, key, size)

    def forget(self, key: int, size: int) -> None:
        self.alive.discard(key)
        self.now -= size


def leaves(network: nn.Module) -> list[nn.Module]:
    """Return the layers that hold no others."""
    return [module for module in network.modules() if not any(module.children())]


def measure(network: XRDS) -> Cost:
    """Measure what a network costs, on two by two windows in float32.

    All costs grow with the number of pixels, so a tiny picture represents a large one:
    except the areas of a `KernelTail`, of which there are many in a large picture. So
    bytes are those of a pass over many small areas.

    Parameters
    ----------
    network : XRDS
        The network.

    Returns
    -------
    cost : Cost
        Per output pixel.
    """
    config = network.config
    device = next(network.parameters()).device
    low = 2 * config.low_multiple
    high = low * config.scale
    radiance = torch.zeros(1, 3, low, low, device=device)
    guides = torch.zeros(1, GUIDE_COUNT, high, high, device=device)
    values = 0

    def count(module: nn.Module, inputs: Any, output: Tensor) -> None:
        nonlocal values
        values += output.numel()

    hooks = [layer.register_forward_hook(count) for layer in leaves(network)]
    with torch.inference_mode():
        network(radiance, guides)
    for hook in hooks:
        hook.remove()
    with torch.inference_mode(), _small_areas(network.tail), _LiveBytes() as live:
        network(radiance, guides)
    return Cost(live.peak / high**2, values / high**2)


@contextmanager
def watched(network: XRDS, progress: Progress) -> Iterator[None]:
    """Let every layer of `network` add the number of values it returns."""

    def add(module: Any, inputs: Any, output: Tensor) -> None:
        progress.add(output.numel())

    hooks = [layer.register_forward_hook(add) for layer in leaves(network)]
    try:
        yield
    finally:
        for hook in hooks:
            hook.remove()


@contextmanager
def _small_areas(tail: nn.Module) -> Iterator[None]:
    if not isinstance(tail, KernelTail):
        yield
        return
    side, tail.area_side = tail.area_side, _SMALL_AREA
    try:
        yield
    finally:
        tail.area_side = side
