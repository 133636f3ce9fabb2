"""One frame's samples: as rendered, and packed as a window stores them.

Arrays are float32 (H, W, C), row 0 on top, radiance scene-linear. World space is the
renderer's; a camera looks along its own -Z with X to the right and Y up (OpenGL,
Blender). Pixel (0, 0) of an array covers [0, 1) in both directions, so that its centre
lies at (0.5, 0.5); y grows downwards.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import LARGEST_HALF, floats
from ..errors import PictureError
from ..native import structures
from ..native.library import Arrays, bands, in_threads, library
from .camera import SKY_DEPTH, Camera
from .local_filters import extreme, find_rims
from .noise import Noise, guide_factor, light_factor
from .passes import Passes

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from ..arrays import Array

    Packed = tuple[Array | None, Array, Array, Array | None]
    Mask = NDArray[np.bool_]
    from .noise import Noise

    Matrix = NDArray[np.float64]


_TINY = np.float32(1e-9)


@dataclass(frozen=True)
class Halves:
    """The light of a frame's two half buffers, which tells its noise.

    They are two subsets of one sample sequence, or have two seeds.

    Attributes
    ----------
    radiance : (2, H, W, 3) float32 array
        Radiance of both halves.
    shares : tuple of float
        Share of the frame's samples that each half has.
    counts : (2, H, W) float32 array or None
        Samples of each pixel, where pixels have different numbers of them.
    """

    radiance: Array
    shares: tuple[float, float] = (0.5, 0.5)
    counts: Array | None = None

    @classmethod
    def of(cls, one: Passes, two: Passes, shares: tuple[float, float]) -> Halves:
        """The halves of a frame that was rendered in two."""
        assert one.radiance is not None
        assert two.radiance is not None
        counts = None
        if one.counts is not None and two.counts is not None:
            counts = np.stack((one.counts, two.counts))
        return cls(np.stack((one.radiance, two.radiance)), shares, counts)

    def share(self) -> Array:
        """Return the first half's share of the samples: (H, W), or one number."""
        if self.counts is None:
            return np.asarray(self.shares[0], np.float32)
        first, second = self.counts
        return np.where(first > 0.0, first / np.maximum(first + second, _TINY), 0.0)


_SEED = 7


def pack(
    radiance: Array | None, albedo: Array, normal: Array, alpha: Array | None
) -> tuple[NDArray[np.float16], Mask]:
    """Pack the passes of a frame in half floats, channel beside channel.

    Parameters
    ----------
    radiance : (H, W, 3) float32 array or None
        Scene-linear radiance; None for a frame of guides alone.
    albedo, normal : (H, W, 3) float32 array
        Guides.
    alpha : (H, W) float32 array or None
        Alpha, if there is one.

    Returns
    -------
    picture : (H W, 6 to 10) float16 array
        Radiance, albedo, normal and alpha; values beyond +-65504 are clipped.
    invalid : (H W,) bool array
        Pixels that held NaN or infinities and are 0 now.
    """
    packing = _Packing((radiance, albedo, normal, alpha))
    packing.run()
    return packing.picture, packing.invalid


def pack_with_noise(
    passes: Packed, samples: float, halves: Halves | None
) -> tuple[NDArray[np.float16], Mask, Noise]:
    """Pack the passes of a frame with radiance, and estimate its noise.

    Parameters
    ----------
    passes : tuple of arrays
        Radiance, albedo and normal (H, W, 3), and alpha (H, W) or None.
    samples : float
        Mean samples per pixel.
    halves : Halves or None
        Half buffers that noise is estimated from; without them it is estimated from the
        surrounding pixels.

    Returns
    -------
    picture : (H W, 9 or 10) float16 array
        Radiance, albedo, normal and alpha; values beyond +-65504 are clipped.
    invalid : (H W,) bool array
        Pixels that held NaN or infinities and are 0 now.
    noise : Noise
        Its noise, 0 at invalid pixels.
    """
    packing = _Packing(passes)
    noise = packing.run_with_noise(samples, halves)
    return packing.picture, packing.invalid, noise


def pack_parts(parts: Mapping[str, Array]) -> dict[str, NDArray[np.float16] | None]:
    """Pack AOVs and light passes in half floats.

    A part is 0 where it is not finite; the pixel stays valid.

    Parameters
    ----------
    parts : mapping of str to (H, W, 3) float32 array
        AOVs and light passes, scene-linear, by name.

    Returns
    -------
    packed : dict of str to (H W, 3) float16 array or None
        None for a part that is dark everywhere.
    """
    return {name: _pack_part(part) for name, part in parts.items()}


def _pack_part(part: Array) -> NDArray[np.float16] | None:
    packed, has_any = _to_halves(part, keeps_infinities=False)
    return packed if has_any else None


def pack_vectors(vector: Array) -> NDArray[np.float16]:
    """Pack motion vectors (H, W, 4) as float16 (H W, 4).

    Vectors beyond the range of half floats are useless anyway and become infinite.
    """
    return _to_halves(vector, keeps_infinities=True)[0]


def pack_strength(strength: Array) -> NDArray[np.float16]:
    """Pack strengths (H, W) as float16 (H W,); they are 1 where they are not known."""
    known = np.nan_to_num(strength.ravel(), nan=1.0)
    return np.clip(known, 0.0, 1.0).astype(np.float16)


def pack_counts(counts: Array) -> NDArray[np.float16]:
    """Pack sample counts (H, W) as float16 (H W,); what is not finite becomes 0."""
    counts = np.nan_to_num(counts.ravel(), posinf=0.0, neginf=0.0)
    return np.clip(counts, 0.0, LARGEST_HALF).astype(np.float16)


class _Packing:
    """One frame that the library packs."""

    def __init__(self, passes: Packed) -> None:
        radiance, albedo, normal, alpha = passes
        self._arrays = Arrays()
        self._shape = height, width = normal.shape[:2]
        given = [x for x in (radiance, albedo, normal) if x is not None]
        channels = 3 * len(given) + (alpha is not None)
        if alpha is not None:
            given.append(alpha[..., None])
        self.picture = np.empty((height * width, channels), np.float16)
        self.invalid = np.empty(height * width, np.bool_)
        self._packing = structures.Packing(
            count=len(given),
            width=width,
            height=height,
            has_light=radiance is not None,
            picture=self.picture.ctypes.data,
            invalid=self.invalid.ctypes.data,
        )
        self._packing.passes[: len(given)] = [
            _make_pass(self._arrays, x) for x in given
        ]

    def run_with_noise(self, samples: float, halves: Halves | None) -> Noise:
        """Pack, and return the noise: of halves, or of the pixels around each one."""
        count = len(self.invalid)
        noise = Noise(np.empty((count, 2), np.float16), np.empty(count, np.float16))
        self._packing.guide_factor = guide_factor(samples)
        self._packing.noise = noise.light.ctypes.data
        self._packing.guide_noise = noise.guides.ctypes.data
        if halves is not None:
            self._packing.halves[:] = [
                _make_pass(self._arrays, x) for x in halves.radiance
            ]
            share = halves.share()
            if share.ndim:
                self._packing.shares = self._arrays.at(share, np.float32, count)
            else:
                self._packing.share = share
        else:
            # the sign of a difference is random, as it would be between halves
            signs = np.random.default_rng(_SEED).integers(0, 2, count, np.uint8)
            self._packing.signs = self._arrays.at(signs, np.uint8, count)
            self._packing.light_factor = light_factor(samples)
        self.run()
        return noise

    def run(self) -> None:
        """Pack."""

        def work(rows: tuple[int, int]) -> None:
            size = library().packing_bytes(self._packing, rows[1] - rows[0])
            scratch = np.empty(size, np.uint8)
            library().pack(self._packing, *rows, scratch.ctypes.data)

        in_threads(work, bands(self._shape[0]))


def _to_halves(
    picture: Array, keeps_infinities: bool
) -> tuple[NDArray[np.float16], bool]:
    """Return (H W, C), and whether any number in it is not 0."""
    height, width, channels = picture.shape
    packed = np.empty((height * width, channels), np.float16)
    arrays = Arrays()
    given = _make_pass(arrays, picture)

    def work(rows: tuple[int, int]) -> int:
        return int(
            library().to_halves(
                given, width, *rows, keeps_infinities, packed.ctypes.data
            )
        )

    return packed, any(in_threads(work, bands(height)))


def _make_pass(arrays: Arrays, picture: Array) -> structures.Pass:
    """A picture (H, W, C) as the library takes it, whatever its strides."""
    first, strides = arrays.strided(picture)
    return structures.Pass(first, *strides, picture.shape[2])


# Relative to the surface's depth: how far behind it a virtual image lies at least. Less
# is the slope of a surface, or the edge of something.
_BEHIND = 0.04


@dataclass(frozen=True, kw_only=True)
class Frame(Passes):
    """One frame as the renderer returns it, and where it was seen from.

    Attributes
    ----------
    number : int
        The frame's number: `vector` points to `number` - 1 and `number` + 1. Frames of
        one number show one moment, such as the views of a stereo pair.
    camera : Camera
        The camera, and the part of its frame that the arrays hold.
    samples : float
        Mean samples per pixel, by which the frame is weighted against others.
    still : bool
        Whether nothing at all moves or changes from frame to frame, not even light:
        frames of equal cameras then differ in their noise alone.
    halves : Halves or None
        Half buffers, from which noise is estimated better than from the surrounding
        pixels.
    subset : int or None
        Number of the frame's part of a sample sequence that frames share: two frames
        with the same number have the same noise. None for a sequence of its own.

    Raises
    ------
    PictureError
        If an array has another size than `normal`, or `samples` is not above 0.
    """

    number: int
    camera: Camera
    depth: Array
    samples: float = 1.0
    still: bool = False
    halves: Halves | None = None
    subset: int | None = None

    @classmethod
    def of(cls, passes: Passes, **others: Any) -> Frame:
        """A frame of these passes; `others` are its further fields."""
        given = {each.name: getattr(passes, each.name) for each in fields(Passes)}
        return cls(**(given | others))

    def __post_init__(self) -> None:
        self.check_shapes(f"frame {self.number}")
        if not self.samples > 0:
            raise PictureError(
                f"frame {self.number} has {self.samples} samples per pixel: give the "
                "number it was rendered with"
            )


@dataclass(frozen=True, eq=False)
class Stored:
    """A frame as the window stores it: flat, packed, and free of NaN.

    Attributes
    ----------
    number : int
        The frame's number.
    camera : Camera
        The camera, and the part of its frame that the arrays hold.
    shape : tuple of int
        Height and width.
    samples : float
        Mean samples per pixel.
    picture : (H W, 6 to 10) float16 array
        Radiance (not in a frame of guides alone), albedo, normal and alpha (if any).
    inverse_depth : (H W,) float32 array
        1 / depth, 0 without a hit; the depth itself for an orthographic camera. NaN
        where unknown.
    invalid : (H W,) bool array or None
        Pixels that held NaN or infinities and are 0 now; None if there were none.
    vector : (H W, 4) float16 array or None
        Cycles' Vector pass.
    still : bool
        Whether nothing at all moves or changes from frame to frame.
    counts : (H W,) float16 array or None
        Samples of each pixel, where they differ.
    strength : (H W,) float16 array or None
        How much samples of neighbours count at each pixel, where that is not 1 for all.
    noise : Noise or None
        Estimated noise; None for a frame of guides alone.
    image : (H W,) float32 array or None
        Inverse depth of the virtual image that a mirror or glass shows (for an
        orthographic camera its depth), NaN where there is none; None if there is none
        anywhere.
    parts : mapping of str to (H W, 3) float16 array or None
        AOVs and light passes, by name; None for one that is dark everywhere.
    """

    number: int
    camera: Camera
    shape: tuple[int, int]
    samples: float
    picture: NDArray[np.float16]
    inverse_depth: Array
    invalid: NDArray[np.bool_] | None = None
    vector: NDArray[np.float16] | None = None
    still: bool = False
    counts: NDArray[np.float16] | None = None
    strength: NDArray[np.float16] | None = None
    noise: Noise | None = None
    image: Array | None = None
    parts: Mapping[str, NDArray[np.float16] | None] = field(default_factory=dict)

    @property
    def has_light(self) -> bool:
        """Whether there is radiance before albedo and normal."""
        return self.picture.shape[1] >= 9

    @property
    def normals(self) -> slice:
        """The channels of `picture` with normals; albedo lies before them."""
        return slice(6, 9) if self.has_light else slice(3, 6)

    @cached_property
    def rims(self) -> NDArray[np.uint8]:
        """(H W): pixels next to a nearer surface, some of whose light they contain.

        0, or 1 + which of the 3x3 pixels around has the nearest surface.
        """
        return find_rims(self.inverse_depth, self.shape, self.camera.orthographic)

    def strengths(self, of_frame: float = 1.0) -> Array:
        """How much neighbours count, (H, W) or one number; `of_frame` is a factor."""
        if self.strength is None:
            return np.asarray(of_frame, np.float32)
        return floats(self.strength).reshape(self.shape) * np.float32(of_frame)

    @property
    def is_empty(self) -> bool:
        """Whether no pixel has a sample, which is so for a reprojected placeholder."""
        return self.invalid is not None and bool(self.invalid.all())

    def shows_same(self, other: Stored) -> bool:
        """Whether two frames differ in their noise alone."""
        same = self.camera.same(other.camera) and self.shape == other.shape
        return self.still and other.still and same


def pack_frame(
    frame: Frame,
) -> tuple[NDArray[np.float16], NDArray[np.bool_], Noise | None]:
    """Pack a frame, and estimate its noise if it has radiance.

    Parameters
    ----------
    frame : Frame
        A frame as rendered.

    Returns
    -------
    picture : (H W, 6 to 10) float16 array
        Radiance, albedo, normal and alpha, as far as the frame has them.
    invalid : (H W,) bool array
        Pixels that held NaN or infinities and are 0 now.
    noise : Noise or None
        Its noise, 0 at invalid pixels; None for a frame of guides alone.
    """
    passes = frame.radiance, frame.albedo, frame.normal, frame.alpha
    if frame.radiance is None:
        return *pack(*passes), None
    return pack_with_noise(passes, frame.samples, frame.halves)


def store(frame: Frame) -> Stored:
    """Pack a frame; pixels with NaN or infinities in any pass are invalid.

    Values beyond +-65504, the largest half float, are clipped.

    Parameters
    ----------
    frame : Frame
        A frame as rendered.

    Returns
    -------
    stored : Stored
        The same frame, flat and in half floats.
    """
    picture, invalid, noise = pack_frame(frame)
    return Stored(
        number=frame.number,
        camera=frame.camera,
        shape=frame.shape,
        samples=frame.samples,
        picture=picture,
        inverse_depth=_invert_depth(frame),
        invalid=invalid if invalid.any() else None,
        vector=None if frame.vector is None else pack_vectors(frame.vector),
        still=frame.still,
        counts=None if frame.counts is None else pack_counts(frame.counts),
        strength=None if frame.strength is None else pack_strength(frame.strength),
        noise=noise,
        image=_find_virtual_image(frame),
        parts=pack_parts(frame.parts),
    )


def _invert_depth(frame: Frame) -> Array:
    """Return `Stored.inverse_depth`; NaN for a depth of NaN or below 0."""
    depth = frame.depth.ravel().astype(np.float32)
    sky = depth > SKY_DEPTH
    if frame.camera.orthographic:
        # an orthographic camera sees the sky in one direction only: nothing to track
        return np.where(sky, np.float32(np.nan), depth)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse_depth = np.where(
            depth > 0.0, np.float32(1.0) / depth, np.float32(np.nan)
        )
    inverse_depth[sky] = 0.0
    return inverse_depth


def _find_virtual_image(frame: Frame) -> Array | None:
    """Return `Stored.image`: where paths end well behind the surface they start at."""
    if frame.path_length is None:
        return None
    depth = frame.depth
    end = frame.path_length * frame.camera.depth_per_length(frame.shape)
    with np.errstate(over="ignore", invalid="ignore"):
        behind = end > extreme(depth, np.fmax) * np.float32(1.0 + _BEHIND)
        behind &= (depth > 0.0) & (end < SKY_DEPTH)
    if not behind.any():
        return None
    image = np.where(behind, end, np.float32(np.nan)).ravel()
    return image if frame.camera.orthographic else np.float32(1.0) / image


# Per pixel: albedo and normal, in half floats, and inverse depth; then radiance and its
# noise, a Vector pass and an alpha, in half floats, and the inverse depth of images.
_BYTES = 2 * 3 * 2 + 4
_IMAGE_BYTES = 4
_LIGHT_BYTES, _VECTOR_BYTES, _ALPHA_BYTES = 12, 8, 2


def bytes_needed(
    width: int,
    height: int,
    frames: int,
    alpha: bool = False,
    vector: bool = False,
    light: bool = True,
    images: bool = False,
) -> int:
    """Return the bytes that `frames` frames of half floats take in a window.

    Guides alone have no `light`.
    """
    each = _BYTES + _LIGHT_BYTES * light
    each += _VECTOR_BYTES * vector + _ALPHA_BYTES * alpha + _IMAGE_BYTES * images
    return width * height * each * frames
