"""What is wrong with a file's content rather than with the file."""

from __future__ import annotations

from ..errors import PictureError


class Unfit(PictureError):
    """A whole file that lacks what is needed, or holds what cannot be used."""


class NotLending(Unfit):
    """A frame can be denoised by itself, but nobody can tell where its pixels were.

    `reason` is the message without the remedy.
    """

    def __init__(self, reason: str, remedy: str) -> None:
        super().__init__(f"{reason}; {remedy}")
        self.reason = reason
