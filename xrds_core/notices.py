"""Lines on stderr about what does not stop the work."""

from __future__ import annotations

import sys
from contextlib import suppress
from typing import Any

from .errors import printable

finished: list[Any] = []
"""What `--json` prints of each frame that a command has finished, should it fail."""


def warn(text: str) -> None:
    """Print one line for the user; lost where there is no stderr."""
    if sys.stderr is None:
        return
    with suppress(OSError, ValueError):  # full, or closed
        print(f"xrds: {printable(text)}", file=sys.stderr, flush=True)
