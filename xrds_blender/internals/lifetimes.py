"""What is remembered between renders, by how long it is.

A module declares a class for what it remembers and asks a lifetime for the one object
of it. So nothing is remembered elsewhere, and all of a lifetime ends at once.
"""

from __future__ import annotations

from typing import Any, TypeVar

T = TypeVar("T")


class Lifetime:
    """Objects, one of each class."""

    def __init__(self) -> None:
        self._objects: dict[type, Any] = {}

    def of(self, kind: type[T]) -> T:
        """The object of a class; made with its defaults where there is none yet."""
        if kind not in self._objects:
            self._objects[kind] = kind()
        found: T = self._objects[kind]
        return found

    def end(self) -> None:
        """Forget all objects."""
        self._objects.clear()


PROCESS = Lifetime()
"""Until Blender ends."""
FILE = Lifetime()
"""Until another file is opened."""
RENDER_JOB = Lifetime()
"""One F12, or one whole animation."""
