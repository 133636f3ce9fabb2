"""The running stage and the progress of all stages in Blender's status bar.

Cycles overwrites the texts that an engine gives Blender; the status bar is our own.
"""

from __future__ import annotations

from typing import Any

from ..frame import stages


def draw(self: Any, context: Any) -> None:
    """Draw the stage into the status bar, before Blender draws its progress bar."""
    stage = stages.current()
    if stage is not None:
        stages.show()
        self.layout.label(text=stage)
