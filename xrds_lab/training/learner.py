"""The network as it learns: one step of Adam, and the moving average of its weights."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch
from torch import Tensor
from torch.optim.swa_utils import get_ema_multi_avg_fn

from xrds_core.superres import weights
from xrds_core.superres.devices import choose_precision
from xrds_core.superres.network import XRDS

from ..weights import save_network
from .config import TrainingConfig
from .crop import Batch
from .losses import weighted
from .processes import Processes

AVERAGE_WARMUP = 10  # steps: a young average follows the weights closely


class Recorded(torch.nn.Module):
    """What is replayed; the network itself stays free for pictures of other sizes."""

    def __init__(self, network: torch.nn.Module) -> None:
        super().__init__()
        self.network = network

    def forward(self, *inputs: Tensor) -> Tensor:
        return self.network(*inputs)


class Learner:
    """Weights, their average and the optimiser's memory: all that training changes."""

    def __init__(self, config: TrainingConfig, processes: Processes) -> None:
        self.config, self.device = config, processes.device
        self.precision = choose_precision(config.precision, self.device)
        torch.manual_seed(config.seed)
        network = XRDS(config.network_config).to(self.device)
        if self.device.type == "cuda":  # tensor cores take channels last
            network = network.to(memory_format=torch.channels_last)
        self.network = network
        self.average = self._copy()
        self.shared = processes.wrap(self.network)
        self.recorded: torch.nn.Module | None = None
        self.optimizer = torch.optim.Adam(
            self.network.parameters(), config.learning_rate, config.betas
        )

    def forward(self, batch: Batch, network: torch.nn.Module | None = None) -> Tensor:
        """The network's output, float32, layers in the run's precision."""
        with self._mixed():
            return (network or self.network)(*self._inputs(batch)).float()

    def learn(self, batch: Batch, step: int) -> float:
        """Take one step, the `step`-th from 0; returns the loss before it."""
        for group in self.optimizer.param_groups:
            group["lr"] = self.config.learning_rate_at(step)
        batch = batch.to(self.device)
        output = self.forward(batch, self._learning(batch))
        loss = weighted(self.config.loss, output, batch.reference)
        self.optimizer.zero_grad(set_to_none=True)
        loss.backward()
        if largest := self.config.clip_gradient:
            torch.nn.utils.clip_grad_norm_(self.network.parameters(), largest)
        self.optimizer.step()
        self._follow(step + 1)
        return loss.item()

    def _learning(self, batch: Batch) -> torch.nn.Module:
        """The network as it learns from such a batch.

        On a GPU the passes over whole crops are recorded once and then replayed: to
        launch their thousands of small kernels takes longer than to run them.
        """
        whole = batch.reference.shape[-1] == self.config.crop
        alone = self.shared is self.network
        if self.device.type != "cuda" or not alone or not whole:
            return self.shared
        if self.recorded is None:
            # a cache of converted weights would be recorded, and never follow them
            with self._mixed(cache=False):
                self.recorded = torch.cuda.make_graphed_callables(
                    Recorded(self.network), self._inputs(batch)
                )
        return self.recorded

    def _mixed(self, cache: bool = True) -> torch.autocast:
        """Layers in the run's precision, inside `with`."""
        mixed = self.precision != torch.float32
        kind = self.device.type
        return torch.autocast(kind, self.precision, mixed, cache_enabled=cache)

    def _inputs(self, batch: Batch) -> tuple[Tensor, ...]:
        """What the network takes of a batch."""
        batch = batch.to(self.device)
        return batch.radiance, batch.guides, batch.noisy

    def _copy(self) -> dict[str, Tensor]:
        return {k: v.clone() for k, v in self.network.state_dict().items()}

    def _follow(self, steps: int) -> None:
        decay = min(self.config.average, steps / (steps + AVERAGE_WARMUP))
        state = self.network.state_dict()
        own = {name: x for name, x in state.items() if x.is_floating_point()}
        average = [self.average[name] for name in own]
        get_ema_multi_avg_fn(decay)(average, list(own.values()), None)

    @contextmanager
    def averaged(self) -> Iterator[None]:
        """Put the average in the place of the weights for a while."""
        learnt = self._copy()
        self.network.load_state_dict(self.average)
        try:
            yield
        finally:
            self.network.load_state_dict(learnt)

    def save_average(self, path: Path, record: dict[str, str]) -> None:
        """Write the averaged weights."""
        network = XRDS(self.config.network_config)
        network.load_state_dict({k: v.cpu() for k, v in self.average.items()})
        save_network(network, path, record)

    def start_from(self, path: Path) -> None:
        """Take every tensor whose name and shape agree from a weights file."""
        source = weights.load(path)[0].state_dict()
        own = self.network.state_dict()
        own |= {k: v for k, v in source.items() if k in own and v.shape == own[k].shape}
        self.network.load_state_dict(own)
        self.average = self._copy()

    def state(self) -> dict[str, Any]:
        """All that a checkpoint needs of it."""
        return {
            "network": self.network.state_dict(),
            "average": self.average,
            "optimizer": self.optimizer.state_dict(),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Take back what `state` gave."""
        self.network.load_state_dict(state["network"])
        self.average = state["average"]
        self.optimizer.load_state_dict(state["optimizer"])
