"""The passes of one view of a frame in one record, with what each of them is.

As rendered, they are a `Passes`; with a number and a camera a `Frame`; packed, what
`store` makes of that. A further pass is a field and a row of `LAYOUT` here, what
Cycles calls it in `xrds_blender/cycles/samples.py`, and how it is packed in `frame.py`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from ..errors import PictureError
from ..native.library import bands, in_threads

if TYPE_CHECKING:
    from ..arrays import Array


class Joined(Enum):
    """What two halves of a frame's samples have together."""

    MEAN = "weighted by the samples of each"
    SUM = "added up"
    FIRST = "the first half's: what is of one sample has no mean"


@dataclass(frozen=True)
class Layout:
    """What a pass is: its channels, and its name and precision in files.

    `channels` are () for (H, W) and (C,) for (H, W, C). `name` and `letters` are those
    of Cycles' own files where there is such a pass; with `is_full` they are float32
    there, else half floats.
    """

    channels: tuple[int, ...]
    name: str
    letters: str
    joined: Joined = Joined.MEAN
    is_full: bool = False


LAYOUT = {
    "radiance": Layout((3,), "Noisy Image", "RGB"),
    "alpha": Layout((), "Noisy Image", "A"),
    "albedo": Layout((3,), "Denoising Albedo", "RGB"),
    "normal": Layout((3,), "Denoising Normal", "XYZ"),
    "depth": Layout((), "Depth", "Z", Joined.FIRST, is_full=True),
    "vector": Layout((4,), "Vector", "XYZW", Joined.FIRST),
    "path_length": Layout((), "Denoising Depth", "Z", is_full=True),
    "counts": Layout((), "XRDS Samples", "X", Joined.SUM),
    "strength": Layout((), "XRDS Strength", "X", Joined.FIRST),
}
"""By the name of the field."""


@dataclass(frozen=True, kw_only=True)
class Passes:
    """One view of a frame as a renderer returns it; arrays are never changed.

    Parameters
    ----------
    normal : (H, W, 3) ndarray
        In camera space, but with Z pointing away from the viewer, as in Cycles'
        `Denoising Normal`. It gives the size of all others.
    albedo : (H, W, 3) ndarray
        0 to 1 without a unit.
    radiance : (H, W, 3) ndarray, optional
        Scene-linear, premultiplied with alpha. None in a frame of guides alone: these
        then decide whether two frames show the same.
    alpha : (H, W) ndarray, optional
        Coverage.
    depth : (H, W) ndarray, optional
        Distance of the first hit from the camera in the scene's units, along the
        camera's axis (of a panorama along the ray), at each pixel's centre; infinite,
        or above 1e9, without a hit.
    vector : (H, W, 4) ndarray, optional
        Cycles' Vector pass: the surface's position one frame before minus its position
        now, then its position now minus the one a frame later, in pixels, y upwards.
        Without it all surfaces are assumed to stand still.
    path_length : (H, W) ndarray, optional
        The way from the camera, through mirrors and glass, to what albedo and normal
        show (Cycles' `Denoising Depth`).
    counts : (H, W) ndarray, optional
        Samples of each pixel, where they differ.
    strength : (H, W) ndarray, optional
        How much samples of neighbour frames count at each pixel, 0 to 1; 1 without it.
    parts : mapping of str to (H, W, 3) ndarray
        Light that the radiance is made of, and colours, by name.
    """

    normal: Array
    albedo: Array
    radiance: Array | None = None
    alpha: Array | None = None
    depth: Array | None = None
    vector: Array | None = None
    path_length: Array | None = None
    counts: Array | None = None
    strength: Array | None = None
    parts: Mapping[str, Array] = field(default_factory=dict)

    @property
    def shape(self) -> tuple[int, int]:
        """(H, W) of every array."""
        return self.normal.shape[0], self.normal.shape[1]

    @property
    def given(self) -> dict[str, Array]:
        """The passes that are there, by name, without the parts."""
        arrays = {name: getattr(self, name) for name in LAYOUT}
        return {name: x for name, x in arrays.items() if x is not None}

    @cached_property
    def picture(self) -> Array:
        """Radiance and alpha, (H, W, 4), or radiance alone."""
        assert self.radiance is not None
        if self.alpha is None:
            return self.radiance
        return np.dstack((self.radiance, self.alpha))

    def check_shapes(self, what: str) -> None:
        """Raise PictureError for arrays of another shape than the normal's."""
        arrays = [(name, x, LAYOUT[name].channels) for name, x in self.given.items()]
        arrays += [(name, part, (3,)) for name, part in self.parts.items()]
        for name, array, channels in arrays:
            if array.shape != self.shape + channels:
                raise PictureError(
                    f"{name} of {what} has shape {array.shape} where its normal "
                    f"requires {self.shape + channels}: give passes of one render"
                )

    def joined(self, other: Passes, share: Array) -> Self:
        """Return this half and another one together.

        Parameters
        ----------
        other : Passes
            The other half; what it lacks stays as it is in this one.
        share : (H, W) or () ndarray
            This half's share of the samples.
        """
        whole: dict[str, Any] = {}
        for name, layout in LAYOUT.items():
            one, two = getattr(self, name), getattr(other, name)
            if layout.joined is Joined.FIRST or one is None or two is None:
                whole[name] = one
            elif layout.joined is Joined.SUM:
                whole[name] = one + two
            else:
                whole[name] = weighted_mean(one, two, share)
        parts = {
            name: weighted_mean(x, other.parts[name], share)
            for name, x in self.parts.items()
        }
        return replace(self, **whole, parts=parts)


def weighted_mean(first: Array, second: Array, share: Array) -> Array:
    """Return the mean of two pictures, (H, W) or (H, W, C); `share` is the first's.

    The share is (H, W), or one number.
    """
    wide = share[(...,) + (None,) * (first.ndim - 2)] if share.ndim else share
    mean = np.empty(first.shape, np.result_type(first, second, wide))

    def work(rows: tuple[int, int]) -> None:
        band = slice(*rows)
        of_first = wide[band] if wide.ndim else wide
        np.multiply(first[band], of_first, out=mean[band])
        mean[band] += second[band] * (np.float32(1.0) - of_first)

    in_threads(work, bands(len(first)))
    return mean


def contiguous(picture: Array) -> Array:
    """Return a picture in the order of memory; a copy where it is not in that."""
    if picture.flags.c_contiguous:
        return picture
    copy = np.empty(picture.shape, picture.dtype)

    def work(rows: tuple[int, int]) -> None:
        copy[slice(*rows)] = picture[slice(*rows)]

    in_threads(work, bands(len(picture)))
    return copy
