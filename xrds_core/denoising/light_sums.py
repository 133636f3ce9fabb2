"""Light passes that add up, before they are denoised and after."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ..accumulation.local_filters import box
from ..arrays import Array

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from ..arrays import Array
    from .light_passes import LightPart


_TINY = np.float32(1e-9)
_ROWS = 128  # at a time, so that memory does not grow with the picture


def add_up(
    picture: Array, parts: Mapping[str, Array], masks: Mapping[str, Array] | None = None
) -> dict[str, Array]:
    """Return parts (H, W, 3) that add up to a picture (H, W, 3); none is negative.

    The rest goes to each by the square of its light: a denoiser's errors grow with it.
    `masks`, by name, are colours (H, W, 3): a part that is 0 times one cannot have
    light there, others take it. A part that is dark everywhere stays so.
    """
    lit = [name for name, part in parts.items() if part.any()] or list(parts)
    result = dict(parts) | {name: np.empty_like(parts[name]) for name in lit}
    for first in range(0, len(picture), _ROWS):
        rows = slice(first, first + _ROWS)
        whole = np.maximum(picture[rows], np.float32(0.0))
        light = {name: _finite_light(parts[name][rows]) for name in lit}
        allowed = {name: _allowed_light(name, rows, masks or {}) for name in lit}
        weights = {k: (np.square(x) + _TINY) * allowed[k] for k, x in light.items()}
        total = np.maximum(sum(weights.values()), _TINY * _TINY)
        rest = (whole - sum(light[k] * allowed[k] for k in light)) / total
        for name, part in light.items():
            shared = part * allowed[name] + rest * weights[name]
            light[name] = np.maximum(shared, np.float32(0.0))
        made = sum(light.values())
        scale = whole / np.maximum(made, _TINY * _TINY)
        for name, part in light.items():
            by_weight = whole * (weights[name] / total)
            result[name][rows] = np.where(made > 0.0, part * scale, by_weight)
    return result


def completed(colour: Array) -> Array:
    """Return a colour pass (H, W, 3) that is 0 only where it is around a pixel, too.

    Where a pixel's few samples have missed a lobe, its colour is 0, but not the light
    that is denoised there. It becomes the mean of the 3x3 pixels around.
    """
    known = np.maximum(np.nan_to_num(colour, posinf=0.0), np.float32(0.0))
    if known.all():
        return known
    around = np.dstack([box(known[..., i], 3) for i in range(known.shape[2])])
    return np.where(known > 0.0, known, around)


def _finite_light(part: Array) -> Array:
    return np.maximum(np.nan_to_num(part, posinf=0.0), np.float32(0.0))


def _allowed_light(
    name: str, rows: slice, masks: Mapping[str, Array]
) -> Array | np.float32:
    """Where a part can have light: 1, elsewhere 0."""
    if name not in masks:
        return np.float32(1.0)
    return np.greater(masks[name][rows], 0.0).astype(np.float32)


# Of the mean radiance: where parts miss no more of it, they are all there are.
_ALL = 0.002


def light_in(
    radiance: Array | None,
    light: Mapping[str, Array],
    parts: Sequence[LightPart],
    like: Collection[str] | None = None,
) -> dict[str, Array]:
    """Return the parts of a frame's `light` (H, W, 3), by name, without colours.

    Where those of one sum do not make up the radiance, what they miss is one more; or
    where it is among the names that the result is to be `like`.
    """
    light_by_name = {part.name: light[part.name] for part in parts}
    if radiance is None or not light_by_name:
        return light_by_name
    least = _ALL * float(np.nan_to_num(radiance).mean())
    for name, members in _sums(parts).items():
        missing = radiance - sum(light_by_name[part.name] for part in members)
        is_much = float(np.nan_to_num(np.abs(missing)).mean()) > least
        if is_much if like is None else _rest(name) in like:
            light_by_name[_rest(name)] = np.maximum(missing, np.float32(0.0))
    return light_by_name


def added_up(
    picture: Array,
    denoised: Mapping[str, Array],
    parts: Sequence[LightPart],
    colours: Mapping[str, Array],
) -> dict[str, Array]:
    """Return denoised parts that add up to the denoised picture (H, W, 3 or 4).

    `colours` (H, W, 3) are those that parts are divided by, by name.
    """
    light_by_name = {part.name: denoised[part.name] for part in parts}
    for name, members in _sums(parts).items():
        sums = {part.name: denoised[part.name] for part in members}
        if _rest(name) in denoised:
            sums[_rest(name)] = denoised[_rest(name)]
        masks = {
            part.name: colours[part.colour_name] for part in members if part.colour
        }
        light_by_name |= add_up(picture[..., :3], sums, masks)
    return {part.name: light_by_name[part.name] for part in parts}


def _sums(parts: Sequence[LightPart]) -> dict[str, list[LightPart]]:
    sums: dict[str, list[LightPart]] = {}
    for part in parts:
        if part.sum:
            sums.setdefault(part.sum, []).append(part)
    return sums


def _rest(name: str) -> str:
    """The name of what a sum misses; no pass is called so."""
    return f"rest of {name}."
