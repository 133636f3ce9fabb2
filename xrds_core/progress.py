"""How far a computation has come, told to a callback that may cancel it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from .cost import leaves
from .errors import Cancelled

if TYPE_CHECKING:
    from collections.abc import Iterator

    from torch import Tensor

    from .network import XRDS

Callback = Callable[[float], object]
"""Takes a fraction in [0, 1] that never falls; False as its result cancels."""

_NEARLY = 0.999  # 1 is told once, when all is done


class Progress:
    """Counts work and tells the fraction done; raises Cancelled."""

    def __init__(self, callback: Callback | None) -> None:
        self._callback = callback
        self._told = 0.0
        self.begin(1.0)

    def begin(self, total: float) -> None:
        """Begin with work of `total`, or begin anew; what was told stays told."""
        self._total = total
        self._done = 0.0

    def add(self, work: float) -> None:
        self._done += work
        self.tell(min(self._done / self._total, _NEARLY))

    def tell(self, fraction: float) -> None:
        self._told = max(self._told, fraction)
        if self._callback is not None and self._callback(self._told) is False:
            raise Cancelled


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
