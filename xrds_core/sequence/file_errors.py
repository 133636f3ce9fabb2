"""Errors about the content of a file that is itself intact."""

from __future__ import annotations

from ..errors import PictureError


class Unfit(PictureError):
    """A complete file that lacks something needed, or holds something unusable."""


class NotReusable(Unfit):
    """A frame that can be denoised by itself, but whose pixels cannot be reprojected.

    `reason` is the message without the remedy.
    """

    def __init__(self, reason: str, remedy: str) -> None:
        super().__init__(f"{reason}; {remedy}")
        self.reason = reason
