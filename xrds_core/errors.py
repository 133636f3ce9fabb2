"""The errors XRDS raises on purpose, and lines about what does not stop the work.

Each message is one clear line: what is wrong, where (with the value), and the
remedy. Whatever else reaches a caller is a bug.
"""

from __future__ import annotations

import sys
from contextlib import suppress
from typing import Any


def printable(text: str) -> str:
    """The text with all that could steer a terminal or break the line escaped."""
    return "".join(
        c if c.isprintable() else c.encode("unicode_escape").decode() for c in text
    )


GET_NETWORK = "pip install xrds[network]"
"""The command that brings what super-resolution needs beside the rest."""


class XRDSError(Exception):
    """Base of every error of this project; its text can be shown to a user."""

    def __str__(self) -> str:
        return printable(super().__str__())  # names in files may hold anything


class WeightsError(XRDSError):
    """A weights file is missing, damaged, or made for another network."""


class PictureError(XRDSError):
    """Arrays or picture files that cannot be used: wrong size, pass, or format."""


class Unfit(PictureError):
    """A complete file that lacks something needed, or holds something unusable."""


class NotReusable(Unfit):
    """A frame that can be denoised by itself, but whose pixels cannot be reprojected.

    `reason` is the message without the remedy.
    """

    def __init__(self, reason: str, remedy: str) -> None:
        super().__init__(f"{reason}; {remedy}")
        self.reason = reason


class SceneError(XRDSError):
    """A scene that cannot be rendered, e.g. without a camera."""


class UsageError(XRDSError):
    """Options that contradict each other or lie outside their range (exit 2)."""


class OutOfMemory(XRDSError):
    """A device has too little memory even for the smallest tiles."""


class Cancelled(XRDSError):
    """The user, or a progress callback returning False, stopped the work."""

    def __init__(self, message: str = "cancelled") -> None:
        super().__init__(message)


finished: list[Any] = []
"""What `--json` prints of each frame that a command has finished, should it fail."""


def warn(text: str) -> None:
    """Print one line for the user; lost where there is no stderr."""
    if sys.stderr is None:
        return
    with suppress(OSError, ValueError):  # full, or closed
        print(f"xrds: {printable(text)}", file=sys.stderr, flush=True)
