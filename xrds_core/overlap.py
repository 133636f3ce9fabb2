"""Work in threads of its own, such as finishing a frame while a card samples the next.

On the processor both would share the same cores: nothing is gained there.
"""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from typing import TYPE_CHECKING, Generic, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import TracebackType

T = TypeVar("T")
Other = TypeVar("Other")


class Overlap(Generic[T]):
    """Runs work beside what goes on here, in order: one piece at a time.

    Beside that piece other work can be begun, such as what prepares the next one.
    Without `is_on` it runs where it is put. Work that is left when an error ends the
    `with` block is dropped: nobody waits for it.
    """

    def __init__(self, is_on: bool) -> None:
        self._pool = ThreadPoolExecutor(2, "finish") if is_on else None
        self._begun: Future[T] | None = None

    def put(self, work: Callable[[], T]) -> Iterator[T]:
        """Begin some work once the piece before it is done; yields what that has made.

        What that piece raises is raised here.
        """
        if self._pool is None:
            yield work()
            return
        before = self._begun
        made = [] if before is None else [before.result()]
        self._begun = self._pool.submit(work)  # beside what is done with the result
        yield from made

    def begin(self, work: Callable[[], Other]) -> Callable[[], Other]:
        """Begin other work beside what was put; returns what waits for its result.

        Without `is_on` it is done when that is called.
        """
        return work if self._pool is None else self._pool.submit(work).result

    def rest(self) -> Iterator[T]:
        """Yield what the last piece makes, if there is one."""
        begun, self._begun = self._begun, None
        if begun is not None:
            yield begun.result()

    def __enter__(self) -> Overlap[T]:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._pool is not None:
            self._pool.shutdown(wait=kind is None, cancel_futures=True)
