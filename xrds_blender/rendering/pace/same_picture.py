"""The picture of the file's own settings from fewer samples, where neighbours help.

Each frame is sampled with a share of the file's samples. Once its neighbours are there
it is judged: what they add says whether it is to get more samples before it is
finished, and what share the next frames take. In few frames of a take the error is
measured, beside that of all samples: it tells what neighbours' samples are worth. Where
fewer samples are hardly sooner, frames take all of them.
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

from xrds_core.accumulation.passes import Passes
from xrds_core.arrays import Array
from xrds_core.errors import warn
from xrds_core.finish import rectangles
from xrds_core.pace.error import Gain, gain
from xrds_core.pace.history import History
from xrds_core.pace.savings import Savings
from xrds_core.pace.worth import Worth

from ...planning.plan import SAME_PICTURE, Decision
from ...planning.request import Request
from ...scene.contents import stands_still
from ..methods import Finishing
from ..sampling import Sampled, can_continue, is_even
from .measuring import Measured, Render, measure
from .more import Extra, More, Part, blocks_beside, region_of, with_more
from .obstacles import can_save
from .threshold import Threshold, learn_threshold

_FIRST = 0.25  # share that the first frames have
# The least share, but where frames add up under a camera that stands still; and the
# next share over the present one.
_LEAST_SHARE, _FALL = 0.125, 0.5
_LEAST = 2  # samples of a frame, which has halves then
# Blocks with less than this share of what they need get more samples, and frames.
_LACKING, _ENOUGH = 0.5, 0.8
_MOST_LACKING = 0.5  # of the blocks; from there on the whole frame gets more
_PARTS = 2  # of a frame that get more: for each Cycles syncs the scene again
# The share of the next frames stays as it is as long as the last frames needed so much
# of it, and no more: Cycles syncs the scene again for another number of samples.
_TOO_MUCH = 0.85
_LAST = 4  # frames: one alone may need more by chance
_CHANGED = 0.5  # of what neighbours add: a frame with less shows something new
# Where so many are needed all are taken: a frame of a few less is no sooner, and worse.
_ALL = 0.8
# Neighbours' samples of less worth count less beside more of the frame's own.
_USEFUL = 0.25


def same_picture(scene: Any, request: Request, frames: int) -> SamePicture | None:
    """What chooses the samples of a shot of so many frames.

    None where frames have what the request says.
    """
    if not can_save(scene, request, frames):
        return None
    history = History() if can_continue(scene, request) else None
    pace = SamePicture(
        scene.cycles.samples,
        history,
        neighbours=2 * request.settings.temporal_radius,
        exposure=2.0**scene.view_settings.exposure,
        has_threshold=not is_even(scene, request),
        moves=not stands_still(scene.camera),
    )
    pace.share = pace.possible(_FIRST)
    return pace


@dataclass
class SamePicture:
    """How many samples the frames of a shot take, from the first that is finished.

    `samples` are the file's, where it `has_threshold` the most that a pixel takes.
    Under a camera that stands still, and never `moves`, frames that have left the
    window count, as `history`. The next frame to be sampled takes a `share` of what the
    file does. Frames have so many `neighbours`, but fewer near the ends of the shot.
    White is a luminance of 1 / `exposure`.
    """

    samples: int
    history: History | None = None
    share: float = _FIRST
    neighbours: int = 0
    exposure: float = 1.0
    has_threshold: bool = False
    moves: bool = True
    _threshold: Threshold | None = None
    _worth: Worth = field(default_factory=Worth)
    _savings: Savings = field(default_factory=Savings)
    _is_decided: bool = False  # whether it saves enough, and that was said
    _takes_all: bool = False  # because it does not
    _reason: str = ""
    _measured_in: int | None = None
    # of frames: what all pixels have, with what was measured by where that was done
    _shares: dict[int, float] = field(default_factory=dict)
    _gains: deque[float] = field(default_factory=partial(deque, maxlen=_LAST))
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
        frame, beside = own.views[view], [x.number for x in others]
        others = [*others, *self._before(own, others)]
        gathered = {v: method.accumulate(own, others, v) for v in own.views}
        own = replace(own, gathered=gathered)
        gained = gain(gathered[view], frame)
        spent = {"accumulate": time.perf_counter() - started}
        render = partial(_rendered, more, spent)
        if self._is_new(own, beside, gained):
            self._worth = Worth()
        extra: list[Extra] = []
        beyond = 0.0  # the share of all samples that it is measured by
        # One frame of many samples is worth less than many of few: all its pixels lie
        # as far beside this one's. So it is not to be among the neighbours.
        is_due = self._worth.is_due(len(beside)) and self._measured_in not in beside
        if beside and is_due and not self._takes_all:
            measured = measure(method, own, others, self.samples, self.exposure, render)
            extra += measured.extra
            self._learn(own, measured, gained, len(beside))
            beyond = 2.0 * float(measured.asked.mean()) / self._of_file
        share = self._shares.get(own.number, 1.0)
        shares = np.full_like(gained.errors, share)
        if self._threshold is not None and own.samples is not None:  # even ones
            shares /= self._threshold.density(frame)
        lacks = self._lacks(shares, gained)
        rest = ~lacks if lacks.mean() < _MOST_LACKING else gained.errors > 0.0
        lent = self._lent(share, beside)  # among frames of its own share
        even = gained if lent == 1.0 else gain(gathered[view], frame, lent)
        self._choose_next(even.of(rest))
        # where it was measured it has all now
        regions = [region for region, _ in extra]
        for part in blocks_beside(lacks, regions):
            extra += self._top_up(frame.shape, shares, gained, part, render)
        own = with_more(own, extra, self._weight)
        self._note_seconds(own, share, bool(regions))
        self._shares[own.number] = share + beyond  # what it lends
        share *= own.views[view].samples / frame.samples
        return replace(
            own,
            samples=None,
            seconds=_added(own.seconds, spent),
            share=share,
            decisions=(self._decision(share),),
        )

    def _is_new(self, own: Sampled, beside: Sequence[int], gained: Gain) -> bool:
        """Whether a frame shows something else than those before it, as after a cut."""
        if not beside or own.number < min(beside):
            return bool(beside)
        usual = np.mean(self._gains) if self._gains else 0.0
        is_less = gained.whole < _CHANGED * usual
        return bool(is_less) and self._worth.is_old

    def _before(self, own: Sampled, others: Sequence[Sampled]) -> list[Sampled]:
        """What frames before the window have left, as one that lies beside it."""
        history = self.history
        if history is None:
            return []
        history.advance({x.number: x.views for x in (own, *others)})
        return [Sampled(history.number, history.views, {})] if history.views else []

    def _decision(self, share: float) -> Decision:
        """What a frame was sampled with, and why."""
        value = f"{share:.0%} of the file's samples"
        return Decision(SAME_PICTURE, value, self._reason)

    # ---- what a file with a noise threshold asks for

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

    # ---- what was measured in a frame

    def _learn(
        self, own: Sampled, measured: Measured, gained: Gain, neighbours: int
    ) -> None:
        """Learn from a frame what neighbours' samples are worth."""
        share = self._shares.get(own.number, 1.0)
        if self.has_threshold:
            is_first = self._threshold is None
            frame = next(iter(own.views.values()))
            self._threshold = learn_threshold(frame, measured.asked)
            had = self._share(own, share)
            if is_first:  # what the others have is known now as well
                self._shares = {n: x * had / share for n, x in self._shares.items()}
            share = self._shares[own.number] = had
        self._worth.add(measured.errors, share, gained.whole, neighbours)
        self._savings.denoising = measured.denoising
        self._measured_in = own.number
        self._reason = (
            f"measured in frame {own.number}: with neighbours, {share:.0%} of them had "
            f"{measured.errors.ratio:.2f} times the error of the file's"
        )

    def _note_seconds(self, own: Sampled, share: float, was_measured: bool) -> None:
        """Note what a frame took; decide once whether fewer samples are sooner."""
        savings, now = self._savings, time.perf_counter()
        if was_measured:
            savings.leave_out(now)
        else:
            savings.add(now, own.seconds, share)
        if self._is_decided or not savings.are_known:
            return
        self._is_decided, self._takes_all = True, not savings.are_enough
        ours, theirs = savings.seconds
        seconds = f"{ours:.3g} s a frame, Cycles with its denoiser about {theirs:.3g} s"
        if not self._takes_all:
            warn(f"the same picture in fewer samples: {seconds}")
            return
        self.share = 1.0
        self._reason = f"fewer samples are hardly sooner: {seconds}"
        warn(f"{self._reason}; so frames take all samples, for less flicker")

    # ---- what a frame lacks, and what the next ones take

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
        render: Render,
    ) -> list[Extra]:
        """Render more samples where a frame lacks them, up to all of the file's."""
        extra = []
        for rows, columns in rectangles(lacks, most=_PARTS):
            there = np.zeros_like(lacks)
            there[rows, columns] = lacks[rows, columns]
            length = self._missing(shares, gained, there)
            if length < 1:
                continue
            region = region_of(rows, columns, shape)
            begin = None if self.history is None else self._taken_more
            self._taken_more += length
            part = Part(length, length / self.samples, region, begin, self._newest)
            extra.append(Extra(region, render(part)))
        return extra

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
        if self._takes_all:
            return
        self._gains.append(gain)
        needed = 1.0 / float(self._equal(1.0, np.mean(self._gains)))
        least = _LEAST_SHARE if self.history is None else 0.0
        needed = max(needed, least, self.share * _FALL)
        if not _TOO_MUCH <= needed / self.share <= 1.0:
            self.share = self.possible(needed)

    def possible(self, share: float) -> float:
        """The next share of whole samples."""
        if not share < _ALL:
            return 1.0
        return max(_LEAST, np.ceil(self._of_file * share)) / self._of_file


def _rendered(more: More, spent: dict[str, float], part: Part) -> dict[str, Passes]:
    """More samples; their seconds are added to those `spent`."""
    samples, seconds = more(part)
    spent.update(_added(spent, seconds))
    return samples


def _added(one: Mapping[str, float], two: Mapping[str, float]) -> dict[str, float]:
    """Seconds by stage, together."""
    return {x: one.get(x, 0.0) + two.get(x, 0.0) for x in one.keys() | two.keys()}
