"""The processes that share one run: one alone, or those that `torchrun` started.

Each draws and learns from its own crops of a batch and keeps the same weights; the
first one of them, the lead, writes the files.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import distributed, nn

from xrds_core.errors import UsageError
from xrds_core.superres.devices import choose_device


@dataclass(frozen=True)
class Processes:
    """This process's rank among `count`, and the device that it trains on."""

    rank: int
    count: int
    device: torch.device

    @staticmethod
    def join() -> Processes:
        """Meet the others that `torchrun` started; alone without it."""
        device = choose_device()
        count = int(os.environ.get("WORLD_SIZE", "1"))
        if count == 1:
            return Processes(0, 1, device)
        if device.type == "cuda":
            device = torch.device("cuda", int(os.environ["LOCAL_RANK"]))
            torch.cuda.set_device(device)
        backend = "nccl" if device.type == "cuda" else "gloo"
        if not distributed.is_initialized():
            distributed.init_process_group(backend)
        return Processes(distributed.get_rank(), count, device)

    @property
    def lead(self) -> bool:
        """Whether this process writes the files and the progress bar."""
        return self.rank == 0

    def wrap(self, network: nn.Module) -> nn.Module:
        """The network, with gradients averaged over the processes."""
        if self.count == 1:
            return network
        own = [self.device] if self.device.type == "cuda" else None
        return nn.parallel.DistributedDataParallel(network, device_ids=own)

    def places(self, batch: int) -> range:
        """The places of a batch that are this process's.

        Raises:
            UsageError: the processes cannot share the batch evenly.
        """
        if batch % self.count:
            raise UsageError(
                f"batch {batch} cannot be shared by {self.count} processes evenly"
            )
        return range(self.rank, batch, self.count)

    def mean(self, values: Sequence[float]) -> list[float]:
        """The mean of each value over all processes."""
        if self.count == 1:
            return list(values)
        total = torch.tensor(values, dtype=torch.float64, device=self.device)
        distributed.all_reduce(total)
        return (total / self.count).tolist()

    def gather(self, value: Any) -> list[Any]:
        """The value of every process, in order of their ranks."""
        values = [value] * self.count
        if self.count > 1:
            distributed.all_gather_object(values, value)
        return values

    def leave(self) -> None:
        """Leave the group of processes."""
        if self.count > 1 and distributed.is_initialized():
            distributed.destroy_process_group()
