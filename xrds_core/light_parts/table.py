"""How renderers call the parts of their light."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from ..errors import UsageError

_SHIPPED = Path(__file__).with_name("renderers.toml")


@dataclass(frozen=True)
class Lobe:
    """A pass of light under one of its `names`; light is the pass times `colour`.

    That is the pass it was divided by, under one of its names; () where there is none.
    """

    names: tuple[str, ...]
    colour: tuple[str, ...] = ()


@dataclass(frozen=True)
class Renderer:
    """The passes of light of one renderer.

    `lobes` add up to the picture. So do `groups`, patterns in which * stands for
    anything; what is `alone` adds up to nothing.
    """

    name: str
    lobes: tuple[Lobe, ...] = ()
    groups: tuple[str, ...] = ()
    alone: tuple[str, ...] = ()


def read_renderers(path: Path | None = None) -> tuple[Renderer, ...]:
    """Return the renderers of a TOML file, before the known ones.

    `renderers.toml` beside this module shows its form. Raises UsageError, with what is
    wrong and where, for a file that has another.
    """
    return (_read(path) if path is not None else ()) + _shipped()


@cache
def _shipped() -> tuple[Renderer, ...]:
    return _read(_SHIPPED)


def _read(path: Path) -> tuple[Renderer, ...]:
    try:
        found = tomllib.loads(path.read_text("utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise UsageError(f"cannot read the passes in {path}: {error}") from error
    return tuple(_renderer(path, name, each) for name, each in found.items())


def _renderer(path: Path, name: str, given: Any) -> Renderer:
    where = f"{path}: [{name}]"
    _check_keys(where, given, {"lobes", "groups", "alone"})
    lobes = given.get("lobes", [])
    if not isinstance(lobes, list):
        raise UsageError(f"{where} lobes: give a list of tables")
    return Renderer(
        name,
        tuple(_lobe(where, each) for each in lobes),
        _texts(f"{where} groups", given.get("groups", [])),
        _texts(f"{where} alone", given.get("alone", [])),
    )


def _lobe(where: str, given: Any) -> Lobe:
    _check_keys(f"{where} lobes", given, {"names", "colour"})
    names = _texts(f"{where} lobes: names", given.get("names", []))
    if not names:
        raise UsageError(f"{where} lobes: a lobe without names")
    return Lobe(names, _texts(f"{where} lobes: colour", given.get("colour", [])))


def _check_keys(where: str, given: Any, known: set[str]) -> None:
    if not isinstance(given, dict):
        raise UsageError(f"{where} is no table")
    if unknown := sorted(given.keys() - known):
        raise UsageError(
            f"{where} has {unknown[0]!r}, which is not among {', '.join(sorted(known))}"
        )


def _texts(where: str, given: Any) -> tuple[str, ...]:
    texts = isinstance(given, list) and all(isinstance(x, str) and x for x in given)
    if not texts:
        raise UsageError(f"{where}: give a list of names")
    return tuple(given)
