"""Lines of text that report how a long measurement goes."""

from __future__ import annotations

import sys
from collections.abc import Callable

from xrds_core.errors import printable

Progress = Callable[[str], object]


def silent(line: str) -> None:
    """Drop a line."""


def report_line(line: str) -> None:
    """Print a line beside the result, on stderr."""
    print(printable(line), file=sys.stderr, flush=True)
