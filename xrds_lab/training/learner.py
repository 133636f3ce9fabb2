"""The network as it learns: one step of Adam, and the moving average of its weights."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from xrds_core import weights
from xrds_core.devices import choose_precision
from xrds_core.network import XRDS

from .config import TrainingConfig
from .crop import Batch
from .losses import weighted
from .processes import Processes

AVERAGE_WARMUP = 10  # steps: a young average follows the weights closely


class Learner:
    """Weights, their average and the optimiser's memory: all that training changes."""

    def __init__(self, config: TrainingConfig, processes: Processes) -> None:
        self.config, self.device = config, processes.device
        self.precision = choose_precision(config.precision, self.device)
        torch.manual_seed(config.seed)
        self.network = XRDS(config.network_config).to(self.device)
        self.average = self._copy()
        self.shared = processes.wrap(self.network)
        self.optimizer = torch.optim.Adam(
            self.network.parameters(), config.learning_rate, config.betas
        )

    def forward(self, batch: Batch, network: torch.nn.Module | None = None) -> Tensor:
        """The network's output, float32, layers in the run's precision."""
        batch = batch.to(self.device)
        mixed = self.precision != torch.float32
        with torch.autocast(self.device.type, self.precision, enabled=mixed):
            inputs = batch.radiance, batch.guides, batch.noisy
            return (network or self.network)(*inputs).float()

    def learn(self, batch: Batch, step: int) -> float:
        """Take one step, the `step`-th from 0; returns the loss before it."""
        for group in self.optimizer.param_groups:
            group["lr"] = self.config.learning_rate_at(step)
        output = self.forward(batch, self.shared)
        reference = batch.reference.to(self.device)
        loss = weighted(self.config.loss, output, reference)
        self.optimizer.zero_grad(set_to_none=True)
        loss.backward()
        if largest := self.config.clip_gradient:
            torch.nn.utils.clip_grad_norm_(self.network.parameters(), largest)
        self.optimizer.step()
        self._follow(step + 1)
        return loss.item()

    def _copy(self) -> dict[str, Tensor]:
        return {k: v.clone() for k, v in self.network.state_dict().items()}

    def _follow(self, steps: int) -> None:
        decay = min(self.config.average, steps / (steps + AVERAGE_WARMUP))
        for name, value in self.network.state_dict().items():
            self.average[name].lerp_(value, 1 - decay)

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
        """Write the averaged weights in half precision."""
        network = XRDS(self.network.config)
        network.load_state_dict({k: v.cpu() for k, v in self.average.items()})
        weights.save(network, path, record)

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
