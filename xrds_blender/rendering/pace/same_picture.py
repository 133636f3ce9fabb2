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
from typing import Any, ClassVar, NamedTuple

import numpy as np

from xrds_core.accumulation.accumulate import Accumulated
from xrds_core.accumulation.passes import Passes
from xrds_core.errors import warn
from xrds_core.pace.error import gain
from xrds_core.pace.history import History
from xrds_core.pace.savings import Savings
from xrds_core.pace.worth import Worth
from xrds_core.shot import Shot

from ...cycles.settings import LOOKS_EVERY
from ...planning.plan import SAME_PICTURE, Decision
from ...planning.request import Request
from ...scene.contents import stands_still
from ..methods import Finishing
from ..sampling import Sampled, can_continue, is_even
from .measuring import Measured, measure, price_of_measuring
from .more import Extra, More, Part, whole_of, with_more
from .obstacles import can_save

_FIRST = 0.25  # share that the first frames have
# The least share, but where frames add up under a camera that stands still; and the
# next share over the present one.
_LEAST_SHARE, _FALL = 0.125, 0.5
# Under a threshold fewer samples than this, on the mean, are taken evenly: both halves
# of a frame have at least one step there, and two to differ in. So where a file takes
# 48, its halves would take 64.
_FEW = 4 * LOOKS_EVERY
_LEAST = 2  # samples of a frame, which has halves then
_ENOUGH = 0.8  # of what a frame needs; with less it gets more samples
# The share of the next frames stays as it is as long as the last frames needed so much
# of it, and no more: Cycles syncs the scene again for another number of samples.
_TOO_MUCH = 0.85
_LAST = 4  # frames: one alone may need more by chance
_CHANGED = 0.5  # of what neighbours add: a frame with less shows something new
# Where so many are needed all are taken: a frame of a few less is no sooner, and worse.
_ALL = 0.8
# Neighbours' samples of less worth count less beside more of the frame's own.
_USEFUL = 0.25


def same_picture(scene: Any, request: Request, shot: Shot) -> SamePicture | None:
    """What chooses the samples of a shot; None where frames have what is requested."""
    if not can_save(scene, request, len(shot.order)):
        return None
    history = History() if can_continue(scene, request) else None
    pace = SamePicture(
        scene.cycles.samples,
        history,
        shot=shot,
        exposure=2.0**scene.view_settings.exposure,
        has_threshold=not is_even(scene, request),
        moves=not stands_still(scene.camera),
    )
    pace.share = pace.possible(_FIRST)
    return pace


class Gathered(NamedTuple):
    """A frame's `views` with the samples of `others`, and what these add to it.

    It has `gained` so many times its own samples, among frames of its own share `even`
    so many. That took `seconds`.
    """

    views: Mapping[str, Accumulated]
    others: Sequence[Sampled]
    gained: float
    even: float
    seconds: float


@dataclass
class SamePicture:
    """How many samples the frames of a shot take, from the first that is finished.

    `samples` are the file's, where it `has_threshold` the most that a pixel takes.
    Under a camera that stands still, and never `moves`, frames that have left the
    window count, as `history`. The next frame to be sampled takes a `share` of what the
    file does, more near the ends of the `shot`, where it has fewer neighbours. White is
    a luminance of 1 / `exposure`.
    """

    samples: int
    history: History | None = None
    share: float = _FIRST
    shot: Shot = field(default_factory=partial(Shot, (), 0))
    exposure: float = 1.0
    has_threshold: bool = False
    moves: bool = True
    # what a file with a threshold takes, on the mean of its pixels, once it is known
    _asked: float | None = None
    _worth: Worth = field(default_factory=Worth)
    _savings: Savings = field(init=False)
    _is_decided: bool = False  # whether it saves enough, and that was said
    _takes_all: bool = False  # because it does not
    _reason: str = ""
    _measured_in: int | None = None
    _measurements: int = 0
    # of frames: what all pixels have, with what was measured by where that was done
    _shares: dict[int, float] = field(default_factory=dict)
    _gains: deque[float] = field(default_factory=partial(deque, maxlen=_LAST))
    _requested: float = _FIRST  # the share of the frame that was sampled last
    _taken: int = 0  # of the sequence that frames continue under a still camera
    _taken_more: int = 0  # of that of more samples
    prepares: ClassVar[bool] = True

    def __post_init__(self) -> None:
        self._savings = Savings(self.samples)

    def request(self, request: Request, number: int) -> Request:
        """The request of the next frame that is sampled."""
        self._requested = share = self._share_for(number)
        if self._is_few(share):
            return request.with_settings(samples=self._of_file, share=share)
        begin = None if self.history is None else self._taken
        return request.with_settings(share=share, begin=begin)

    def takes(self, method: Finishing, frame: Sampled) -> bool:
        """Note that a frame was sampled as requested."""
        self._shares[frame.number] = self._share(frame, self._requested)
        self._taken += round(self.samples * self._requested)
        return True

    def prepare(
        self, method: Finishing, own: Sampled, others: Sequence[Sampled]
    ) -> Gathered:
        """A frame with the samples of its neighbours, and what these add to it."""
        view, started = next(iter(own.views)), time.perf_counter()
        frame, beside = own.views[view], [x.number for x in others]
        others = (*others, *self._before(own, others))
        gathered = {v: method.accumulate(own, others, v) for v in own.views}
        gained = gain(gathered[view], frame)
        lent = self._lent(self._shares.get(own.number, 1.0), beside)
        even = gained if lent == 1.0 else gain(gathered[view], frame, lent)
        seconds = time.perf_counter() - started
        return Gathered(gathered, others, gained, even, seconds)

    def complete(
        self,
        method: Finishing,
        own: Sampled,
        others: Sequence[Sampled],
        more: More,
        prepared: Gathered,
    ) -> Sampled:
        """A frame with all that it is finished from, more samples where it lacks them.

        Raises Cancelled when the user stops their render.
        """
        view, beside = next(iter(own.views)), [x.number for x in others]
        frame, others = own.views[view], prepared.others
        gained, even = prepared.gained, prepared.even
        own = replace(own, gathered=prepared.views)
        spent = {"accumulate": prepared.seconds}
        render = partial(_rendered, more, spent)
        share = self._shares.get(own.number, 1.0)
        if self._is_new(own, beside, even):
            self._worth = Worth()
        extra: list[Extra] = []
        is_whole = False  # measured in all of it, which has all samples then
        beyond = 0.0  # the share of all samples that it is measured by
        # One frame of many samples is worth less than many of few: all its pixels lie
        # as far beside this one's. So it is not to be among the neighbours.
        is_due = self._worth.is_due(len(beside)) and self._measured_in not in beside
        if beside and is_due and not self._takes_all:
            how = self.samples, self.exposure, self._measurements
            measured = measure(method, own, others, *how, render)
            if not self._is_decided:
                self._time_one(more, spent)
            extra += measured.extra
            self._learn(own, measured, gained, len(beside))
            is_whole = bool(measured.asked.all())
            beyond = 2.0 * float(measured.asked.mean()) / self._of_file
            share = self._shares.get(own.number, share)  # of a threshold known now
        self._choose_next(even)
        missing = 0 if is_whole else self._missing(share, gained)
        if missing:
            part = self._more_of_all(missing)
            extra.append(Extra(whole_of(frame.shape), render(part)))
        own = with_more(own, extra, self._weight)
        self._note_seconds(own, share, was_measured=beyond > 0.0)
        self._shares[own.number] = share + beyond  # what it lends
        share *= own.views[view].samples / frame.samples
        return replace(
            own,
            samples=None,
            seconds=_added(own.seconds, spent),
            share=share,
            decisions=(self._decision(share),),
        )

    def _is_new(self, own: Sampled, beside: Sequence[int], even: float) -> bool:
        """Whether a frame shows something else than those before it, as after a cut.

        `even` is what it gains among frames of its own share.
        """
        if not beside or own.number < min(beside):
            return bool(beside)
        usual = np.mean(self._gains) if self._gains else 0.0
        is_less = even < _CHANGED * usual
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
        return self.samples if self._asked is None else round(self._asked)

    def _is_few(self, share: float) -> bool:
        """Whether a frame takes even samples, of a file with a threshold.

        Under a camera that stands still its samples would be of another sequence.
        """
        asked = self._asked
        return self.moves and asked is not None and share * asked < _FEW

    def _share(self, frame: Sampled, asked: float) -> float:
        """What a frame has of the file's samples.

        Under a noise threshold that is not what it was `asked` for: a pixel has a
        least number, and Cycles stops in steps.
        """
        if self._asked is None:
            return asked
        return float(next(iter(frame.views.values())).samples / self._asked)

    # ---- what was measured in a frame

    def _learn(
        self, own: Sampled, measured: Measured, gained: float, neighbours: int
    ) -> None:
        """Learn from a frame what neighbours' samples are worth."""
        share = self._shares.get(own.number, 1.0)
        if self.has_threshold:
            is_first = self._asked is None
            self._asked = float(measured.asked[measured.asked > 0.0].mean())
            had = self._share(own, share)
            if is_first:  # what the others have is known now as well
                self._shares = {n: x * had / share for n, x in self._shares.items()}
            share = self._shares[own.number] = had
        price = price_of_measuring(next(iter(own.views.values())).shape)
        self._worth.add(measured.errors, share, gained, neighbours, price)
        self._savings.denoising = measured.denoising
        self._savings.samples = self._of_file
        self._measured_in = own.number
        self._measurements += 1
        self._reason = (
            f"measured in frame {own.number}: with neighbours, {share:.0%} of them had "
            f"{measured.errors.ratio:.2f} times the error of the file's"
        )

    def _time_one(self, more: More, spent: dict[str, float]) -> None:
        """Note what a render of one sample takes, which is not used."""
        _, seconds = more(Part(1, 1.0 / self.samples, sequence=0))
        self._savings.one = seconds["beauty"]
        spent.update(_added(spent, seconds))

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

    def _equal(self, share: float, gain: float) -> float:
        """The share of all samples that is as good without neighbours.

        `gain` is how many times its own samples the frame has with them.
        """
        return share * (1.0 + (gain - 1.0) * self._worth.value)

    @property
    def _weight(self) -> float:
        """What neighbours' samples count beside more of the frame's own."""
        return min(self._worth.value / _USEFUL, 1.0)

    def _missing(self, share: float, gain: float) -> int:
        """How many samples a frame lacks, up to all of the file's."""
        equal = self._equal(share, gain)
        if share >= 1.0 or equal >= _ENOUGH:
            return 0
        most = self.samples - round(self.samples * share)
        return min(round(self.samples * (1.0 - equal)), most)

    def _more_of_all(self, length: int) -> Part:
        """So many more samples of a whole frame."""
        begin = None if self.history is None else self._taken_more
        self._taken_more += length
        at_once = round(self.samples * self._requested)
        return Part(length, length / self.samples, None, begin, at_once)

    def _lent(self, share: float, others: Sequence[int]) -> float:
        """What neighbours will lend if all frames have a `share`, over what they do.

        The first frames have fewer of them than those that are sampled next.
        """
        beside = [self._shares.get(number, 1.0) for number in others]
        if not beside:
            return 1.0
        more = max(2 * self.shot.radius / len(beside), 1.0)
        return share / float(np.mean(beside)) * more

    def _choose_next(self, gain: float) -> None:
        """Let the next frames have about the share that is enough if all have it.

        `gain` is how many times its own samples a frame has then.
        """
        if self._takes_all:
            return
        self._gains.append(gain)
        needed = 1.0 / self._equal(1.0, float(np.mean(self._gains)))
        least = _LEAST_SHARE if self.history is None else 0.0
        needed = max(needed, least, self.share * _FALL)
        if not _TOO_MUCH <= needed / self.share <= 1.0:
            self.share = self.possible(needed)

    def _share_for(self, number: int) -> float:
        """The share of a frame, more where it has fewer neighbours than others.

        What it lacked afterwards would be of another sequence, which is worth less. As
        `history`, frames before the window make up for those that are missing.
        """
        has = len(self.shot.neighbours(number)) / max(2 * self.shot.radius, 1)
        if not self._gains or has >= 1.0 or self.history is not None:
            return self.share
        # most of those that there are have no more samples than others
        usual = self._equal(self.share, float(np.mean(self._gains)))
        lent = has * (usual - self.share)
        return max(self.share, self.possible(1.0 - lent))

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
