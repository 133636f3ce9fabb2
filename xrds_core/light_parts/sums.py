"""What parts of a frame's light sum up to, before and after they are denoised."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .adding_up import add_up

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from ..arrays import Array
    from .find import LightPart

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
    found = {part.name: light[part.name] for part in parts}
    if radiance is None or not found:
        return found
    least = _ALL * float(np.nan_to_num(radiance).mean())
    for name, members in _sums(parts).items():
        missing = radiance - sum(found[part.name] for part in members)
        is_much = float(np.nan_to_num(np.abs(missing)).mean()) > least
        if is_much if like is None else _rest(name) in like:
            found[_rest(name)] = np.maximum(missing, np.float32(0.0))
    return found


def added_up(
    picture: Array,
    denoised: Mapping[str, Array],
    parts: Sequence[LightPart],
    colours: Mapping[str, Array],
) -> dict[str, Array]:
    """Return denoised parts that add up to the denoised picture (H, W, 3 or 4).

    `colours` (H, W, 3) are those that parts are divided by, by name.
    """
    found = {part.name: denoised[part.name] for part in parts}
    for name, members in _sums(parts).items():
        sums = {part.name: denoised[part.name] for part in members}
        if _rest(name) in denoised:
            sums[_rest(name)] = denoised[_rest(name)]
        masks = {
            part.name: colours[part.colour_name] for part in members if part.colour
        }
        found |= add_up(picture[..., :3], sums, masks)
    return {part.name: found[part.name] for part in parts}


def _sums(parts: Sequence[LightPart]) -> dict[str, list[LightPart]]:
    sums: dict[str, list[LightPart]] = {}
    for part in parts:
        if part.sum:
            sums.setdefault(part.sum, []).append(part)
    return sums


def _rest(name: str) -> str:
    """The name of what a sum misses; no pass is called so."""
    return f"rest of {name}."
