"""Frames for a window that a function makes of their numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from xrds_core.frame_source import FrameSource


class Frames(FrameSource[Any]):
    """Frames as `load` gives them."""

    def __init__(self, load: Callable[[int], Any]) -> None:
        self._load = load

    def load(self, number: int) -> Any:
        return self._load(number)
