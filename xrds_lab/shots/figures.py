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
from ..metrics import metrics_of_pair, squared_error, to_srgb
from . import blocks, nl_means, rivals
from .crops import REFERENCE, SceneCrops, crop_key
from .frames import MIDDLE, REACH, FrameRequest, ShotFrames, requests
from .methods import BEST, DEFAULT, MEDIAN, NL_MEANS, XRDS
from .motions import MOTIONS
from .truth import Truth, requests_of_truth

if TYPE_CHECKING:
    from collections.abc import Sequence

    from xrds_blender.planning.settings import Denoising
    from xrds_core.accumulation.frame import Frame
    from xrds_core.arrays import Array

    from .crops import Key

    Figures = dict[str, Any]
    Paint = Callable[[int], Array]

GENERATION = 3  # counts up whenever this file makes other figures
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
        reference_samples: int,
    ) -> None:
        self.frames, self.reference_samples = frames, reference_samples
        shot = frames.shot
        own = "own" if shot.reference is None else shot.reference.stem
        name = f"{shot.name}-{shot.digest}-{shot.window.label}-{own}-shots"
        directory = frames.folder.directory
        self._path = directory / f"{name}.json"
        self.crops = SceneCrops(directory, name)
        self._known: dict[str, Figures] = _stored(self._path)
        self._truths: dict[str, Truth] = {}

    def points(self) -> list[Figures]:
        """Every figure that the present code gave, in order of motions and samples.

        Of those with other references one each: this one's, if there is any.
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
            if case not in found or f"-truth{self.reference_samples}-" in key:
                found[case] = key
        return [found[case] for case in sorted(found)]

    def requests(
        self, motion: str, samples: int, radii: Sequence[int], seed: int = 0
    ) -> list[FrameRequest]:
        """The frames that these figures need."""
        reaches = sorted({reach_of(radius) for radius in radii} | {REACH})
        wanted = [r for x in reaches for r in requests(motion, samples, x, seed)]
        return wanted + requests_of_truth(motion, self.reference_samples)

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
            clean = self._truth(clip.motion).clean
            self.crops.settle(clip.motion, pair, clean, clip.stops)

    def _measure(self, clip: Clip, method: str, radius: int) -> None:
        motion = clip.motion
        paint, more = self._paint(clip, method, radius)
        truth = self._truth(motion)
        made: dict[int, Array] = {}

        def once(number: int) -> Array:
            if number not in made:
                made[number] = paint(number)
            return made[number]

        if method == XRDS and radius:
            shown = once(MIDDLE), clip.alone
            more |= blocks.against_alone(*shown, truth.pair, clip.stops)
        point = {
            "scene": self.frames.shot.name,
            "motion": motion,
            "method": method,
            "samples": clip.samples,
            "radius": radius,
            "seed": clip.seed,
            "scale": 1,
            "seconds_per_frame": None,
            **metrics_of_pair(once(MIDDLE), truth.pair, truth.clean, clip.stops),
            "flicker": truth.flicker((once(MIDDLE), once(MIDDLE + 1)), clip.stops),
        }
        key = self._key(motion, clip.samples, clip.seed, method, radius)
        if not clip.seed:  # others show the same place with other noise
            self.crops.keep(key, motion, once(MIDDLE), clip.stops)
        self._known[key] = point | more
        write_json(self._path, self._known)

    def _truth(self, motion: str) -> Truth:
        if motion not in self._truths:
            samples = self.reference_samples
            self._truths[motion] = Truth.of(self.frames, motion, samples)
        return self._truths[motion]

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
            mode = best_mode(clip, self._truth(clip.motion))
        return lambda number: clip.oidn(number, mode), {"mode": str(mode)}

    def _key(
        self, motion: str, samples: int, seed: int, method: str, radius: int
    ) -> str:
        other = f"-seed{seed}" if seed else ""
        what = f"{motion}-{samples}-{method}-{radius}{other}"
        return f"{what}-truth{self.reference_samples}-{_code(method == XRDS)}"


def best_mode(clip: Clip, truth: Truth) -> Denoising:
    """The mode of Cycles' denoiser with the highest PSNR on the middle frame."""
    true = [to_srgb(x, clip.stops) for x in truth.pair]

    def error(mode: Denoising) -> float:
        shown = to_srgb(clip.oidn(MIDDLE, mode), clip.stops)
        return float(squared_error(shown, true).mean())

    return min(rivals.MODES, key=error)


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
