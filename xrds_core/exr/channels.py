"""The passes and views of an OpenEXR file, found by the names of its channels."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import PictureError
from .openexr_io import VIEWS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from .openexr_io import Part


COMPONENTS = ("RGB", "XYZ", "rgb", "xyz")
"""Letters of the channels of a colour or a direction, in their order."""
_COMPOSITED = "Composite."  # Blender's layer for the output of its compositor


class Channels:
    """Names of a file's channels, and which of them make a pass.

    Parameters
    ----------
    path : str or Path
        The file, for error messages.
    names : collection of str
        Full names of its channels.
    """

    def __init__(self, path: str | Path, names: Collection[str]) -> None:
        self.path = path
        self.names = names

    def find(
        self,
        wanted: str,
        letters: Sequence[str] = COMPONENTS,
        *,
        any_case: bool = False,
    ) -> str | None:
        """Find a pass by its name.

        Parameters
        ----------
        wanted : str
            The name; layers before it may be left out.
        letters : sequence of str
            Letters that the pass's channels may have; those of a colour or a direction
            by default.
        any_case : bool
            Whether upper and lower case are the same.

        Returns
        -------
        name : str or None
            The full name of the pass; None if there is none.

        Raises
        ------
        PictureError
            If several layers have it.
        """
        prefixes = {name.rpartition(".")[0] for name in self.names}
        ending = f".{wanted}"
        matches = [
            prefix
            for prefix in sorted(prefixes)
            if _has_ending(f".{prefix}", ending, any_case) and self.of(prefix, letters)
        ]
        if wanted in matches:
            return wanted
        matches = [
            match for match in matches if not match.startswith(_COMPOSITED)
        ] or matches
        if len(matches) > 1:
            raise PictureError(
                f"{self.path} holds {wanted!r} in several layers: "
                f"{', '.join(matches)}; give one of these names"
            )
        return matches[0] if matches else None

    def of(self, prefix: str, letters: Sequence[str] = COMPONENTS) -> list[str]:
        """Return the channels of a pass, the first of `letters` that are all there."""
        dotted = f"{prefix}." if prefix else ""
        for components in letters:
            names = [dotted + letter for letter in components]
            if all(name in self.names for name in names):
                return names
        return []

    def contents(self) -> str:
        """Say what passes there are."""
        passes = {name.rpartition(".")[0] or name for name in self.names}
        return ", ".join(sorted(passes)) or "nothing"


def _has_ending(name: str, ending: str, any_case: bool) -> bool:
    if any_case:
        name, ending = name.lower(), ending.lower()
    return name.endswith(ending)


_USUAL = ("left", "right")


def with_view(name: str, part: Part) -> str:
    """Return a channel's full name with the view of its part, if that has one."""
    view = part.attributes.get("view")
    if not isinstance(view, str) or view in name.split("."):
        return name
    return f"{view}.{name}"


def by_view(
    parts: Sequence[Part], places: Mapping[str, Any]
) -> dict[str, dict[str, Any]]:
    """Sort the places of channels by the view that they belong to.

    Parameters
    ----------
    parts : sequence of Part
        Parts of a file.
    places : mapping of str to object
        Where each channel lies, by its full name.

    Returns
    -------
    places_by_view : dict of str to dict
        The first view comes first; names are without that of the view. A file without
        views has one that is called "".
    """
    views = _list_views(parts, places)
    if len(views) < 2:
        return {"": dict(places)}
    by_name: dict[str, dict[str, Any]] = {view: {} for view in views}
    for name, place in places.items():
        *layers, letter = name.split(".")
        named = [layer for layer in layers if layer in by_name]
        if named:
            del layers[len(layers) - 1 - layers[::-1].index(named[-1])]
            by_name[named[-1]][".".join((*layers, letter))] = place
        else:
            by_name[views[0]].setdefault(name, place)
    return {view: channels for view, channels in by_name.items() if channels} or {
        "": {}
    }


def _list_views(parts: Sequence[Part], names: Mapping[str, Any]) -> list[str]:
    for declared in (part.attributes.get(VIEWS) for part in parts):
        if isinstance(declared, list) and all(
            x and isinstance(x, str) for x in declared
        ):
            return list(dict.fromkeys(declared))
    of_parts = [part.attributes.get("view") for part in parts]
    views = list(dict.fromkeys(x for x in of_parts if isinstance(x, str)))
    if views:
        return views
    last = {x for name in names for x in name.split(".")[-2:-1]}
    return list(_USUAL) if last >= set(_USUAL) else []
