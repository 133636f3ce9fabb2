"""What a time budget or a quality becomes in a shot: the same for all its frames.

Settings that changed from frame to frame would be seen, and frames of other settings
could not lend to each other.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any

from ..cycles.passes import CyclesPasses
from ..frame import progress
from ..frame.job import Picture, RenderJob
from ..frame.picking import pick, report_pick
from ..planning.plan import Decision


@dataclass(frozen=True)
class ShotJob:
    """The job of every frame of a shot, and why it is this one."""

    job: RenderJob
    decisions: tuple[Decision, ...] = ()

    def told(self, picture: Picture) -> Picture:
        """The picture of one of its frames, with what it was rendered by."""
        if not self.decisions:
            return picture
        return replace(picture, plan=(*self.decisions, *picture.plan), job=self.job)


def choose_for_shot(engine: Any, depsgraph: Any, job: RenderJob) -> ShotJob:
    """Choose what the job leaves open, by probes of the frame that is evaluated.

    Raises what `pick` raises.
    """
    if not job.is_picked:
        return ShotJob(job)
    try:
        with CyclesPasses(engine, depsgraph) as passes:
            picked = pick(passes, job, time.perf_counter(), shot=True)
    finally:
        progress.end()
    report_pick(engine, picked)
    return ShotJob(picked.job, (picked.decision,))
