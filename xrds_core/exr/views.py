"""The views of a stereo file: which channels show what which eye sees.

Either the header names them, as OpenEXR has it, and channels are called `left.R` or
`Layer.left.R`, those of the first view also without its name; or parts are of a view;
or channels are called so without a word in the header, as in Blender's files.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .openexr_io import VIEWS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from .openexr_io import Part

_USUAL = ("left", "right")


def with_view(name: str, part: Part) -> str:
    """A channel's full name with the view of its part, if that has one."""
    view = part.attributes.get("view")
    if not isinstance(view, str) or view in name.split("."):
        return name
    return f"{view}.{name}"


def by_view(
    parts: Sequence[Part], places: Mapping[str, Any]
) -> dict[str, dict[str, Any]]:
    """Return the places of channels by their names without that of their view.

    The first view comes first; a file without views has one that is called "".
    """
    views = _views(parts, places)
    if len(views) < 2:
        return {"": dict(places)}
    found: dict[str, dict[str, Any]] = {view: {} for view in views}
    for name, place in places.items():
        *layers, letter = name.split(".")
        named = [x for x in layers if x in found]
        if named:
            del layers[len(layers) - 1 - layers[::-1].index(named[-1])]
            found[named[-1]][".".join((*layers, letter))] = place
        else:
            found[views[0]].setdefault(name, place)
    return {view: channels for view, channels in found.items() if channels} or {"": {}}


def _views(parts: Sequence[Part], names: Mapping[str, Any]) -> list[str]:
    for told in (part.attributes.get(VIEWS) for part in parts):
        if isinstance(told, list) and all(x and isinstance(x, str) for x in told):
            return list(dict.fromkeys(told))
    of_parts = [part.attributes.get("view") for part in parts]
    views = list(dict.fromkeys(x for x in of_parts if isinstance(x, str)))
    if views:
        return views
    last = {x for name in names for x in name.split(".")[-2:-1]}
    return list(_USUAL) if last >= set(_USUAL) else []
