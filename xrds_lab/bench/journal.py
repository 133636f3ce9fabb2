"""A record of what failed, and of what ran when a process was killed."""

from __future__ import annotations

import json
from contextlib import contextmanager, nullcontext
from typing import TYPE_CHECKING

from xrds_core.errors import Cancelled
from xrds_core.files import read_json, replacing

if TYPE_CHECKING:
    from collections.abc import Iterator
    from contextlib import AbstractContextManager
    from pathlib import Path

    from ..progress import Progress

MOST_KILLS = 3  # so often a task may end with its process before it is left out


class Journal:
    """Keeps one bad configuration from ending a run, even if it kills the process.

    The name of the running task is kept in a file, so that the next run knows where
    the last one was killed. A task that was killed `MOST_KILLS` times is left out.
    """

    def __init__(self, path: Path, progress: Progress) -> None:
        self.path, self.progress = path, progress
        self.failures: dict[str, str] = {}
        self.kills: dict[str, int] = {}
        self._running: str | None = None
        self._read()

    def _read(self) -> None:
        if not self.path.is_file():
            return
        record = read_json(self.path)
        self.kills = record["kills"]
        killed = record["running"]
        if killed is not None:
            self.kills[killed] = self.kills.get(killed, 0) + 1

    @contextmanager
    def attempt(self, name: str) -> Iterator[None]:
        """Run the body; an error in it is recorded and not raised."""
        self._running = name
        self._write()
        try:
            yield
        except (Cancelled, KeyboardInterrupt):
            self._running = None
            raise
        except Exception as error:  # any fault of one configuration is only its own
            self.failures[name] = f"{type(error).__name__}: {error}"
            self.progress(f"{name} failed and is left out: {self.failures[name]}")
        else:
            self.failures.pop(name, None)
        finally:
            self._running = None
            self._write()

    def gives_up(self, name: str) -> bool:
        """Whether a task is to be left out: it failed now, or kills the process."""
        if self.kills.get(name, 0) >= MOST_KILLS:
            self.failures[name] = (
                f"ended with its process {self.kills[name]} times; "
                f"remove {self.path} to try it again"
            )
        return name in self.failures

    def _write(self) -> None:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(self.path) as part:
            record = {"running": self._running, "kills": self.kills}
            part.write_text(json.dumps(record), "utf-8")


class Strict:
    """A journal in which the first failure ends the run."""

    def attempt(self, name: str) -> AbstractContextManager[None]:
        """Run the body; its errors are raised."""
        return nullcontext()

    def gives_up(self, name: str) -> bool:
        """Never: no task is left out."""
        return False
