"""From passes to light and back: some passes were divided by a colour."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ..arrays import Array
from .find import LightPart


def light_of(
    parts: Sequence[LightPart], read: Callable[[tuple[str, ...]], Array]
) -> dict[str, Array]:
    """Return the light of each part (H, W, 3), by its name, and the colours by theirs.

    `read` gives the pixels of three channels.
    """
    light: dict[str, Array] = {}
    for part in parts:
        pixels = read(part.channels)
        if part.colour:
            if part.colour_name not in light:
                light[part.colour_name] = read(part.colour)
            with np.errstate(over="ignore", invalid="ignore"):
                pixels = pixels * light[part.colour_name]
        light[part.name] = pixels
    return light


def passes_of(
    parts: Sequence[LightPart], light: Mapping[str, Array]
) -> dict[tuple[str, ...], Array]:
    """Return the pixels of each part's channels, and of the colours'.

    `light` is as `light_of` returns it.
    """
    found: dict[tuple[str, ...], Array] = {}
    for part in parts:
        pixels = light[part.name]
        if part.colour:
            colour = found[part.colour] = light[part.colour_name]
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                pixels = np.where(colour > 0.0, pixels / colour, np.float32(0.0))
        found[part.channels] = pixels
    return found


def passes_by_name(
    parts: Sequence[LightPart], light: Mapping[str, Array]
) -> dict[str, Array]:
    """Return as `passes_of`, by the names of the passes."""
    found = passes_of(parts, light)
    return {channels[0].rpartition(".")[0]: x for channels, x in found.items()}
