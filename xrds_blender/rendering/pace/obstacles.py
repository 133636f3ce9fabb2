"""Where frames of a shot may have fewer samples than the file's, and where not."""

from __future__ import annotations

from typing import Any

from ...cycles.settings import has_subsets
from ...planning.request import Request
from ...planning.settings import Mode
from ..sampling import has_neighbours

FEWEST_SAMPLES = 8
"""Samples of the file from which it pays."""
FEWEST_FRAMES = 16
"""Frames of a shot from which it pays: the first costs more than the file asks for."""
FEW_FRAMES = "Same Picture needs 16 frames or more: fewer take the file's samples"
FEW_SAMPLES = "Same Picture needs 8 samples or more: frames take the file's samples"
OLD_BLENDER = "Same Picture needs Blender 4.4: frames take the file's samples"
ONE_SUBSET = (
    "Same Picture does not go with Cycles' Sample Subset or time limit: frames take "
    "the file's samples"
)
OWN_SAMPLES = (
    "Same Picture does not go with samples of a view layer: frames take those samples"
)
OTHER_MODE = "Same Picture needs the mode Full Size without a time budget"


def obstacle(scene: Any, request: Request, frames: int) -> str:
    """Why a shot of so many frames has the file's samples; empty if it need not."""
    settings, cycles = request.settings, scene.cycles
    is_timed = request.time_budget is not None or settings.samples is not None
    subset = getattr(cycles, "use_sample_subset", False)
    obstacles = {
        OTHER_MODE: settings.mode is not Mode.FULL_SIZE or is_timed,
        OLD_BLENDER: not has_subsets(scene),
        FEW_FRAMES: frames < FEWEST_FRAMES,
        FEW_SAMPLES: cycles.samples < FEWEST_SAMPLES,
        ONE_SUBSET: subset or cycles.time_limit,
        OWN_SAMPLES: any(layer.samples for layer in scene.view_layers),
    }
    return next((sentence for sentence, is_there in obstacles.items() if is_there), "")


def can_save(scene: Any, request: Request, frames: int) -> bool:
    """Whether a shot of so many frames may have fewer samples than the file's."""
    wanted = request.same_picture and has_neighbours(scene, request)
    return wanted and not obstacle(scene, request, frames)
