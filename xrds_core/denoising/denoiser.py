"""A denoiser that is reused between pictures: OIDN as Cycles uses it, but faster.

Arrays are float32 (height, width, channels), row 0 on top, scene-linear. Source of how
guides are treated: Cycles' `intern/cycles/integrator/denoiser_oidn.cpp`.
"""

from __future__ import annotations

import atexit
import threading
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple
from weakref import WeakSet

import numpy as np

from ..errors import UsageError
from ..progress import Progress
from . import oidn_device
from .input_images import check, sample

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from ..arrays import Array
    from ..progress import Callback
    from .input_images import Pictures

    Image = NDArray[np.floating[Any]]

QUALITIES = {
    "best": "High",
    "accurate": "High",
    "high": "High",
    "medium": "Balanced",
    "balanced": "Balanced",
    "fast": "Fast",
}
"""What we call a quality, and which of OIDN's makes the picture.

`high` is the large network on guides that a smaller one has denoised first; `best`
uses a large one for albedo, too, which preserves its texture, and the mean of two such
pictures, one made upside down, in 1.8 of the seconds;
`accurate` uses a large one for both guides, as Blender does unless told otherwise: what
others are compared with;
`medium` is a smaller network on such guides; `balanced` and `fast` are smaller ones
on the guides as they are.
"""

# For guides OIDN has two kinds of networks: those of High and those of all others. High
# takes twice the time: finely textured albedo gains 0.1 to 0.5 dB, other albedo 0.03 on
# average, normals nothing.
_SMALL, _LARGE = "Fast", "High"
# A guide is clean where that would change it by no more than this, root mean square:
# as it is, it then costs the picture less than 0.05 dB.
_CLEAN = {"albedo": 0.001, "normal": 0.002}
_RANGE = {"albedo": (0.0, 1.0), "normal": (-1.0, 1.0)}  # beyond which OIDN sees nothing

# Of each stage; only their ratios count.
_SECONDS = {_SMALL: 0.4, _LARGE: 0.8, "picture": 1.0, "second picture": 1.0}


class _ForParts(NamedTuple):
    """A network for AOVs and light passes, used for up to `most` of them.

    `seconds` are relative to those of the picture. All parts together take at most
    twice the seconds of the picture and its guides.
    """

    network: str
    seconds: float
    most: float

    @property
    def use(self) -> str:
        """What its filter is called."""
        return f"part, {self.network}"


_FOR_PARTS = (
    _ForParts("High", 1.0, 3),
    _ForParts("Balanced", 0.45, 8),
    _ForParts("Fast", 0.25, float("inf")),
)
_WITH_PREFILTER = ("best", "accurate", "high", "medium")
# The guides that a large network denoises first; a small one does the others.
_BY_LARGE = {"best": ("albedo",), "accurate": ("albedo", "normal")}
_NO_ALBEDO = 0.5  # what Cycles gives with a normal alone: OIDN wants both
_MOST_MEBIBYTES = 2**31 - 1  # the library counts them in 32 bits
# What a filter takes on the processor unless told otherwise: all that a picture of
# 1920x1080 needs. In tiles one of 3840x2160 takes a tenth more time, and half the
# memory.
_ON_PROCESSOR = 1500
_MEBIBYTE = 1 << 20

_open: WeakSet[Denoiser] = WeakSet()


@atexit.register
def _close_all() -> None:
    """Let go of the library before Python does: it would complain."""
    for denoiser in list(_open):
        denoiser.close()


@dataclass(frozen=True)
class Denoised:
    """A denoised picture."""

    radiance: Array
    """(H, W, 3), or (H, W, 4) with the alpha that was given."""
    bad_pixels: int
    """Pixels of the inputs that held NaN, infinities, overflows or negative light."""
    prefiltered: tuple[str, ...]
    """The guides that were denoised first: of `albedo` and `normal`."""
    parts: Mapping[str, Array] = field(default_factory=dict)
    """Those that were given, by name: (H, W, 3)."""


class Denoiser:
    """OIDN on a device, ready for any number of pictures of any size.

    Reuse it: filters and their memory serve the next picture, too. Calls from several
    threads run one after the other.

    Parameters
    ----------
    quality : {'best', 'accurate', 'high', 'medium', 'balanced', 'fast'}
        See `QUALITIES`.
    device : {'auto', 'cpu', 'cuda', 'metal'}
        `auto` is the fastest there is.
    threads : int
        Threads of the CPU; 0 for one per core.
    memory_limit : int, optional
        Bytes that a call may take beside the arrays given and returned; it works in
        tiles then. A target, not a bound: a tile has a least size. By default it works
        in tiles on the processor where a picture is larger than 1920x1080.

    Raises
    ------
    UsageError
        If the quality is unknown, the device not here, or a number negative.
    XRDSError
        If the library cannot be loaded.
    """

    def __init__(
        self,
        quality: str = "high",
        device: str = "auto",
        *,
        threads: int = 0,
        memory_limit: int | None = None,
    ) -> None:
        if quality not in QUALITIES:
            known = ", ".join(QUALITIES)
            raise UsageError(f"quality {quality!r} is not among {known}")
        for name, number in (("threads", threads), ("memory_limit", memory_limit)):
            if number is not None and number < 0:
                raise UsageError(f"{name} is {number}; it must not be negative")
        self.quality = quality
        self._oidn = oidn_device.load()
        self._device = oidn_device.open_device(device, threads)
        _open.add(self)
        self._memory_limit = memory_limit
        self._filters: dict[str, Any] = {}
        self._lock = threading.Lock()

    def close(self) -> None:
        """Give back all memory; there are no more calls after it."""
        with self._lock:
            self._filters.clear()
            self._device = None

    @property
    def device(self) -> str:
        """What it runs on: `cpu`, `cuda` or `metal`."""
        return str(self._device.type.name).lower()

    def __call__(
        self,
        radiance: Array,
        albedo: Array | None = None,
        normal: Array | None = None,
        *,
        parts: Mapping[str, Array] | None = None,
        hdr: bool = True,
        guides_are_clean: bool | None = None,
        progress: Callback | None = None,
    ) -> Denoised:
        """Denoise a picture; the arrays given stay as they are.

        Parameters
        ----------
        radiance : (H, W, 3) or (H, W, 4) float32 array
            Scene-linear, with alpha premultiplied. Its noise must not be correlated
            between pixels, which interpolation would cause.
        albedo : (H, W, 3) float32 array, optional
            Values above 1, such as those of lamps, count as 1, which is what Blender
            does.
        normal : (H, W, 3) float32 array, optional
            Means of unit vectors of any space, 0 where nothing is.
        parts : mapping of str to (H, W, 3) float32 array, optional
            AOVs and light passes, by name. Each is denoised by itself with the same
            guides, by a smaller network where they are many; one without light costs
            nothing.
        hdr : bool
            False for values in [0, 1] that are shown as they are.
        guides_are_clean : bool, optional
            True if all that they show may appear in the picture, False if not. None to
            decide for each by its own noise, which `best`, `high` and `medium` do; the
            other qualities then assume that guides are noisy.
        progress : callable, optional
            Takes a fraction in [0, 1] that never falls; False as its result cancels.

        Returns
        -------
        denoised : Denoised
            The picture and its parts.

        Raises
        ------
        PictureError
            If the arrays do not fit each other.
        Cancelled
            If `progress` returned False.
        OutOfMemory
            If the device has too little memory.
        """
        if self._device is None:
            raise UsageError("this denoiser is closed; make another one")
        pictures = check(radiance, albedo, normal, parts or {})
        work = Progress(progress)
        made_of = {k: np.zeros(x.shape, np.float32) for k, x in pictures.parts.items()}
        result = np.zeros(np.shape(radiance), np.float32)
        result[..., 3:] = pictures.alpha
        prefiltered: tuple[str, ...] = ()
        with self._lock, oidn_device.explained(self.device, result.shape):
            work.report(0.0)
            if pictures.radiance.any():
                prefiltered = self._to_prefilter(pictures, guides_are_clean)
                clean = bool(guides_are_clean) or self.quality in _WITH_PREFILTER
                for task in self._light_filters(len(pictures.lit)):
                    task.hdr, task.clean_aux = hdr, clean
                self._run(pictures, prefiltered, result[..., :3], made_of, work)
            work.report(1.0)
        return Denoised(result, pictures.bad_pixels, prefiltered, made_of)

    def guides(
        self, albedo: Array, normal: Array, *, progress: Callback | None = None
    ) -> tuple[Array, Array]:
        """Denoise the guides alone; one that is clean is returned as it was given.

        Parameters
        ----------
        albedo : (H, W, 3) float32 array
            Without NaN; values above 1 count as 1.
        normal : (H, W, 3) float32 array
            Without NaN.
        progress : callable, optional
            Takes a fraction in [0, 1] that never falls; False as its result cancels.

        Returns
        -------
        albedo, normal : (H, W, 3) float32 array

        Raises
        ------
        Cancelled
            If `progress` returned False.
        OutOfMemory
            If the device has too little memory.
        """
        if self._device is None:
            raise UsageError("this denoiser is closed; make another one")
        work = Progress(progress)
        guides = {"albedo": albedo, "normal": normal}
        with self._lock, oidn_device.explained(self.device, albedo.shape):
            work.report(0.0)
            for name, guide in guides.items():
                work.begin_stage(1 / len(guides))
                if not self._is_clean(name, guide):
                    held = np.clip(guide, *_RANGE[name])
                    quiet = self._prefilter(name, held, name, work)
                    guides[name] = quiet.astype(np.float32)
            work.report(1.0)
        return guides["albedo"], guides["normal"]

    def _to_prefilter(
        self, pictures: Pictures, are_clean: bool | None
    ) -> tuple[str, ...]:
        """Return the names of the guides that are to be denoised first."""
        if self.quality not in _WITH_PREFILTER or are_clean:
            return ()
        return tuple(
            name
            for name, guide in pictures.guides.items()
            if are_clean is False or not self._is_clean(name, guide)
        )

    def _is_clean(self, name: str, guide: Array) -> bool:
        """Whether the prefilter would leave a sample of a guide almost unchanged.

        A network can distinguish noise from texture, pixel differences cannot; and two
        renders with different seeds would not show the noise of aliased edges.
        """
        blocks = sample(guide)
        if blocks is None:
            return False
        blocks = np.clip(blocks, *_RANGE[name])
        change = self._prefilter(name, blocks, f"sampled {name}") - blocks
        return float(np.sqrt(np.mean(np.square(change)))) <= _CLEAN[name]

    def _run(
        self,
        pictures: Pictures,
        prefiltered: tuple[str, ...],
        output: Array,
        made_of: Mapping[str, Array],
        work: Progress,
    ) -> None:
        """Denoise into `output`, (H, W, 3), and the parts into `made_of`."""
        images: dict[str, Image] = {}
        turn = self._has_room(pictures)
        pictures_made = ("picture", "second picture")[: 1 + (self.quality == "best")]
        networks = {name: self._choose_network(name) for name in prefiltered}
        for_part = self._choose_part_network(len(pictures.lit))
        total = sum(_SECONDS[stage] for stage in (*networks.values(), *pictures_made))
        total += for_part.seconds * len(pictures.lit)
        for name, guide in pictures.guides.items():
            images[name] = _order_rows(guide, turn)
            if name in networks:
                work.begin_stage(_SECONDS[networks[name]] / total)
                images[name] = self._prefilter(name, images[name], name, work)
        if "normal" in images and "albedo" not in images:
            images["albedo"] = np.full_like(images["normal"], _NO_ALBEDO)
        held = images.values() if turn else (images[name] for name in prefiltered)
        held_bytes = sum(image.nbytes for image in held)
        light = [("picture", pictures.radiance, output, _SECONDS["picture"])]
        light += [
            (for_part.use, pictures.parts[name], made_of[name], for_part.seconds)
            for name in pictures.lit
        ]
        for use, noisy, denoised, seconds in light:
            images["color"] = _order_rows(noisy, turn)
            work.begin_stage(seconds / total)
            task = self._filters[use]
            self._limit_memory(task, held_bytes + turn * noisy.nbytes)
            self._execute(task, images, denoised, work)
            if turn:
                _turn_over(denoised)
        if self.quality == "best":
            work.begin_stage(_SECONDS["second picture"] / total)
            other = np.empty(output.shape, np.float32)
            images["color"] = _order_rows(pictures.radiance, turn)
            images = {name: _order_rows(image, True) for name, image in images.items()}
            self._execute(self._filters["picture"], images, other, work)
            _average_into(output, other if turn else other[::-1])

    def _has_room(self, pictures: Pictures) -> bool:
        """Whether there is memory for copies with the rows in Blender's order."""
        if self._memory_limit is None:
            return True
        copies = pictures.radiance.size * 4 * (1 + len(pictures.guides))
        return copies <= self._memory_limit // 2

    def _prefilter(
        self, name: str, guide: Image, use: str, work: Progress | None = None
    ) -> Image:
        result = np.empty(guide.shape, np.float16)  # exact enough, for half the memory
        task = self._get_filter(use, self._choose_network(name))
        self._limit_memory(task, guide.nbytes + 2 * result.nbytes)
        self._execute(task, {name: guide}, result, work or Progress(None))
        return result

    def _choose_network(self, name: str) -> str:
        """Return OIDN's quality for prefiltering a guide."""
        return _LARGE if name in _BY_LARGE.get(self.quality, ()) else _SMALL

    def _choose_part_network(self, count: int) -> _ForParts:
        """Return the network for so many parts, none better than the picture's."""
        own = [choice.network for choice in _FOR_PARTS].index(QUALITIES[self.quality])
        return next(choice for choice in _FOR_PARTS[own:] if count <= choice.most)

    def _light_filters(self, parts: int) -> list[Any]:
        """Return the filters of the picture and of so many parts."""
        filters = [self._get_filter("picture", QUALITIES[self.quality])]
        if parts:
            how = self._choose_part_network(parts)
            filters.append(self._get_filter(how.use, how.network))
        return filters

    def _get_filter(self, use: str, quality: str) -> Any:
        """Return the filter of one use; a change of its sizes would cost time."""
        if use not in self._filters:
            task = self._filters[use] = self._device.new_filter("RT")
            task.quality = getattr(self._oidn.Quality, quality)
        return self._filters[use]

    def _limit_memory(self, task: Any, held: int) -> None:
        """Limit a filter to the memory left beside the `held` bytes of guides."""
        if self._memory_limit is not None:
            left = max(0, self._memory_limit - held) // _MEBIBYTE
            task.max_memory_mb = min(left, _MOST_MEBIBYTES)
        elif self.device == "cpu":
            task.max_memory_mb = _ON_PROCESSOR

    def _execute(
        self, task: Any, images: dict[str, Image], output: Image, work: Progress
    ) -> None:
        """Run a filter; it holds no reference to the arrays afterwards."""
        task.set_progress_monitor(work.monitor)
        try:
            for name, image in images.items():
                self._set_image(task, name, image)
            buffer = self._set_image(task, "output", output)
            task.execute()
            if buffer is not None:
                _read_buffer(buffer, output)
        except self._oidn.Error:
            work.check()
            raise
        finally:
            task.set_progress_monitor(None)
            for name in (*images, "output"):
                task.unset_image(name)

    def _set_image(self, task: Any, name: str, image: Image) -> Any:
        """Pass an array to a filter; return the buffer, if its device needs one."""
        if self._device.can_share(image):
            task.set_image(name, image)
            return None
        height, width = image.shape[:2]
        buffer = self._device.new_buffer(image.nbytes, self._oidn.Storage.Device)
        if name != "output":
            buffer.write(np.ascontiguousarray(image))
        kind = "Half3" if image.dtype == np.float16 else "Float3"
        kind = getattr(self._oidn.Format, kind)
        task.set_image(name, buffer, format=kind, width=width, height=height)
        return buffer


def _read_buffer(buffer: Any, output: Image) -> None:
    pixels = np.empty(output.shape, output.dtype)
    buffer.read(pixels)
    output[...] = pixels


def _order_rows(image: Array, turn: bool) -> Array:
    """Return rows as OIDN takes them, for `turn` in Blender's order, bottom first.

    Its networks are not symmetric: the order changes the picture, by 0.1 dB at times.
    """
    image = image[::-1] if turn else image
    plain = image.strides[2] == image.itemsize and min(image.strides) > 0
    return image if plain else np.ascontiguousarray(image)


def _turn_over(image: Array) -> None:
    """Exchange top and bottom, in place."""
    half = image.shape[0] // 2
    top = image[:half].copy()
    image[:half] = image[image.shape[0] - half :][::-1]
    image[image.shape[0] - half :] = top[::-1]


def _average_into(image: Array, other: Array) -> None:
    """Make `image` the mean of both."""
    image += other
    image *= 0.5


def denoise(
    radiance: Array,
    albedo: Array | None = None,
    normal: Array | None = None,
    *,
    quality: str = "high",
    device: str = "auto",
    guides_are_clean: bool | None = None,
    memory_limit: int | None = None,
    progress: Callback | None = None,
) -> Array:
    """Denoise one picture; the last denoiser used stays loaded.

    Parameters
    ----------
    radiance : (H, W, 3) or (H, W, 4) float32 array
        Scene-linear, with alpha premultiplied.
    albedo : (H, W, 3) float32 array, optional
        Values above 1 count as 1.
    normal : (H, W, 3) float32 array, optional
        Means of unit vectors of any space, 0 where nothing is.
    quality, device, memory_limit
        Options of `Denoiser`.
    guides_are_clean : bool, optional
        True if all that the guides show may appear in the picture, False if not, None
        to decide by their noise.
    progress : callable, optional
        Takes a fraction in [0, 1] that never falls; False as its result cancels.

    Returns
    -------
    radiance : (H, W, 3) or (H, W, 4) float32 array
        With the alpha that was given.

    Raises
    ------
    UsageError
        If the quality is unknown or the device not here.
    PictureError
        If the arrays do not fit each other.
    Cancelled
        If `progress` returned False.
    OutOfMemory
        If the device has too little memory.
    """
    return _get_denoiser(quality, device, memory_limit)(
        radiance, albedo, normal, guides_are_clean=guides_are_clean, progress=progress
    ).radiance


@lru_cache(maxsize=1)
def _get_denoiser(quality: str, device: str, memory_limit: int | None) -> Denoiser:
    return Denoiser(quality, device, memory_limit=memory_limit)
