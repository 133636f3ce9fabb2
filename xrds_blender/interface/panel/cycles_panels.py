"""Cycles' own panels and menus, shown under XRDS too.

Most of them ask whether the engine is among those that they are made for. Some ask for
Cycles by name: its device, OSL and feature set, the lenses of panoramas, the steps of
volumes. These are called with a context in which the engine is Cycles.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import wraps
from typing import Any

import bpy

from ...internals.engine_override import ENGINE

CYCLES = "CYCLES"
_ROOTS = (bpy.types.Panel, bpy.types.Menu, bpy.types.Header)
# Ask the scene's settings for the engine, and show nothing else of the scene.
_BY_SCENE = {"DATA_PT_volume_render.draw", "CYCLES_RENDER_PT_subdivision.poll"}

_wrapped: list[tuple[Any, str, Any]] = []
"""A class, a name and what it held; a class, no name and a function added to its
drawing; or a list of drawing functions, no name and the first that it held."""


class _Posing:
    """Anything with some attributes of its own; the rest is that of the original."""

    def __init__(self, original: Any, **own: Any) -> None:
        self.__dict__.update(own, _original=original)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._original, name)


def as_cycles(context: Any, by_scene: bool = False) -> Any:
    """The context, with Cycles as its engine where it is XRDS."""
    if context.engine != ENGINE:
        return context
    own: dict[str, Any] = {"engine": CYCLES}
    if by_scene:
        render = _Posing(context.scene.render, engine=CYCLES)
        own["scene"] = _Posing(context.scene, render=render)
    return _Posing(context, **own)


def cycles_classes(base: Any = None) -> Iterator[Any]:
    """All registered panels and menus that name Cycles."""
    for item in _classes(base):
        if CYCLES in getattr(item, "COMPAT_ENGINES", ()):
            yield item


def _classes(base: Any = None) -> Iterator[Any]:
    for root in (base,) if base else _ROOTS:
        for item in root.__subclasses__():
            yield item
            yield from _classes(item)


def _asks_for_cycles(function: Any) -> bool:
    code = getattr(function, "__code__", None)
    return code is not None and "engine" in code.co_names and CYCLES in code.co_consts


def _posing(function: Callable[..., Any], by_scene: bool) -> Any:
    """The function, called with a posing context; Blender counts its arguments."""

    @wraps(function)
    def posing(owner: Any, context: Any) -> Any:
        return function(owner, as_cycles(context, by_scene))

    return posing


def _under_xrds(function: Callable[..., Any]) -> Any:
    """A drawing function beside the one that an add-on has added for Cycles."""

    def draw(owner: Any, context: Any) -> None:
        if context.engine == ENGINE:
            function(owner, as_cycles(context))

    return draw


def _replace(item: Any, name: str, function: Any, new: Any) -> None:
    _wrapped.append((item, name, function))
    setattr(item, name, new)


def _wrap_drawing(item: Any) -> None:
    own = item.__dict__.get("draw")
    by_scene = f"{item.__name__}.draw" in _BY_SCENE
    functions = getattr(own, "_draw_funcs", None)
    if functions is None:
        if _asks_for_cycles(own):
            _replace(item, "draw", own, _posing(own, by_scene))
        return
    for function in filter(_asks_for_cycles, list(functions)):
        if function is functions[0]:  # the class's own
            functions[0] = _posing(function, by_scene)
            _wrapped.append((functions, "", function))
        else:
            added = _under_xrds(function)
            item.append(added)
            _wrapped.append((item, "", added))


def _wrap_poll(item: Any) -> None:
    own = item.__dict__.get("poll")
    function: Any = getattr(own, "__func__", None)
    if _asks_for_cycles(function):
        by_scene = f"{item.__name__}.poll" in _BY_SCENE
        _replace(item, "poll", own, classmethod(_posing(function, by_scene)))


def register() -> None:
    """Show them under XRDS."""
    for item in list(_classes()):
        if CYCLES in getattr(item, "COMPAT_ENGINES", ()):
            item.COMPAT_ENGINES.add(ENGINE)
        _wrap_drawing(item)
        _wrap_poll(item)


def unregister() -> None:
    """Take that back."""
    while _wrapped:
        owner, name, function = _wrapped.pop()
        if isinstance(owner, list):
            owner[0] = function
        elif name:
            setattr(owner, name, function)
        else:
            owner.remove(function)
    for item in cycles_classes():
        item.COMPAT_ENGINES.discard(ENGINE)
