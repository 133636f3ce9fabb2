"""AOVs and light passes: what renderers call them, which a file holds, their light."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array
from ..errors import UsageError
from ..exr.channels import Channels

_SHIPPED = Path(__file__).with_name("renderers.toml")


@dataclass(frozen=True)
class Lobe:
    """A light pass; its light is the pass times a colour pass.

    Attributes
    ----------
    names : tuple of str
        The names that the pass may have.
    colour : tuple of str
        The names that the colour pass may have; () where the pass is not divided by a
        colour.
    """

    names: tuple[str, ...]
    colour: tuple[str, ...] = ()


@dataclass(frozen=True)
class Renderer:
    """The AOVs and light passes of one renderer.

    Attributes
    ----------
    name : str
        The renderer.
    lobes : tuple of Lobe
        Light passes that add up to the picture.
    groups : tuple of str
        Patterns of light groups, which add up to the picture too; * stands for
        anything.
    alone : tuple of str
        Names of AOVs that add up to nothing.
    """

    name: str
    lobes: tuple[Lobe, ...] = ()
    groups: tuple[str, ...] = ()
    alone: tuple[str, ...] = ()


def read_renderers(path: Path | None = None) -> tuple[Renderer, ...]:
    """Read the renderers of a TOML file.

    Parameters
    ----------
    path : Path, optional
        A file of the form that `renderers.toml` beside this module has.

    Returns
    -------
    renderers : tuple of Renderer
        Those of the file, then the known ones.

    Raises
    ------
    UsageError
        If the file has another form; it says what is wrong and where.
    """
    return (_read_file(path) if path is not None else ()) + _read_shipped()


@cache
def _read_shipped() -> tuple[Renderer, ...]:
    return _read_file(_SHIPPED)


def _read_file(path: Path) -> tuple[Renderer, ...]:
    try:
        renderers = tomllib.loads(path.read_text("utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise UsageError(f"cannot read the passes in {path}: {error}") from error
    return tuple(_make_renderer(path, name, table) for name, table in renderers.items())


def _make_renderer(path: Path, name: str, given: Any) -> Renderer:
    where = f"{path}: [{name}]"
    _check_keys(where, given, {"lobes", "groups", "alone"})
    lobes = given.get("lobes", [])
    if not isinstance(lobes, list):
        raise UsageError(f"{where} lobes: give a list of tables")
    return Renderer(
        name,
        tuple(_make_lobe(where, lobe) for lobe in lobes),
        _check_texts(f"{where} groups", given.get("groups", [])),
        _check_texts(f"{where} alone", given.get("alone", [])),
    )


def _make_lobe(where: str, given: Any) -> Lobe:
    _check_keys(f"{where} lobes", given, {"names", "colour"})
    names = _check_texts(f"{where} lobes: names", given.get("names", []))
    if not names:
        raise UsageError(f"{where} lobes: a lobe without names")
    return Lobe(names, _check_texts(f"{where} lobes: colour", given.get("colour", [])))


def _check_keys(where: str, given: Any, known: set[str]) -> None:
    if not isinstance(given, dict):
        raise UsageError(f"{where} is no table")
    if unknown := sorted(given.keys() - known):
        raise UsageError(
            f"{where} has {unknown[0]!r}, which is not among {', '.join(sorted(known))}"
        )


def _check_texts(where: str, given: Any) -> tuple[str, ...]:
    texts = isinstance(given, list) and all(isinstance(x, str) and x for x in given)
    if not texts:
        raise UsageError(f"{where}: give a list of names")
    return tuple(given)


NONE, GROUPS, ALL = "none", "groups", "all"


@dataclass(frozen=True)
class LightPart:
    """An AOV or light pass of a file.

    Attributes
    ----------
    name : str
        The name of the pass.
    channels : tuple of str
        Its channels R, G, B.
    colour : tuple of str
        Channels R, G, B of the colour that it was divided by; () where the pass is
        light as it is.
    sum : str
        Parts with the same `sum` add up to the picture; "" adds up to nothing.
    names : tuple of str
        All names that it is known by.
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
    """Which AOVs and light passes are wanted.

    Attributes
    ----------
    which : tuple of str
        NONE, GROUPS, ALL, or names.
    alone : tuple of str
        Names of further passes, which add up to nothing.
    renderers : tuple of Renderer
        What renderers call their passes.
    """

    which: tuple[str, ...] = (NONE,)
    alone: tuple[str, ...] = ()
    renderers: tuple[Renderer, ...] = field(default_factory=read_renderers)

    def __bool__(self) -> bool:
        return self.which != (NONE,) or bool(self.alone)


def find_parts(channels: Channels, layer: str, wanted: Wanted) -> tuple[LightPart, ...]:
    """Find the wanted AOVs and light passes of a file.

    Parameters
    ----------
    channels : Channels
        Names of the file's channels.
    layer : str
        The layer to search, beside what lies in no layer.
    wanted : Wanted
        Which passes are wanted.

    Returns
    -------
    parts : tuple of LightPart
        Each pass once.

    Raises
    ------
    UsageError
        If the file lacks a pass that is wanted by its name.
    """
    if not wanted:
        return ()
    passes = _list_passes(channels, layer)
    known = max(
        (_parts_written_by(renderer, passes) for renderer in wanted.renderers), key=len
    )
    named = {name: part for part in known for name in part.names}
    parts: list[LightPart] = []
    for which in wanted.which:
        if which == GROUPS:
            parts += [part for part in known if part.sum == GROUPS]
        elif which == ALL:
            parts += known
        elif which != NONE:
            parts.append(_find_part(channels, which, named, known))
    for name in wanted.alone:
        if name not in passes:
            raise _unknown_light(channels, name, passes)
        parts.append(LightPart(name, passes[name], names=(name,)))
    return tuple({part.channels: part for part in parts}.values())


def _list_passes(channels: Channels, layer: str) -> dict[str, tuple[str, ...]]:
    """Return the channels of all colours in a layer, or in none, by pass name."""
    ahead = f"{layer}." if layer else ""
    prefixes = sorted({name.rpartition(".")[0] for name in channels.names})
    channels_by_prefix = (
        (prefix, channels.of(prefix, ("RGB", "rgb"))) for prefix in prefixes
    )
    return {
        prefix.removeprefix(ahead): tuple(names)
        for prefix, names in channels_by_prefix
        if names and prefix and (prefix.startswith(ahead) or "." not in prefix)
    }


def _parts_written_by(
    renderer: Renderer, passes: dict[str, tuple[str, ...]]
) -> list[LightPart]:
    """Return the AOVs and light passes that a renderer would have written."""
    parts = []
    for lobe in renderer.lobes:
        name = _first_present(lobe.names, passes)
        colour = _first_present(lobe.colour, passes)
        if name and (colour or not lobe.colour):
            over = passes[colour] if colour else ()
            parts.append(LightPart(name, passes[name], over, "lobes", lobe.names))
    taken = {part.name for part in parts}
    for name, channels in passes.items():
        if (
            any(fnmatchcase(name, pattern) for pattern in renderer.groups)
            and name not in taken
        ):
            group = (name, *(_short_name(name, pattern) for pattern in renderer.groups))
            parts.append(LightPart(name, channels, (), GROUPS, group))
        elif name in renderer.alone:
            parts.append(LightPart(name, channels, names=(name,)))
    return parts


def _first_present(names: Sequence[str], passes: Collection[str]) -> str:
    return next((name for name in names if name in passes), "")


def _short_name(name: str, pattern: str) -> str:
    """The light group's own name."""
    return name.removeprefix(pattern.rstrip("*"))


def _find_part(
    channels: Channels,
    name: str,
    named: dict[str, LightPart],
    known: Sequence[LightPart],
) -> LightPart:
    exact = next((part for part in known if part.name == name), None)
    part = exact or named.get(name)
    if part is None:
        raise _unknown_light(channels, name, [known_part.name for known_part in known])
    return part


def _unknown_light(channels: Channels, name: str, known: Collection[str]) -> UsageError:
    names = ", ".join(sorted(known)) or "none"
    return UsageError(f"{channels.path} has no light {name!r}; it holds {names}")


def light_of(
    parts: Sequence[LightPart], read: Callable[[tuple[str, ...]], Array]
) -> dict[str, Array]:
    """Read the light of AOVs and light passes.

    Parameters
    ----------
    parts : sequence of LightPart
        The passes.
    read : callable
        Takes three channel names and returns their pixels, (H, W, 3).

    Returns
    -------
    light : dict of str to (H, W, 3) float32 array
        Scene-linear light by the part's name: a pass times its colour. The colours are
        added under `LightPart.colour_name`.
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
    """Return the pixels to write for AOVs and light passes: the inverse of `light_of`.

    Parameters
    ----------
    parts : sequence of LightPart
        The passes.
    light : mapping of str to (H, W, 3) float32 array
        Light of the parts, and the colours, by name.

    Returns
    -------
    passes : dict of tuple of str to (H, W, 3) float32 array
        Light divided by its colour, and the colours, by their three channel names.
    """
    passes: dict[tuple[str, ...], Array] = {}
    for part in parts:
        pixels = light[part.name]
        if part.colour:
            colour = passes[part.colour] = light[part.colour_name]
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                pixels = np.where(colour > 0.0, pixels / colour, np.float32(0.0))
        passes[part.channels] = pixels
    return passes


def passes_by_name(
    parts: Sequence[LightPart], light: Mapping[str, Array]
) -> dict[str, Array]:
    """Return what `passes_of` returns, by the names of the passes."""
    passes = passes_of(parts, light)
    return {channels[0].rpartition(".")[0]: x for channels, x in passes.items()}
