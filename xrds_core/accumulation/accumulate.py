"""Accumulates the noisy samples of neighbour frames on the pixels of one frame.

Samples are gathered, never interpolated: each pixel takes the nearest pixel of the
neighbour frame. Interpolation would correlate the noise of adjacent pixels, and
denoisers mistake correlated noise for texture. How far that pixel lies from the true
place is taken out by registration, for which a frame is gathered twice. The mean is
weighted by sample counts, by what distance remains, which keeps fine texture sharp, and
by a similarity weight: do both frames show the same light?
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import floats
from ..errors import PictureError
from ..native.library import in_threads
from .camera import is_shot_cut
from .coarse_rejection import tile_weights
from .local_filters import find_ranges
from .object_motion import Movement
from .passes import weighted_mean
from .reprojection import pair
from .virtual_images import find_images
from .weighted_sums import Aligned, Means, Reprojected, Work, light_for_albedo

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from ..arrays import Array
    from .frame import Stored


# Standard deviation, in pixels, of the weight by distance where frames have one sample
# per pixel; it falls with their cube root. Noise calls for a wide one, texture for a
# narrow one: 0.7 and 0.6 were best at 1 and 2 samples, 0.2 to 0.3 at 16.
_SOFTNESS = 0.7


@dataclass(frozen=True)
class Accumulated:
    """A frame with the accumulated samples of its neighbour frames.

    Attributes
    ----------
    radiance : (H, W, 3) float32 array or None
        Scene-linear radiance, the mean over `samples`; NaN where no frame has any
        sample. None for a frame of guides alone.
    albedo : (H, W, 3) float32 array
        Mean albedo, NaN where no frame has any sample.
    normal : (H, W, 3) float32 array
        Mean normal in this frame's axes, NaN where no frame has any sample.
    alpha : (H, W) float32 array or None
        Mean alpha, NaN where no frame has any sample.
    samples : (H, W) float32 array
        Samples per pixel that the means are taken over.
    rejected : float
        Share of the neighbours' samples that were left out: those of pixels that a
        neighbour does not show, or shows in other light.
    frames : tuple of int
        Numbers of the frames that were considered: those between two shot cuts, the
        frame itself included.
    parts : mapping of str to (H, W, 3) float32 array
        AOVs and light passes, by name; means over `samples` as well.
    """

    radiance: Array | None
    albedo: Array
    normal: Array
    alpha: Array | None
    samples: Array
    rejected: float
    frames: tuple[int, ...]
    parts: Mapping[str, Array] = field(default_factory=dict)

    def merged(
        self, other: Accumulated, merge: Callable[[Array, Array], Array]
    ) -> Accumulated:
        """Return what a function makes of each pass of this and of another one."""

        def both(name: str) -> Any:
            pair = getattr(self, name), getattr(other, name)
            return None if pair[0] is None or pair[1] is None else merge(*pair)

        names = ("radiance", "albedo", "normal", "alpha")
        parts = {k: merge(part, other.parts[k]) for k, part in self.parts.items()}
        return replace(self, **{name: both(name) for name in names}, parts=parts)

    def filled(self, other: Accumulated) -> Accumulated:
        """Return this with another's passes where it has no samples."""
        holes = self.samples == 0.0
        if not holes.any():
            return self

        def fill(own: Array, reused: Array) -> Array:
            return np.where(holes if own.ndim == 2 else holes[..., None], reused, own)

        return self.merged(other, fill)


def accumulate(
    target: Stored,
    others: Sequence[Stored],
    movement: Movement | None = None,
    threads: int | None = None,
    strength: float = 1.0,
) -> Accumulated:
    """Accumulate the samples of neighbour frames on the pixels of a frame.

    No samples are reused across a shot cut. Without neighbours, and at pixels where
    these do not count, the result is the target as it is stored.

    Parameters
    ----------
    target : Stored
        The frame that samples are gathered for.
    others : sequence of Stored
        Neighbour frames, in any order.
    movement : Movement, optional
        Caches the object motion of this shot. Without it each call computes it again.
    threads : int, optional
        Number of threads, one for each processor by default. The result does not depend
        on it.
    strength : float
        How much neighbours count, times the target's own strength: a factor, from 0 to
        1, of their part in the mean.

    Returns
    -------
    accumulated : Accumulated
        Means over the target's own and the reused samples.

    Raises
    ------
    PictureError
        If the frames hold different passes.
    """
    strengths = target.strengths(strength)
    others = same_shot(target, others) if strengths.any() else []
    groups = _prepare_neighbours(target, others, movement or Movement(), threads)
    usual = light_for_albedo(target) if others and target.has_light else 0.0
    pairs = [
        neighbour.pair
        for group in groups
        for neighbour in group
        if neighbour.pair and neighbour.is_reused
    ]
    images = find_images(target, pairs, partial(in_threads, threads=threads))
    lit = _find_lit_parts(target, others)
    work = Work(target, images, usual, lit, threads)
    # the guess's own noise counts more than texture where samples are few
    registers = any(x.leads for x in pairs)
    guess = work.guess(groups[0]) if registers else None
    means = work.means(groups, guess)
    height, width = target.shape
    requested = sum(frame.samples for frame in others) * height * width
    rejected = 1.0 - means.reused / requested if requested else 0.0
    frames = tuple(sorted({target.number, *(frame.number for frame in others)}))
    accumulated = _unpack_means(target, means, lit, rejected, frames)
    if not others or (strengths == 1.0).all():
        return accumulated
    return _weaken(accumulated, accumulate(target, [], threads=threads), strengths)


def _weaken(
    accumulated: Accumulated, alone: Accumulated, strength: Array
) -> Accumulated:
    """Return the mean in which the neighbours' part is so many times what it was.

    An error of theirs is as many times smaller. The frame's own samples count as
    before, so there are as many as would leave neighbours this part of the mean.
    """
    # in a hole there is nothing but the neighbours' samples
    own = np.where(alone.samples > 0.0, alone.samples, accumulated.samples)
    with np.errstate(invalid="ignore"):  # where no frame has any
        part = strength * (1.0 - own / accumulated.samples)
        samples = np.where(strength == 1.0, accumulated.samples, own / (1.0 - part))
    mixed = accumulated.merged(
        alone.filled(accumulated), partial(weighted_mean, share=strength)
    )
    return replace(mixed, samples=np.nan_to_num(samples))


def _find_lit_parts(target: Stored, others: Sequence[Stored]) -> tuple[str, ...]:
    """Return the names of the parts that have light in any of the frames."""
    frames = (target, *others)
    return tuple(
        name
        for name in target.parts
        if any(frame.parts.get(name) is not None for frame in frames)
    )


def _prepare_neighbours(
    target: Stored,
    others: Sequence[Stored],
    movement: Movement,
    threads: int | None,
) -> tuple[list[Aligned | Reprojected], list[Aligned | Reprojected]]:
    """Return the neighbours in two groups: the nearest ones, and those farther away."""
    rest = [other for other in others if not target.shows_same(other)]
    motions = dict(
        zip(map(id, rest), movement.object_motions(target, rest), strict=True)
    )
    extent = find_ranges(target.inverse_depth, target.shape) if rest else None
    fall = -0.5 * target.samples ** (2 / 3) / _SOFTNESS**2
    near = _nearest_numbers(target, others)

    def prepare(other: Stored) -> Aligned | Reprojected:
        _check_same_passes(target, other)
        if id(other) not in motions:
            return Aligned(other)
        both = pair(target, other, motions[id(other)], extent)
        return Reprojected(both, tile_weights(both), fall)

    groups: tuple[list[Aligned | Reprojected], list[Aligned | Reprojected]] = ([], [])
    for neighbour in in_threads(prepare, others, threads):
        groups[neighbour.other.number not in near].append(neighbour)
    return groups


def _check_same_passes(target: Stored, other: Stored) -> None:
    kinds = [(frame.picture.shape[1], frame.parts.keys()) for frame in (target, other)]
    if kinds[0] != kinds[1]:
        raise PictureError(
            f"frame {other.number} and frame {target.number} hold different passes:"
            " give radiance, its parts and alpha for all frames of a shot or for none"
        )


def _nearest_numbers(target: Stored, others: Sequence[Stored]) -> set[int]:
    """Return the numbers of the frames just before and after, and the frame's own."""
    before = [frame.number for frame in others if frame.number < target.number]
    after = [frame.number for frame in others if frame.number > target.number]
    return {target.number, *sorted(before)[-1:], *sorted(after)[:1]}


def sample_counts(frame: Stored) -> Array:
    """Return the sample counts of a frame's pixels (H W,), invalid ones included."""
    if frame.counts is None:
        return np.full(len(frame.picture), frame.samples, np.float32)
    return floats(frame.counts)


def _unpack_means(
    target: Stored,
    means: Means,
    lit: tuple[str, ...],
    rejected: float,
    frames: tuple[int, ...],
) -> Accumulated:
    passes = list(means.passes)
    alpha = passes.pop()[..., 0] if target.picture.shape[1] % 3 else None
    *radiance, albedo, normal = passes
    light = dict(zip(lit, means.parts, strict=True))
    dark = np.zeros((*target.shape, 3), np.float32)
    return Accumulated(
        radiance[0] if radiance else None,
        albedo,
        normal,
        alpha,
        means.samples,
        rejected,
        frames,
        {name: light.get(name, dark) for name in target.parts},
    )


def same_shot(target: Stored, others: Sequence[Stored]) -> list[Stored]:
    """Return the frames that no shot cut separates from the target.

    Views of one moment, such as a stereo pair, belong to the same shot.

    Parameters
    ----------
    target : Stored
        The frame that the others are compared with.
    others : sequence of Stored
        Frames of any numbers.

    Returns
    -------
    frames : list of Stored
        Those of `others` in the target's shot, in their order.
    """
    cameras = {frame.number: frame.camera for frame in (*others, target)}
    numbers = {target.number}
    for step in (1, -1):
        number = target.number
        beyond = [n for n in cameras if (n - number) * step > 0]
        for after in sorted(beyond, key=lambda n: n * step):
            if is_shot_cut(cameras[number], cameras[after]):
                break
            numbers.add(after)
            number = after
    return [frame for frame in others if frame.number in numbers]
