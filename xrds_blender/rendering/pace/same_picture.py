"""The picture of the file's own settings from fewer samples, where neighbours help.

The first frame of a shot is rendered both ways, with a share of the file's samples and
with all of them, and the error of both is measured by halves. From there on what
neighbours add to a frame says how many samples the next ones need. A frame that lacks
samples, or a part of it that does, gets more before it is finished: up to all that the
file asks for, where neighbours add nothing.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from xrds_core.accumulation.local_filters import BLOCK
from xrds_core.accumulation.passes import Passes
from xrds_core.arrays import Array
from xrds_core.finish import rectangles
from xrds_core.pace.error import Gain, gain
from xrds_core.pace.history import History
from xrds_core.pace.worth import Clock, Worth

from ...cycles.low_resolution import Region
from ...cycles.settings import has_subsets, stops_at
from ...planning.plan import SAME_PICTURE, Decision
from ...planning.request import Request
from ...planning.settings import Mode
from ...scene.contents import stands_still
from ..methods import Finishing
from ..sampling import Sampled, can_continue, has_neighbours, is_even
from .measuring import Measured, Render, Threshold, learn_threshold, measure
from .more import (
    More,
    Part,
    blocks_beside,
    no_samples,
    region_of,
    unite,
    with_more,
    write_region,
)

FEWEST_SAMPLES = 8
"""Samples of the file from which it pays."""
FEWEST_FRAMES = 16
"""Frames of a shot from which it pays: the first costs more than the file asks for."""
_FIRST = 0.25  # share that the first frames have; less was not tried by then
_FALL = 0.5  # the next share over the present one, at least, where frames add up
_LEAST = 2  # samples of a frame, which has halves then
# Blocks with less than this share of what they need get more samples, and frames.
_LACKING, _ENOUGH = 0.5, 0.8
_MOST_LACKING = 0.5  # of the blocks; from there on the whole frame gets more
# The share of the next frames stays as it is as long as it is off by no more from what
# the last frames needed: Cycles syncs the scene again for another number of samples.
_TOO_MUCH, _TOO_LITTLE = 0.9, 1.1
_LAST = 4  # frames: one alone may need more by chance
# Where so many are needed all are taken: a frame of a few less is no sooner, and worse.
_ALL = 0.8
# Neighbours' samples of less worth count less beside more of the frame's own.
_USEFUL = 0.25


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


def same_picture(scene: Any, request: Request, frames: int) -> SamePicture | None:
    """What chooses the samples of a shot of so many frames.

    None where frames have what the request says.
    """
    if not can_save(scene, request, frames):
        return None
    history = History() if can_continue(scene, request) else None
    least = None
    if not is_even(scene, request):
        _, least = stops_at(scene.cycles, scene.cycles.samples)
    budget = SamePicture(
        scene.cycles.samples,
        history,
        neighbours=2 * request.settings.temporal_radius,
        exposure=2.0**scene.view_settings.exposure,
        least=least,
        moves=not stands_still(scene.camera),
    )
    budget.share = budget.possible(_FIRST)
    return budget


@dataclass
class SamePicture:
    """How many samples the frames of a shot take, from the first that is finished.

    `samples` are the file's, with a noise threshold the most that a pixel takes, and
    `least` the fewest. Under a camera that stands still, and never `moves`, frames that
    have left the window count, as `history`. The next frame to be sampled takes a
    `share` of what the file does. Frames have so many `neighbours`, but fewer near the
    ends of the shot. White is a luminance of 1 / `exposure`.
    """

    samples: int
    history: History | None = None
    share: float = _FIRST
    neighbours: int = 0
    exposure: float = 1.0
    least: int | None = None
    moves: bool = True
    _threshold: Threshold | None = None
    _worth: Worth = field(default_factory=Worth)
    _clock: Clock = field(default_factory=Clock)
    _measured_in: int | None = None
    _tried: float = 1.0
    _ratio: float = 1.0
    _shares: dict[int, float] = field(default_factory=dict)  # that all pixels have
    _gains: deque[float] = field(default_factory=partial(deque, maxlen=_LAST))
    _call: float = 0.0  # what more samples cost each time, in samples of a block
    _newest: int = 0  # samples of the frame that was sampled last
    _taken: int = 0  # of the sequence that frames continue under a still camera
    _taken_more: int = 0  # of that of more samples

    def request(self, request: Request) -> Request:
        """The request of the next frame that is sampled."""
        if self._is_few():
            return request.with_settings(samples=self._of_file, share=self.share)
        begin = None if self.history is None else self._taken
        return request.with_settings(share=self.share, begin=begin)

    def takes(self, method: Finishing, frame: Sampled) -> bool:
        """Note that a frame was sampled with the present share."""
        self._shares[frame.number] = self._share(frame, self.share)
        self._newest = round(self.samples * self.share)
        self._taken += self._newest
        return True

    def complete(
        self, method: Finishing, own: Sampled, others: Sequence[Sampled], more: More
    ) -> Sampled:
        """A frame with all that it is finished from, more samples where it lacks them.

        Raises Cancelled when the user stops their render.
        """
        view, started = next(iter(own.views)), time.perf_counter()
        before = own.views[view].samples
        beside = [x.number for x in others]
        others = [*others, *self._before(own, others)]
        accumulated = {v: method.accumulate(own, others, v) for v in own.views}
        own = replace(own, gathered=accumulated)
        share = self._shares.get(own.number, 1.0)
        gained = gain(accumulated[view], own.views[view])
        spent = _Seconds({"accumulate": time.perf_counter() - started})
        shape = own.views[view].shape
        extra: dict[str, Passes] = {}
        regions: list[Region] = []
        noted = spent.of(self._priced(more, shape))
        # One frame of many samples is worth less than many of few: all its pixels lie
        # as far beside this one's. So it is not to be among the neighbours.
        if self._worth.is_due(len(beside)) and self._measured_in not in beside:
            measured = self._measure(method, own, others, noted)
            extra, regions = measured.extra, measured.regions
            share = self._learn(own, share, measured.asked)
            whole = gained.of(gained.errors > 0.0)
            self._worth.add(measured.ratio, share, whole, len(beside))
            self._tried = share
        shares = np.full_like(gained.errors, share)
        if self._threshold is not None and own.samples is not None:  # even ones
            shares /= self._threshold.density(own.views[view])
        lacks = self._lacks(shares, gained)
        rest = ~lacks if lacks.mean() < _MOST_LACKING else gained.errors > 0.0
        lent = self._lent(share, beside)
        even = gained
        if lent != 1.0:  # among frames of other shares
            even = gain(accumulated[view], own.views[view], lent)
        self._choose_next(even.of(rest))
        # where it was measured it has all now
        for part in blocks_beside(lacks, regions):
            further = self._top_up(shape, shares, gained, part, noted)
            extra = unite(extra, further)
        own = with_more(own, extra, self._weight)
        if regions:
            self._clock.leave_out(time.perf_counter())
        else:
            self._clock.add(time.perf_counter(), own.seconds, share)
        share *= own.views[view].samples / before
        if len(regions) == 1:  # all of the picture
            self._shares[own.number] = share
        return replace(
            own,
            samples=None,
            seconds=spent.added_to(own.seconds),
            share=share,
            decisions=(self._decision(share),),
        )

    def _measure(
        self, method: Finishing, own: Sampled, others: Sequence[Sampled], more: Render
    ) -> Measured:
        """Compare a frame with its neighbours to one of all samples."""
        measured = measure(
            method, own, others, self.samples, self.exposure, more, self.least
        )
        self._clock.denoising = measured.denoising
        self._measured_in, self._ratio = own.number, measured.ratio.value
        return measured

    def _before(self, own: Sampled, others: Sequence[Sampled]) -> list[Sampled]:
        """What frames before the window have left, as one that lies beside it."""
        history = self.history
        if history is None:
            return []
        history.advance({x.number: x.views for x in (own, *others)})
        return [Sampled(history.number, history.views, {})] if history.views else []

    def _decision(self, share: float) -> Decision:
        """What a frame was sampled with, and why."""
        reason = (
            f"measured in frame {self._measured_in}: with neighbours, "
            f"{self._tried:.0%} of them had {self._ratio:.2f} times the error of the "
            "file's"
        )
        return Decision(SAME_PICTURE, f"{share:.0%} of the file's samples", reason)

    @property
    def _of_file(self) -> int:
        """Samples of the file's frames, on the mean of their pixels."""
        threshold = self._threshold
        return self.samples if threshold is None else round(threshold.samples)

    def _is_few(self) -> bool:
        """Whether the next frame takes even samples, of a file with a threshold.

        Under a camera that stands still its samples would be of another sequence.
        """
        threshold = self._threshold
        return self.moves and threshold is not None and threshold.is_few(self.share)

    def _share(self, frame: Sampled, asked: float) -> float:
        """What a frame has of the file's samples.

        Under a noise threshold that is not what it was `asked` for: a pixel has a
        least number, and Cycles stops in steps.
        """
        if self._threshold is None:
            return asked
        return float(next(iter(frame.views.values())).samples / self._threshold.samples)

    def _learn(self, own: Sampled, share: float, asked: Array) -> float:
        """Learn what the noise threshold asks for; the share that a frame has."""
        if self.least is None:
            return share
        is_first = self._threshold is None
        self._threshold = learn_threshold(next(iter(own.views.values())), asked)
        had = self._share(own, share)
        if is_first:  # what the others have is known now as well
            self._shares = {n: x * had / share for n, x in self._shares.items()}
        return had

    def _equal(self, share: Any, gain: Any) -> Any:
        """The share of all samples that is as good without neighbours.

        `gain` is how many times its own samples the frame has with them.
        """
        return share * (1.0 + (gain - 1.0) * self._worth.value)

    @property
    def _weight(self) -> float:
        """What neighbours' samples count beside more of the frame's own."""
        return min(self._worth.value / _USEFUL, 1.0)

    def _lacks(self, shares: Array, gained: Gain) -> NDArray[np.bool_]:
        """Which blocks, that have `shares` of the file's samples, are to get more."""
        whole = np.ones(gained.errors.shape, bool)
        if (shares >= 1.0).all():
            return ~whole
        with np.errstate(invalid="ignore"):  # blocks without noise lack nothing
            lacks = self._equal(shares, gained.blocks) < _LACKING
        enough = self._equal(shares.mean(), gained.of(whole)) >= _ENOUGH
        return lacks if enough and lacks.mean() < _MOST_LACKING else whole

    def _top_up(
        self,
        shape: tuple[int, int],
        shares: Array,
        gained: Gain,
        lacks: NDArray[np.bool_],
        more: Render,
    ) -> dict[str, Passes]:
        """Render more samples where a frame lacks them, up to all of the file's."""
        extra: dict[str, Passes] = {}
        if not lacks.any():
            return extra
        length = self._missing(shares, gained, lacks)
        for rows, columns in rectangles(lacks, self._call / max(length, 1)):
            there = np.zeros_like(lacks)
            there[rows, columns] = lacks[rows, columns]
            length = self._missing(shares, gained, there)
            if length < 1:
                continue
            region = region_of(rows, columns, shape)
            begin = None if self.history is None else self._taken_more
            self._taken_more += length
            part = Part(length, length / self.samples, region, begin, self._newest)
            for view, samples in more(part).items():
                whole = extra.setdefault(view, no_samples(shape, samples.parts))
                write_region(whole, region, samples)
        return extra

    def _priced(self, more: More, shape: tuple[int, int]) -> More:
        """The same; what a call costs beside its samples is noted."""

        def priced(part: Part) -> tuple[dict[str, Passes], dict[str, float]]:
            by_view, seconds = more(part)
            region = part.region or Region(0, 0, shape[1], shape[0])
            samples = part.length * region.width * region.height / BLOCK**2
            if seconds["beauty"]:
                self._call = samples * seconds["sync"] / seconds["beauty"]
            return by_view, seconds

        return priced

    def _missing(self, shares: Array, gained: Gain, blocks: NDArray[np.bool_]) -> int:
        """How many samples some blocks lack, up to all of the file's."""
        share = float(shares[blocks].mean())
        equal = float(self._equal(share, gained.of(blocks)))
        most = self.samples - round(self.samples * share)
        return min(max(round(self.samples * (1.0 - equal)), 0), most)

    def _lent(self, share: float, others: Sequence[int]) -> float:
        """What neighbours will lend if all frames have a `share`, over what they do.

        The first frames have fewer of them than those that are sampled next.
        """
        beside = [self._shares.get(number, 1.0) for number in others]
        if not beside:
            return 1.0
        more = max(self.neighbours / len(beside), 1.0)
        return share / float(np.mean(beside)) * more

    def _choose_next(self, gain: float) -> None:
        """Let the next frames have about the share that is enough if all have it.

        `gain` is how many times its own samples a frame has then.
        """
        self._gains.append(gain)
        needed = 1.0 / float(self._equal(1.0, np.mean(self._gains)))
        least = _FIRST if self.history is None else self.share * _FALL
        needed = max(needed, least)
        if not _TOO_MUCH <= needed / self.share <= _TOO_LITTLE:
            self.share = self.possible(needed)

    def possible(self, share: float) -> float:
        """The next share of whole samples."""
        if not share < _ALL:
            return 1.0
        return max(_LEAST, np.ceil(self._of_file * share)) / self._of_file


@dataclass
class _Seconds:
    """What more samples have taken, by stage."""

    stages: dict[str, float] = field(default_factory=dict)

    def of(self, more: More) -> Render:
        """The same without the seconds, which are noted here."""

        def noted(part: Part) -> dict[str, Passes]:
            samples, seconds = more(part)
            self.stages = self.added_to(seconds)
            return samples

        return noted

    def added_to(self, seconds: Mapping[str, float]) -> dict[str, float]:
        """Together with others."""
        names = self.stages.keys() | seconds.keys()
        return {x: self.stages.get(x, 0.0) + seconds.get(x, 0.0) for x in names}
