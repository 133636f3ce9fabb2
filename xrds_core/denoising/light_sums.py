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
    """Make AOVs or light passes add up to a picture; none becomes negative.

    What they miss of the picture goes to each by the square of its light: a denoiser's
    errors grow with it.

    Parameters
    ----------
    picture : (H, W, 3) float32 array
        Scene-linear radiance.
    parts : mapping of str to (H, W, 3) float32 array
        Light by name. A part that is dark everywhere stays so.
    masks : mapping of str to (H, W, 3) float32 array, optional
        Colours by the part's name: where one is 0 the part cannot have light, and
        others take it.

    Returns
    -------
    parts : dict of str to (H, W, 3) float32 array
        Light that adds up to the picture.
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
    """Fill the zeros of a colour pass from the pixels around them.

    Where a pixel's few samples have missed a lobe its colour is 0, but the denoised
    light there is not.

    Parameters
    ----------
    colour : (H, W, 3) float32 array
        A colour pass.

    Returns
    -------
    completed : (H, W, 3) float32 array
        Zeros are the mean of the 3x3 pixels around; 0 only where all of these are 0.
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
    """Return where a part can have light: 1, elsewhere 0."""
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
    """Return the AOVs and light passes of a frame, without the colours.

    Where the parts of one sum do not make up the radiance, what they miss is one part
    more.

    Parameters
    ----------
    radiance : (H, W, 3) float32 array or None
        Scene-linear radiance; None adds no such part.
    light : mapping of str to (H, W, 3) float32 array
        Light of the parts, and the colours, by name: what `light_of` returns.
    parts : sequence of LightPart
        The parts to return.
    like : collection of str, optional
        Names of the parts that the result is to have: what is missing is then a part
        exactly where its name is among them.

    Returns
    -------
    parts : dict of str to (H, W, 3) float32 array
        Light by name.
    """
    light_by_name = {part.name: light[part.name] for part in parts}
    if radiance is None or not light_by_name:
        return light_by_name
    least = _ALL * float(np.nan_to_num(radiance).mean())
    for name, members in _group_by_sum(parts).items():
        missing = radiance - sum(light_by_name[part.name] for part in members)
        is_much = float(np.nan_to_num(np.abs(missing)).mean()) > least
        if is_much if like is None else _rest_name(name) in like:
            light_by_name[_rest_name(name)] = np.maximum(missing, np.float32(0.0))
    return light_by_name


def added_up(
    picture: Array,
    denoised: Mapping[str, Array],
    parts: Sequence[LightPart],
    colours: Mapping[str, Array],
) -> dict[str, Array]:
    """Make denoised AOVs and light passes add up to the denoised picture.

    Parameters
    ----------
    picture : (H, W, 3) or (H, W, 4) float32 array
        The denoised picture.
    denoised : mapping of str to (H, W, 3) float32 array
        Denoised light by name.
    parts : sequence of LightPart
        The parts to return.
    colours : mapping of str to (H, W, 3) float32 array
        The colours that parts are divided by, by `LightPart.colour_name`.

    Returns
    -------
    parts : dict of str to (H, W, 3) float32 array
        Light by name; parts that belong to no sum stay as they are.
    """
    light_by_name = {part.name: denoised[part.name] for part in parts}
    for name, members in _group_by_sum(parts).items():
        sums = {part.name: denoised[part.name] for part in members}
        if _rest_name(name) in denoised:
            sums[_rest_name(name)] = denoised[_rest_name(name)]
        masks = {
            part.name: colours[part.colour_name] for part in members if part.colour
        }
        light_by_name |= add_up(picture[..., :3], sums, masks)
    return {part.name: light_by_name[part.name] for part in parts}


def _group_by_sum(parts: Sequence[LightPart]) -> dict[str, list[LightPart]]:
    sums: dict[str, list[LightPart]] = {}
    for part in parts:
        if part.sum:
            sums.setdefault(part.sum, []).append(part)
    return sums


def _rest_name(name: str) -> str:
    """Return the name of what a sum misses; no pass has such a name."""
    return f"rest of {name}."
