"""The pictures of a shot as `xrds render` finishes them, and the figures of them.

Figures are kept in a file and hold as long as the code that they judge is the same.
"""

from __future__ import annotations

import base64
import hashlib
import io
import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

import xrds_core
from xrds_blender.planning.request import render_request
from xrds_blender.rendering import full_size
from xrds_blender.rendering.full_size import FullSize
from xrds_core.accumulation.accumulate import Accumulated
from xrds_core.accumulation.frame import Frame, Stored, store
from xrds_core.arrays import Array
from xrds_core.files import write_json
from xrds_core.shot import Shot as Window

from ..checksum import checksum
from ..metrics import to_srgb
from . import images
from .frames import REACH, Measure, Request, Store
from .judge import BLOCK, Verdict, judge, unsteadiness
from .table import Shot

GENERATION = 1  # counts up whenever other figures are made of the same frames
MARGIN = 16  # pixels around a block that is shown
QUALITY = 80  # of crops; they are to be looked at
Point = dict[str, Any]


class Clip:
    """One shot at one number of samples: its finished frames."""

    def __init__(
        self, shot: Shot, samples: int, frames: dict[int, dict[str, Frame]]
    ) -> None:
        self.shot = shot
        count = None if shot.adaptive else samples
        job = render_request(
            scale=1, samples=count, temporal_radius=REACH, device="cpu"
        )
        self._method = FullSize(job)
        self.frames = frames
        self.view = next(iter(frames[shot.frames[0]]))
        self._stored: dict[int, dict[str, Stored]] = {}

    def alone(self, number: int) -> Array:
        """A frame by itself, radiance and alpha (H, W, 4)."""
        return self.finished(self.own(number), [])

    def lent(self, number: int) -> Array:
        """A frame with its neighbours' samples, and those of its other views."""
        return self.finished(self.own(number), self.neighbours(number))

    def by_surface(self, number: int) -> Array:
        """The same where what mirrors and glass show is not looked for."""
        own = replace(self.own(number), image=None)
        return self.finished(own, self.neighbours(number))

    def neighbours(self, number: int) -> list[Stored]:
        """Its neighbours, and its other views."""
        numbers = Window(self.shot.frames, REACH).neighbours(number)
        beside = self._packed(number).items()
        return [self._packed(n)[self.view] for n in numbers] + [
            each for name, each in beside if name != self.view
        ]

    def own(self, number: int) -> Stored:
        """A frame by itself, as it was sampled."""
        return self._packed(number)[self.view]

    def finished(
        self,
        own: Stored,
        lenders: Sequence[Stored],
        gathered: Accumulated | None = None,
    ) -> Array:
        """A frame with its lenders' samples (H, W, 4), or with those `gathered`."""
        made = self._method.finish_stored(own, lenders, gathered=gathered)
        return np.dstack((made.radiance, made.alpha))

    def _packed(self, number: int) -> dict[str, Stored]:
        if number not in self._stored:
            views = self.frames[number].items()
            self._stored[number] = {v: store(frame) for v, frame in views}
        return self._stored[number]

    def around_middle(self) -> list[int] | None:
        """Three frames of a camera that stands still; None where it moves."""
        place = len(self.shot.frames) // 2
        numbers = list(self.shot.frames[place - 1 : place + 2])
        first, *others = (self.frames[n][self.view].camera for n in numbers)
        return numbers if all(first.same(other) for other in others) else None


class ShotFigures:
    """All figures of one shot; those known are not computed again."""

    def __init__(self, shot: Shot, measure: Measure, frames: Store) -> None:
        self.shot, self.measure, self.store = shot, measure, frames
        self._path = frames.directory / f"{shot.name}-figures.json"
        self._known: dict[str, Point] = _stored(self._path)

    def points(self) -> list[Point]:
        """Figures at each number of samples, as far as the present code gave them."""
        made = (self._point(n) for n in self.shot.counts(self.measure.samples))
        return [point for point in made if point is not None]

    def measure_all(self) -> None:
        """Measure whatever is missing, and keep it."""
        for samples in self.shot.counts(self.measure.samples):
            keys = {number: self._key(samples, number) for number in self._judged()}
            left = [number for number, key in keys.items() if key not in self._known]
            if not left:
                continue
            requests = self.measure.noisy(self.shot, samples)
            frames = {r.number: self.store.frames(r) for r in requests}
            clip = Clip(self.shot, samples, frames)
            for number in left:
                self._known[keys[number]] = self._measured(clip, number)
                write_json(self._path, self._known)

    def _judged(self) -> tuple[int, ...]:
        return self.measure.judged(self.shot)

    def _measured(self, clip: Clip, number: int) -> Point:
        parts = self.measure.references(self.shot, number)
        references = [self.store.reference(part) for part in parts]
        lent, alone = clip.lent(number), clip.alone(number)
        verdicts = judge(lent, alone, references)
        point: Point = {"frame": number}
        for name, verdict in verdicts.items():
            point[name] = _rounded(verdict)
        if number == self.shot.judged[0]:
            point["flicker"] = _flicker(clip, lent, alone)
        if clip.own(number).image is not None:
            neighbours, surface = clip.neighbours(number), clip.by_surface(number)
            point["images"] = images.figures(
                clip.own(number), neighbours, (alone, surface, lent), references
            )
        point["crops"] = [
            crops(verdict, name, alone, lent, np.mean(references, axis=0))
            for name, verdict in verdicts.items()
            if not verdict.passed
        ]
        return point

    def _point(self, samples: int) -> Point | None:
        """The figures of all frames that are judged, as one row."""
        keys = [self._key(samples, number) for number in self._judged()]
        frames = [self._known[key] for key in keys if key in self._known]
        if not frames:
            return None
        verdicts = [f[n] for f in frames for n in ("colour", "alpha") if n in f]
        return {
            "shot": self.shot.name,
            "half": self.shot.half,
            "samples": samples,
            "adaptive": self.shot.adaptive,
            "gain": frames[0]["colour"]["gain"],
            "psnr": frames[0]["colour"]["psnr"],
            "psnr_alone": frames[0]["colour"]["psnr_alone"],
            "worst_block": min(v["worst"] for v in verdicts),
            "share": max(v["share"] for v in verdicts),
            "bare_worst_block": min(v["bare_worst"] for v in verdicts),
            "bare_share": max(v["bare_share"] for v in verdicts),
            "flicker": frames[0].get("flicker"),
            **frames[0].get("images", {}),
            "passed": all(v["passed"] for v in verdicts),
            "frames": frames,
        }

    def _key(self, samples: int, number: int) -> str:
        parts = self.measure.references(self.shot, number)
        inputs: list[Request] = [*self.measure.noisy(self.shot, samples)]
        inputs += [request for each in parts for request in each]
        # Python's own hash of strings differs from process to process
        digest = _digest(tuple(request.file_name for request in inputs))
        return f"{samples}-{number}-{digest}-{_code()}"


def _rounded(verdict: Verdict) -> Point:
    """A verdict as plain values; more digits than these are noise."""
    values = asdict(verdict).items()
    told = {k: round(x, 4) if isinstance(x, float) else x for k, x in values}
    return told | {"passed": verdict.passed}


def _flicker(clip: Clip, lent: Array, alone: Array) -> float | None:
    """How unsteady the shot is beside frames alone; None under a moving camera."""
    numbers = clip.around_middle()
    if numbers is None:
        return None
    before, _, after = numbers
    ours = unsteadiness(clip.lent(before), lent, clip.lent(after))
    theirs = unsteadiness(clip.alone(before), alone, clip.alone(after))
    return round(ours / theirs, 4) if theirs else None


def crops(
    verdict: Verdict, what: str, alone: Array, lent: Array, truth: Array
) -> Point:
    """The worst block of a picture, alone, as it is and as it should be."""
    row, column = verdict.place
    box = tuple(
        slice(max(start - MARGIN, 0), start + BLOCK + MARGIN) for start in (row, column)
    )
    pictures = {"alone": alone, "shot": lent, "reference": truth}
    shown = {name: encoded(x[box], what) for name, x in pictures.items()}
    return {
        "what": what,
        "loss": round(verdict.worst, 4),
        "place": [row, column],
        **shown,
    }


def encoded(picture: Array, what: str) -> str:
    """A data URI of colours, or of alpha as grey."""
    from PIL import Image

    if what == "alpha":
        display = np.clip(np.repeat(picture[..., 3:], 3, axis=-1), 0, 1)
    else:
        display = to_srgb(picture[..., :3])
    buffer = io.BytesIO()
    Image.fromarray(np.round(display * 255).astype(np.uint8)).save(
        buffer, "WEBP", quality=QUALITY
    )
    return "data:image/webp;base64," + base64.b64encode(buffer.getvalue()).decode()


@lru_cache(maxsize=1024)
def _digest(names: tuple[str, ...]) -> str:
    return hashlib.sha256("\n".join(names).encode()).hexdigest()[:12]


@lru_cache
def _code() -> str:
    """A checksum of the code that the figures judge."""
    package = Path(xrds_core.__file__).parent
    parts = ("temporal", "denoising", "sequence")
    sources = [path for part in parts for path in package.glob(f"{part}/*.py")]
    return checksum([*sources, Path(full_size.__file__)], GENERATION)


def _stored(path: Path) -> dict[str, Point]:
    try:
        return dict(json.loads(path.read_text("utf-8")))
    except (OSError, ValueError):
        return {}
