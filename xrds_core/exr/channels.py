"""The passes of an OpenEXR file, found by the names of its channels.

A channel is called `Layer.Pass.R`; the layer may be left out.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path

from ..errors import PictureError

COMPONENTS = ("RGB", "XYZ", "rgb", "xyz")
"""Letters of the channels of a colour or a direction, in their order."""
_COMPOSITED = "Composite."  # Blender's layer for the output of its compositor


class Channels:
    """Names of channels, and which of them make a pass; `path` stands in errors."""

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
        """Return the full name of the one pass that is called so, or None.

        `letters`: of its channels, any of these; of a colour or a direction by default.
        Raises PictureError where several layers have it.
        """
        prefixes = {name.rpartition(".")[0] for name in self.names}
        ending = f".{wanted}"
        matches = [
            prefix
            for prefix in sorted(prefixes)
            if _ends(f".{prefix}", ending, any_case) and self.of(prefix, letters)
        ]
        if wanted in matches:
            return wanted
        matches = [x for x in matches if not x.startswith(_COMPOSITED)] or matches
        if len(matches) > 1:
            raise PictureError(
                f"{self.path} holds {wanted!r} in several layers: "
                f"{', '.join(matches)}; give one of these names"
            )
        return matches[0] if matches else None

    def of(self, prefix: str, letters: Sequence[str] = COMPONENTS) -> list[str]:
        """Return the channels of a pass, the first of `letters` that are all there."""
        dotted = f"{prefix}." if prefix else ""
        for each in letters:
            names = [dotted + letter for letter in each]
            if all(name in self.names for name in names):
                return names
        return []

    def contents(self) -> str:
        """Say what passes there are."""
        passes = {name.rpartition(".")[0] or name for name in self.names}
        return ", ".join(sorted(passes)) or "nothing"


def _ends(name: str, ending: str, any_case: bool) -> bool:
    if any_case:
        name, ending = name.lower(), ending.lower()
    return name.endswith(ending)
