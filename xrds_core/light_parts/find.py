"""Which parts of its light a file holds, and in which channels."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase

from ..errors import UsageError
from ..exr.channels import Channels
from .table import Renderer, read_renderers

NONE, GROUPS, ALL = "none", "groups", "all"


@dataclass(frozen=True)
class LightPart:
    """A pass of light: its `channels` R, G, B, and those of the `colour` it is over.

    `colour` is () where the pass is light as it is. Parts of one `sum` add up to the
    picture; "" adds up to nothing. `names` are all that it is known by.
    """

    name: str
    channels: tuple[str, ...]
    colour: tuple[str, ...] = ()
    sum: str = ""
    names: tuple[str, ...] = ()

    @property
    def colour_name(self) -> str:
        """Name of the colour among what is gathered; no part is called so."""
        return f"{self.colour[0]}, colour" if self.colour else ""


@dataclass(frozen=True)
class Wanted:
    """Which parts are wanted: NONE, GROUPS, ALL, or names.

    `alone` are names of further passes of light, which add up to nothing.
    """

    which: tuple[str, ...] = (NONE,)
    alone: tuple[str, ...] = ()
    renderers: tuple[Renderer, ...] = field(default_factory=read_renderers)

    def __bool__(self) -> bool:
        return self.which != (NONE,) or bool(self.alone)


def find_parts(channels: Channels, layer: str, wanted: Wanted) -> tuple[LightPart, ...]:
    """Return the wanted parts of one layer of a file, and of what has no layer.

    Raises UsageError for names that the file does not have.
    """
    if not wanted:
        return ()
    passes = _passes(channels, layer)
    known = max((_of(x, passes) for x in wanted.renderers), key=len)
    named = {name: part for part in known for name in part.names}
    found: list[LightPart] = []
    for which in wanted.which:
        if which == GROUPS:
            found += [part for part in known if part.sum == GROUPS]
        elif which == ALL:
            found += known
        elif which != NONE:
            found.append(_named(channels, which, named, known))
    for name in wanted.alone:
        if name not in passes:
            raise _unknown(channels, name, passes)
        found.append(LightPart(name, passes[name], names=(name,)))
    return tuple({part.channels: part for part in found}.values())


def _passes(channels: Channels, layer: str) -> dict[str, tuple[str, ...]]:
    """The channels of all colours in a layer, or in none, by the passes' names."""
    ahead = f"{layer}." if layer else ""
    prefixes = sorted({name.rpartition(".")[0] for name in channels.names})
    found = ((prefix, channels.of(prefix, ("RGB", "rgb"))) for prefix in prefixes)
    return {
        prefix.removeprefix(ahead): tuple(names)
        for prefix, names in found
        if names and prefix and (prefix.startswith(ahead) or "." not in prefix)
    }


def _of(renderer: Renderer, passes: dict[str, tuple[str, ...]]) -> list[LightPart]:
    """The parts that a renderer would have written."""
    parts = []
    for lobe in renderer.lobes:
        name = _first(lobe.names, passes)
        colour = _first(lobe.colour, passes)
        if name and (colour or not lobe.colour):
            over = passes[colour] if colour else ()
            parts.append(LightPart(name, passes[name], over, "lobes", lobe.names))
    taken = {part.name for part in parts}
    for name, channels in passes.items():
        if any(fnmatchcase(name, x) for x in renderer.groups) and name not in taken:
            group = (name, *(_short(name, x) for x in renderer.groups))
            parts.append(LightPart(name, channels, (), GROUPS, group))
        elif name in renderer.alone:
            parts.append(LightPart(name, channels, names=(name,)))
    return parts


def _first(names: Sequence[str], passes: Collection[str]) -> str:
    return next((name for name in names if name in passes), "")


def _short(name: str, pattern: str) -> str:
    """The light group's own name."""
    return name.removeprefix(pattern.rstrip("*"))


def _named(
    channels: Channels,
    name: str,
    named: dict[str, LightPart],
    known: Sequence[LightPart],
) -> LightPart:
    exact = next((part for part in known if part.name == name), None)
    part = exact or named.get(name)
    if part is None:
        raise _unknown(channels, name, [x.name for x in known])
    return part


def _unknown(channels: Channels, name: str, known: Collection[str]) -> UsageError:
    there = ", ".join(sorted(known)) or "none"
    return UsageError(f"{channels.path} has no light {name!r}; it holds {there}")
