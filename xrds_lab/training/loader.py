"""The crops of a step, drawn by threads while the step before is computed."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor

from .crop import Batch

THREADS = 8  # drawing is NumPy, which mostly lets go of the interpreter


class CropLoader:
    """Draws `crop(step, place)` for every place of a batch, one step ahead."""

    def __init__(
        self, crop: Callable[[int, int], Batch], places: Iterable[int]
    ) -> None:
        self._crop = crop
        self._places = list(places)
        self._pool = ThreadPoolExecutor(min(THREADS, len(self._places)))
        self._ahead: tuple[int, list[Future[Batch]]] = (-1, [])

    def batch(self, step: int) -> Batch:
        """The crops of this step; those of the next one are begun."""
        drawn = self._begin(step) if self._ahead[0] != step else self._ahead[1]
        self._ahead = (step + 1, self._begin(step + 1))
        return Batch.stack([crop.result() for crop in drawn])

    def _begin(self, step: int) -> list[Future[Batch]]:
        return [self._pool.submit(self._crop, step, place) for place in self._places]

    def close(self) -> None:
        """Drop what was drawn ahead."""
        self._pool.shutdown(cancel_futures=True)
