"""What a time budget or a quality becomes, for a still or for all frames of a shot.

Settings that changed from frame to frame would be seen, and frames of other settings
could not use each other's samples.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

from ..cycles.passes import CyclesPasses
from ..frame import progress
from ..frame.job import Picture, RenderJob
from ..frame.picking import pick, report_pick
from ..planning.plan import Decision


@dataclass(frozen=True)
class ChosenJob:
    """The job that is rendered, and why it is this one.

    `denoise_in_time` is as in `Pick`.
    """

    job: RenderJob
    decisions: tuple[Decision, ...] = ()
    denoise_in_time: Callable[[], str] | None = None

    def all_decisions(self, rest: tuple[Decision, ...]) -> tuple[Decision, ...]:
        """Why it is this job, and the rest; of Cycles alone the choice says all."""
        alone = self.decisions and self.job.plain
        return self.decisions if alone else (*self.decisions, *rest)

    def told(self, picture: Picture) -> Picture:
        """A picture with what it was rendered by."""
        plan, job = self.all_decisions(picture.plan), picture.job or self.job
        return replace(picture, plan=plan, job=job)


@contextmanager
def chosen(
    engine: Any, depsgraph: Any, job: RenderJob, start: float, shot: bool = False
) -> Iterator[ChosenJob]:
    """Choose what a job leaves open, by probes of the frame.

    Inside the `with` Cycles has the session of the probes, with its scene. `start` and
    `shot` are as in `pick`, which says what is raised.
    """
    if not job.is_picked:
        yield ChosenJob(job)
        return
    with CyclesPasses(engine, depsgraph) as passes:
        picked = pick(passes, job, start, shot=shot)
        report_pick(engine, picked)
        yield ChosenJob(picked.job, (picked.decision,), picked.denoise_in_time)


def choose_for_shot(engine: Any, depsgraph: Any, job: RenderJob) -> ChosenJob:
    """Choose what the job of a shot leaves open; raises what `pick` raises."""
    try:
        with chosen(engine, depsgraph, job, time.perf_counter(), shot=True) as found:
            return found
    finally:
        progress.end()
