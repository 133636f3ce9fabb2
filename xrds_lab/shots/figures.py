"""Figures of a scene's shots: errors of the middle frame, and flicker.

Figures are kept in a file and hold as long as the code that they judge is the same.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import xrds_core
from xrds_blender.planning.request import render_request
from xrds_blender.planning.settings import DEFAULT_DENOISING
from xrds_blender.rendering import full_size
from xrds_blender.rendering.full_size import FullSize
from xrds_core.accumulation.frame import Stored, store
from xrds_core.files import write_json
from xrds_core.shot import Shot

from ..checksum import checksum
from ..metrics import all_metrics
from . import blocks, nl_means, rivals
from .crops import REFERENCE, SceneCrops, crop_key
from .flicker import flicker_of, truths
from .frames import MIDDLE, REACH, FrameRequest, ShotFrames, requests
from .motions import MOTIONS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from xrds_blender.planning.settings import Denoising
    from xrds_core.accumulation.frame import Frame
    from xrds_core.arrays import Array

    from .crops import Key

    Figures = dict[str, Any]
    Paint = Callable[[int], Array]

GENERATION = 3  # counts up whenever this file makes other figures
DEFAULT, BEST, MEDIAN = "cycles_oidn_default", "cycles_oidn_best", "median_of_three"
NL_MEANS, XRDS = "nl_means", "xrds"
RIVALS = {DEFAULT: 0, BEST: 0, MEDIAN: 1, NL_MEANS: nl_means.REACH}
"""Each rival, and how many frames before and after it looks at."""


def reach_of(radius: int) -> int:
    """Frames to each side of the middle one in the shot that judges a radius."""
    return max(radius, REACH)


class Clip:
    """One shot of one scene: the pictures that each method makes of its frames."""

    def __init__(
        self,
        frames: ShotFrames,
        motion: str,
        samples: int,
        reach: int,
        seed: int = 0,
    ) -> None:
        wanted = {r.number: r for r in requests(motion, samples, reach, seed)}
        self.motion, self.seed = motion, seed
        self.stops = frames.stops(wanted[MIDDLE])
        self.samples = samples
        self.frames: dict[int, Frame] = {n: frames.frame(r) for n, r in wanted.items()}
        self._stored: dict[int, Stored] = {}
        self._methods: dict[int, FullSize] = {}

    def xrds(self, number: int, radius: int) -> Array:
        """A frame as `xrds render` finishes it, (H, W, 3)."""
        numbers = Shot(tuple(self.frames), radius).neighbours(number)
        lenders = [self._packed(n) for n in numbers]
        own = self._packed(number)
        return self._method(radius).finish_stored(own, lenders).radiance

    @cached_property
    def alone(self) -> Array:
        """The middle frame by itself, which every radius is judged against."""
        return self.xrds(MIDDLE, 0)

    def _method(self, radius: int) -> FullSize:
        if radius not in self._methods:
            self._methods[radius] = FullSize(
                render_request(
                    scale=1, samples=self.samples, temporal_radius=radius, device="cpu"
                )
            )
        return self._methods[radius]

    def _packed(self, number: int) -> Stored:
        if number not in self._stored:
            self._stored[number] = store(self.frames[number])
        return self._stored[number]

    def oidn(self, number: int, mode: Denoising) -> Array:
        """A frame by itself, denoised by Cycles."""
        return rivals.cycles_oidn(self.frames[number], mode)

    def median(self, number: int) -> Array:
        """A frame denoised by Cycles, then the median with its neighbours."""
        return rivals.median_of_three(self.frames, number)

    def nl_means(self, number: int) -> Array:
        """A frame by non-local means over its neighbours."""
        return nl_means.nl_means(self.frames, number)


class SceneFigures:
    """All figures of one scene; those known are not computed again."""

    def __init__(
        self,
        frames: ShotFrames,
        references: Callable[[], tuple[Array, Array]],
        pair_samples: int,
    ) -> None:
        self.frames, self._references = frames, references
        self.pair_samples = pair_samples
        shot = frames.shot
        own = "own" if shot.reference is None else shot.reference.stem
        name = f"{shot.name}-{shot.digest}-{shot.window.label}-{own}-shots"
        directory = frames.folder.directory
        self._path = directory / f"{name}.json"
        self.crops = SceneCrops(directory, name)
        self._known: dict[str, Figures] = _stored(self._path)

    def _reference(self) -> Array:
        first, second = self._references()
        return (first + second) / 2

    def points(self) -> list[Figures]:
        """Every figure that the present code gave, in order of motions and samples.

        Of those with other pairs of references one each: this one's, if there is any.
        """
        return [{"seed": 0} | self._known[key] for key in self._current()]

    def kept_crops(self) -> dict[Key, Path]:
        """The crops of points and references that there are."""
        scene = self.frames.shot.name
        own = {
            crop_key(self._known[key]): self.crops.path(key)
            for key in self._current()
            if not self._known[key].get("seed")
        }
        true = {
            (scene, motion, *REFERENCE): path
            for motion, path in self.crops.references().items()
        }
        return {key: path for key, path in (own | true).items() if path.is_file()}

    def _current(self) -> list[str]:
        """Keys of the points."""
        found: dict[tuple[Any, ...], str] = {}
        for key, point in self._known.items():
            if not key.endswith(_code(point["method"] == XRDS)):
                continue
            case = (
                list(MOTIONS).index(point["motion"]),
                point["samples"],
                [*RIVALS, XRDS].index(point["method"]),
                point["radius"],
                point.get("seed", 0),
            )
            if case not in found or f"-pair{self.pair_samples}-" in key:
                found[case] = key
        return [found[case] for case in sorted(found)]

    def requests(
        self, motion: str, samples: int, radii: Sequence[int], seed: int = 0
    ) -> list[FrameRequest]:
        """The frames that these figures need."""
        reaches = sorted({reach_of(radius) for radius in radii} | {REACH})
        wanted = [r for x in reaches for r in requests(motion, samples, x, seed)]
        if self.pair_samples:
            wanted += truths(motion, self.pair_samples)
        return wanted

    def measure(
        self, motion: str, samples: int, radii: Sequence[int], seed: int = 0
    ) -> None:
        """Measure whatever is missing of one shot, and keep it."""
        for reach in sorted({reach_of(radius) for radius in radii} | {REACH}):
            methods = [(XRDS, r) for r in radii if reach_of(r) == reach]
            if reach == REACH:
                methods = [*RIVALS.items(), *methods]
            left = [
                m
                for m in methods
                if self._key(motion, samples, seed, *m) not in self._known
            ]
            if left:
                clip = Clip(self.frames, motion, samples, reach, seed)
                self._place_crops(clip)
                for method, radius in left:
                    self._measure(clip, method, radius)

    def _place_crops(self, clip: Clip) -> None:
        """Find where crops are, with the two methods that pages set side by side."""
        if not self.crops.has_place(clip.motion):
            pair = clip.xrds(MIDDLE, REACH), clip.oidn(MIDDLE, DEFAULT_DENOISING)
            self.crops.settle(clip.motion, pair, self._reference(), clip.stops)

    def _measure(self, clip: Clip, method: str, radius: int) -> None:
        motion = clip.motion
        paint, more = self._paint(clip, method, radius)
        reference = self._reference()
        made: dict[int, Array] = {}

        def once(number: int) -> Array:
            if number not in made:
                made[number] = paint(number)
            return made[number]

        if method == XRDS and radius:
            pair = self._references()
            more |= blocks.against_alone(once(MIDDLE), clip.alone, pair, clip.stops)
        point = {
            "scene": self.frames.shot.name,
            "motion": motion,
            "method": method,
            "samples": clip.samples,
            "radius": radius,
            "seed": clip.seed,
            "scale": 1,
            "seconds_per_frame": None,
            **all_metrics(once(MIDDLE), reference, clip.stops),
            "flicker": self._flicker(once, clip),
        }
        key = self._key(motion, clip.samples, clip.seed, method, radius)
        if not clip.seed:  # others show the same place with other noise
            self.crops.keep(key, motion, once(MIDDLE), clip.stops)
        self._known[key] = point | more
        write_json(self._path, self._known)

    def _flicker(self, paint: Paint, clip: Clip) -> float | None:
        """Of the middle frame and the next; None where nothing tells what is true."""
        if not self.pair_samples:
            return None
        shown = paint(MIDDLE), paint(MIDDLE + 1)
        frames, samples = self.frames, self.pair_samples
        return flicker_of(shown, clip.motion, samples, frames, clip.stops)

    def _paint(self, clip: Clip, method: str, radius: int) -> tuple[Paint, Figures]:
        """What makes the picture of a frame by its number, and what it is named by."""
        if method == XRDS:
            return lambda number: clip.xrds(number, radius), {}
        if method == MEDIAN:
            return clip.median, {}
        if method == NL_MEANS:
            return clip.nl_means, {}
        mode = DEFAULT_DENOISING
        if method == BEST:
            mode = best_mode(clip, self._reference())
        return lambda number: clip.oidn(number, mode), {"mode": str(mode)}

    def _key(
        self, motion: str, samples: int, seed: int, method: str, radius: int
    ) -> str:
        pair = self.pair_samples
        other = f"-seed{seed}" if seed else ""
        what = f"{motion}-{samples}-{method}-{radius}{other}-pair{pair}"
        return f"{what}-{_code(method == XRDS)}"


def best_mode(clip: Clip, reference: Array) -> Denoising:
    """The mode of Cycles' denoiser with the highest PSNR on the middle frame."""
    from ..metrics import psnr

    return max(
        rivals.MODES,
        key=lambda mode: psnr(clip.oidn(MIDDLE, mode), reference, clip.stops),
    )


@lru_cache
def _code(is_ours: bool) -> str:
    """A checksum of the code that the figures judge, ours or the rivals'."""
    sources = [Path(rivals.__file__), Path(nl_means.__file__)]
    if is_ours:
        package = Path(xrds_core.__file__).parent
        parts = ("accumulation/*.py", "denoising/*.py", "native/*.[ch]")
        sources = [path for part in parts for path in package.glob(part)]
        sources += [package / "finish.py", Path(full_size.__file__)]
    return checksum(sources, GENERATION)


def _stored(path: Path) -> dict[str, Figures]:
    try:
        return dict(json.loads(path.read_text("utf-8")))
    except (OSError, ValueError):
        return {}
