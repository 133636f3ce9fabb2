"""The crops of the next steps, drawn by other processes while one is computed."""

from __future__ import annotations

import itertools
import signal
from collections.abc import Callable, Iterable, Iterator

import torch
from torch.utils.data import DataLoader, Dataset

from xrds_core.errors import XRDSError

from .crop import Batch

STEPS_AHEAD = 2  # that each process draws


class Steps(Dataset[Batch | XRDSError]):
    """The batch of every step: `crop(step, place)` of all `places`."""

    def __init__(
        self, crop: Callable[[int, int], Batch], places: Iterable[int]
    ) -> None:
        self._crop, self._places = crop, list(places)

    def __getitem__(self, step: int) -> Batch | XRDSError:
        try:
            return Batch.stack([self._crop(step, place) for place in self._places])
        except XRDSError as error:
            return error  # the loader would bury it in a traceback of its process


class CropLoader:
    """Draws the batches of the steps that follow one another, in `workers` processes.

    `crop` is pickled where processes do not begin as copies of this one.
    """

    def __init__(
        self, crop: Callable[[int, int], Batch], places: Iterable[int], workers: int = 1
    ) -> None:
        self._steps, self._workers = Steps(crop, places), workers
        self._next = -1
        self._batches: Iterator[Batch | XRDSError] = iter(())

    def batch(self, step: int) -> Batch:
        """The crops of this step; those of the next ones are begun."""
        if step != self._next:
            self._batches = self._begin(step)
        self._next = step + 1
        drawn = next(self._batches)
        if isinstance(drawn, XRDSError):
            raise drawn
        return drawn

    def _begin(self, step: int) -> Iterator[Batch | XRDSError]:
        loader = DataLoader(
            self._steps,
            batch_size=None,  # a step is a batch already
            sampler=itertools.count(step),
            num_workers=self._workers,
            prefetch_factor=STEPS_AHEAD,
            worker_init_fn=_leave_interrupts,
            generator=torch.Generator(),
        )
        return iter(loader)

    def close(self) -> None:
        """End the processes; what was drawn ahead is lost."""
        self._batches, self._next = iter(()), -1


def _leave_interrupts(_: int) -> None:
    """Ctrl-C is for the process that trains."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
