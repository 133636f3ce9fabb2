"""Shots of every kind that accumulation may meet, small and mixed at will.

The compiled library and its specification are compared on them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import panoramas
import shots
import specification
from numpy.typing import NDArray
from specification.filters import extreme
from specification.places import still_places

from xrds_core.accumulation import accumulate as module
from xrds_core.accumulation import weighted_sums
from xrds_core.accumulation.accumulate import Accumulated, accumulate, same_shot
from xrds_core.accumulation.camera import Sphere
from xrds_core.accumulation.frame import Frame, Halves, Stored, store
from xrds_core.accumulation.object_motion import Movement
from xrds_core.accumulation.reprojection import pair
from xrds_core.accumulation.weighted_sums import MARGIN, find_spots

Array = NDArray[Any]
Shape = tuple[int, int]

CAMERAS = ("pan", "zoom", "turn", "orthographic", "panorama", "part", "whole", "still")
SHAPES = ((1, 1), (1, 7), (7, 1), (2, 2), (3, 130), (130, 3), (129, 513))
SAMPLES = (1.0, 2.0, 4.0, 16.0, 64.0)
ODD = (np.nan, np.inf, -np.inf)
# A step of half floats, the smallest one, and differences that are none: of passes as a
# share of the light, of samples as one of themselves.
HALF_STEP, LEAST_HALF, LIKE, COUNTS_LIKE = 2.0**-10, 2.0**-24, 1e-4, 1e-3


@dataclass(frozen=True)
class Kind:
    """What a shot is made of; `sides` are how many frames lie before and after.

    `moving`: a card that moves by itself; `mirror`: one that shows what is behind it;
    `sizes`: neighbours are rendered in other borders; `extreme`: light beyond half
    floats, and depths that say nothing.
    """

    camera: str = "pan"
    shape: Shape = (shots.HEIGHT, shots.WIDTH)
    samples: float = 4.0
    sides: tuple[int, int] = (2, 2)
    light: bool = True
    alpha: bool = False
    parts: bool = False
    counts: bool = False
    invalid: bool = False
    halves: bool = False
    moving: bool = False
    mirror: bool = False
    sizes: bool = False
    sky: bool = False
    extreme: bool = False
    seed: int = 0


def random_kind(seed: int) -> Kind:
    """Any mixture of all; large ones are rare."""
    rng = np.random.default_rng(seed)
    chance = rng.random()
    shape = tuple(rng.integers(1, 70, 2).tolist())
    if chance < 0.15:
        shape = SHAPES[rng.integers(len(SHAPES) - 1)]
    elif chance > 0.98:
        shape = SHAPES[-1]

    def any_of(share: float) -> bool:
        return bool(rng.random() < share)

    return Kind(
        CAMERAS[rng.integers(len(CAMERAS))],
        shape,
        float(rng.choice([0.5, 3.0, *SAMPLES])),
        tuple(rng.integers(0, 4, 2).tolist()),
        any_of(0.8),
        *(any_of(share) for share in (0.3, 0.3, 0.3, 0.3, 0.4)),
        *(any_of(share) for share in (0.3, 0.3, 0.2, 0.2, 0.15)),
        seed,
    )


def shot(kind: Kind) -> tuple[Stored, list[Stored]]:
    """Return the target and its neighbours."""
    rng = np.random.default_rng(kind.seed)
    before, after = kind.sides
    numbers = range(-before, after + 1)
    frames = _panoramas(kind, rng, numbers) or _views(kind, rng, numbers)
    stored = [store(_with_passes(kind, rng, x)) for x in frames]
    return stored[before], stored[:before] + stored[before + 1 :]


def _window(kind: Kind, rng: np.random.Generator, number: int) -> tuple[Shape, Shape]:
    """Shape and window of a frame's border."""
    if not kind.sizes or not number:
        return kind.shape, (0, 0)
    height, width = (max(n + int(rng.integers(-9, 10)), 1) for n in kind.shape)
    x, y = rng.integers(-4, 5, 2).tolist()
    return (height, width), (x, y)


def _panoramas(kind: Kind, rng: np.random.Generator, numbers: range) -> list[Frame]:
    if kind.camera not in ("panorama", "part"):
        return []
    sphere = Sphere((-1.5, 1.2), (-0.7, 1.1)) if kind.camera == "part" else Sphere()
    step, frames = rng.uniform(-0.1, 0.1, 3), []
    for number in numbers:
        shape, window = _window(kind, rng, number)
        x, z, yaw = step * number
        eye = panoramas.camera(x, z, yaw, sphere, kind.shape[::-1], window)
        frame = panoramas.frame(number, eye, 0.2, shape, samples=kind.samples)
        if kind.moving:
            vector = np.zeros((*shape, 4), np.float32)
            vector[: shape[0] // 2, : shape[1] // 2] = 2.3
            frame = replace(frame, vector=vector)
        if kind.mirror:
            frame = replace(frame, path_length=1.7 * frame.depth)
        frames.append(frame)
    return frames


def _views(kind: Kind, rng: np.random.Generator, numbers: range) -> list[Frame]:
    card = rng.uniform(-0.5, 0.5, 2) if kind.moving else np.zeros(2)
    far = 4.0 if kind.sky else 90.0
    steps = rng.uniform(-0.4, 0.4, 3)
    worlds, views = [], []
    for number in numbers:
        shape, window = _window(kind, rng, number)
        world = shots.World(
            (float(card[0] * number), float(card[1] * number)), wall_half=far
        )
        eye = _eye(kind, steps, number, window)
        more = {"samples": kind.samples, "still": kind.camera == "still"}
        view = shots.view(number, eye, world, 0.2, shape, **more)
        if kind.mirror:
            shown = shots.view(number, eye, shots.World(wall_half=far), 0.2, shape)
            length = shown.frame.depth / eye.depth_per_length(shape)
            depth = view.frame.depth
            frame = replace(shown.frame, depth=depth, path_length=length, **more)
            view = replace(view, frame=frame)
        worlds.append(world)
        views.append(view)
    if not kind.moving:
        return [x.frame for x in views]
    return [
        replace(x.frame, vector=shots.vector(views, k, worlds))
        for k, x in enumerate(views)
    ]


def _eye(kind: Kind, steps: Array, number: int, window: Shape) -> Any:
    x, y, z = (steps * number).tolist()
    name = kind.camera
    if name == "still":
        return shots.camera(window=window)
    if name == "whole":
        return shots.camera(x=10 * shots.PIXEL * number, window=window)
    if name == "turn":
        return shots.camera(x, 0.0, z, yaw=0.05 * number, window=window)
    eye = shots.camera(x, y, orthographic=name == "orthographic", window=window)
    if name == "zoom":
        project = eye.project.copy()
        project[[0, 1], [0, 1]] *= 1.02**number
        eye = replace(eye, project=project)
    return eye


def _with_passes(kind: Kind, rng: np.random.Generator, frame: Frame) -> Frame:
    """The same frame with all other passes of its kind."""
    shape = height, width = frame.shape
    more: dict[str, Any] = {}
    row, column = np.mgrid[:height, :width]
    radiance = frame.radiance
    assert radiance is not None
    if kind.extreme:
        scale = rng.choice([1e-7, 1.0, 1.0, 1.0, 1e4, 1e6, -1.0], shape)
        radiance = (radiance * scale[..., None]).astype(np.float32)
        depth = frame.depth.copy()
        where = rng.random(shape) < 0.05
        # the square of a panorama's inverse depth is to be a float
        least = 1e-30 if frame.camera.sphere is None else 1e-15
        odd = [*ODD, 0.0, -1.0, least, 1e30, 1e10]
        depth[where] = rng.choice(odd, int(where.sum()))
        more["depth"] = depth
    if kind.alpha:
        waves = np.sin(0.2 * column + 0.1 * frame.number) + np.cos(0.15 * row)
        more["alpha"] = np.clip(waves + 0.3, 0.0, 1.0).astype(np.float32)
    if kind.parts:
        dark = np.zeros_like(radiance)
        key = dark if frame.number % 2 else 0.7 * radiance
        more["parts"] = {"key": key, "dark": dark, "sky": 0.3 * radiance}
    if kind.counts:
        most = int(2 * kind.samples) + 2
        more["counts"] = rng.integers(0, most, shape).astype(np.float32)
    if kind.halves:
        more["halves"] = _halves(kind, rng, replace(frame, radiance=radiance))
    if kind.invalid:
        passes = {"albedo": frame.albedo, "normal": frame.normal, "radiance": radiance}
        passes |= {"alpha": more["alpha"]} if kind.alpha else {}
        for name, array in passes.items():
            spoilt = array.copy()
            where = rng.random(shape) < 0.03
            spoilt[where] = rng.choice(ODD, int(where.sum()))[
                (...,) + (None,) * (array.ndim - 2)
            ]
            spoilt[: height // 3, : width // 4] = np.nan
            more[name] = spoilt
        radiance = more["radiance"]
    return replace(frame, **(more | {"radiance": radiance if kind.light else None}))


def _halves(kind: Kind, rng: np.random.Generator, frame: Frame) -> Halves:
    noise = 0.1 * rng.standard_normal((*frame.shape, 1)).astype(np.float32)
    light = frame.radiance
    radiance = np.stack([light * (1 + noise), light * (1 - noise)])
    if kind.extreme:
        where = rng.random(radiance.shape) < 0.02
        radiance[where] = rng.choice(ODD, int(where.sum()))
    shares, counts = rng.choice([0.25, 0.5, 1.0]), None
    if kind.counts:
        counts = rng.integers(0, 5, (2, *frame.shape)).astype(np.float32)
    return Halves(radiance, (float(shares), 1 - float(shares)), counts)


class Specified(specification.Work):
    """The specification, which takes the library's guess where its own is like it.

    A guess is rounded to half floats. Where the sums differ in their last bit, it may
    be rounded the other way, which is the largest of all differences.
    """

    def guess(self, neighbours: Sequence[Any]) -> Array:
        own = super().guess(neighbours).astype(np.float32)
        names = [field.name for field in fields(self)]
        compiled = weighted_sums.Work(*(getattr(self, name) for name in names))
        guess = compiled.guess(neighbours).astype(np.float32)
        if not self.target.has_light:
            own[-1] = guess[-1] = 0.0  # brightness, which nothing asks for
        finite = own[np.isfinite(own)]
        light = np.abs(finite).mean() if finite.size else 0.0
        like = HALF_STEP * np.abs(own) + LIKE * light + LEAST_HALF
        found = np.where(np.abs(guess - own) <= like, guess, own)
        return found.astype(np.float16)


def specified(
    target: Stored, others: Sequence[Stored], movement: Movement | None = None
) -> Accumulated:
    """What the specification accumulates."""
    compiled = module.Work
    module.Work = Specified  # type: ignore[misc, assignment]
    try:
        return accumulate(target, others, movement)
    finally:
        module.Work = compiled  # type: ignore[misc]


def passes_of(found: Accumulated) -> dict[str, Array]:
    """All that is accumulated, by name."""
    named = {
        name: getattr(found, name)
        for name in ("radiance", "albedo", "normal", "alpha", "samples")
    }
    named |= {f"part {name}": x for name, x in found.parts.items()}
    return {name: x for name, x in named.items() if x is not None}


@dataclass(frozen=True)
class Apart:
    """How far two results are from each other, away from places that are.

    `passes`: their largest difference, as a share of the mean light; `others`: how many
    pixels have another number of samples, are NaN in one alone, or are apart by more
    than `LIKE`; `flipped`: how many take another pixel of a neighbour.
    """

    passes: dict[str, float]
    others: int
    flipped: int
    rejected: float


def flipped(target: Stored, others: Sequence[Stored]) -> Array:
    """Where a place is found in another pixel, (H, W).

    The functions of angles are rounded otherwise, so that a place on a panorama may
    fall on the other side of a border.
    """
    result = np.zeros(len(target.picture), bool)
    for other in same_shot(target, others):
        both = pair(target, other)
        spots, (expected, _) = find_spots(both, 1), still_places(both)
        result |= spots.seen != expected.seen
        result |= spots.seen & (spots.pixel != expected.pixel)
    return result.reshape(target.shape)


def apart(
    found: Accumulated, expected: Accumulated, flips: Array | None = None
) -> Apart:
    """Compare two results, but for all that is judged together with `flips`."""
    one, two = passes_of(found), passes_of(expected)
    assert one.keys() == two.keys()
    counts, own = one.pop("samples"), two.pop("samples")
    others = ~(np.abs(counts - own) <= COUNTS_LIKE * own)
    reach = 2 * MARGIN + 2  # of the guess, of what it changes around, and of weights
    flips = np.zeros(own.shape, bool) if flips is None else flips
    near = extreme(flips, np.logical_or, reach) if flips.any() else flips
    passes = {}
    for name in two:
        assert one[name].shape == two[name].shape
        assert one[name].dtype == two[name].dtype == np.float32
        x, y = (each[name].reshape(*own.shape, -1) for each in (one, two))
        others |= (np.isnan(x) != np.isnan(y)).any(axis=-1)
        known = np.isfinite(y).all(axis=-1) & ~near
        light = np.abs(y[known]).mean() if known.any() else 0.0
        share = np.abs(x - y).max(axis=-1) / max(light, LEAST_HALF)
        others |= known & (share > LIKE)
        passes[name] = float(share[known].max(initial=0.0))
    rejected = abs(found.rejected - expected.rejected)
    return Apart(passes, int((others & ~near).sum()), int(flips.sum()), rejected)
