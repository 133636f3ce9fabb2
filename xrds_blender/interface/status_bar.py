"""The running stage and the progress of all stages in Blender's status bar.

Cycles overwrites the texts that an engine gives Blender; the status bar is our own.
"""

from __future__ import annotations

from typing import Any

from ..frame import progress


def draw(self: Any, context: Any) -> None:
    """Draw the stage into the status bar, before Blender draws its progress bar."""
    stage = progress.current()
    if stage is not None:
        progress.show()
        self.layout.label(text=stage)
