"""Invalid pixels and fireflies: the damage stays where it was done."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from .measured import Measured, distance, faults, worst
from .pictures import lit_surface, textured

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from xrds_core.arrays import Array

    from .pictures import Inputs
    from .subject import Subject

POISONS = (np.nan, np.inf, -np.inf, -100.0)
EXTREMES = (0.0, 65504.0, 65505.0, 3.4e38, 1e-40, 1e6)
# Low-resolution pixels: nothing that lies farther away may change a pixel.
RECEPTIVE_FIELD = 160
FIREFLIES = (1e2, 1e4, 1e6, 1e8)
FAR = 3  # low-resolution pixels beyond a firefly's own

_FIELDS = ("radiance", "noisy", "albedo", "normal")
_PLACES: dict[str, Callable[[int], slice | tuple[slice, slice]]] = {
    "pixel": lambda side: np.s_[side // 3 : side // 3 + 1, side // 4 : side // 4 + 1],
    "row": lambda side: np.s_[side // 3 : side // 3 + 1],
    "pass": lambda side: np.s_[:],
}


def invalid(subject: Subject) -> Iterator[Measured]:
    """NaN, infinities and negative values in every input, alone and together."""
    values = POISONS + EXTREMES if subject.thorough else (*POISONS, 3.4e38, 1e-40)
    fields: list[tuple[str, ...]] = [_FIELDS]
    if subject.thorough:
        fields += [(name,) for name in _FIELDS]
    curve = {}
    cases = product(values, fields, _PLACES.values())
    for number, (value, spoilt, place) in enumerate(cases):
        inputs, noisy = _poisoned(
            textured(subject.side, subject.scale), value, spoilt, place
        )
        pictures = (subject(inputs, noisy=noisy, exposure=e) for e in (None, 1.0))
        curve[number] = sum(map(faults, pictures))
    yield worst("invalid.faults", curve)


def reach(subject: Subject) -> Iterator[Measured]:
    """With the exposure given, far pixels are the same bit for bit."""
    scale = subject.scale
    width = (RECEPTIVE_FIELD + 24) * scale
    clean = textured(8 * scale, scale, width=width)
    expected = subject(clean, exposure=0.1)
    changed, near = 0, []
    for value in (np.nan, -100.0, 3.4e38):
        spoilt, noisy = _poisoned(clean, value, _FIELDS, lambda _: np.s_[2:4, 2:4])
        picture = subject(spoilt, noisy=noisy, exposure=0.1)
        beyond = np.s_[:, (RECEPTIVE_FIELD + 4) * scale :]
        changed += int((picture[beyond] != expected[beyond]).sum())
        near.append(_disturbed(picture, expected, 0.01) / scale)
    yield Measured("invalid.reach", changed)
    yield Measured("invalid.distance", max(near) - 4)


def _disturbed(picture: Array, expected: Array, least: float) -> int:
    """Return the last column that differs by more than a share of the mean."""
    off = np.abs(picture - expected).max(axis=(0, 2)) > least * expected.mean()
    return int(np.flatnonzero(off).max(initial=0))


def _poisoned(
    inputs: Inputs,
    value: float,
    fields: tuple[str, ...],
    place: Callable[[int], slice | tuple[slice, slice]],
) -> tuple[Inputs, Array]:
    """The inputs and the radiance before denoising, which was as clean as after it."""
    arrays = inputs._asdict() | {"noisy": inputs.radiance}
    for name in fields:
        arrays[name] = arrays[name].copy()
        arrays[name][place(arrays[name].shape[0])] = value
    noisy = arrays.pop("noisy")
    return inputs._replace(**arrays), noisy


def fireflies(subject: Subject) -> Iterator[Measured]:
    """Pixels of 1e2 to 1e8: what they do beyond their own surroundings."""
    inputs, _ = lit_surface(subject.side, subject.scale)
    expected = subject(inputs)
    spots = _spots(subject.low_side)
    away = distance(subject.side, subject.scale, spots)
    far, leak = {}, {}
    for value in FIREFLIES:
        low = inputs.radiance.copy()
        for spot in spots:
            low[spot] = value
        change = np.abs(subject(inputs.with_radiance(low)) - expected).mean(axis=2)
        distant = away > FAR * subject.scale
        far[value] = float(change[distant].mean() / expected[distant].mean())
        leak[value] = float(change[away > 2 * subject.scale].sum() / change.sum())
    yield worst("firefly.far_change", far)
    yield worst("firefly.light_beyond_two_pixels", leak)


def _spots(side: int) -> list[tuple[int, int]]:
    """Return four scattered pixels, none at an edge."""
    random = np.random.default_rng(11)
    spots = random.integers(side // 6, side - side // 6, (4, 2))
    return [(int(row), int(column)) for row, column in spots]


CHECKS = (invalid, reach, fireflies)
