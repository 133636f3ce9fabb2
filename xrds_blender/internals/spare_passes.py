"""Passes that Cycles is to render though nobody asked for them, or is not to see.

Cycles renders the passes that it finds in the render result, and Blender writes all of
the result into multilayer files. Python can add a pass, but not remove it. So a spare
pass is hooked out of its list and into that of a result of one pixel, which Blender has
made for the engine and then frees with all that is in it; and a pass that Cycles is not
to see is out of its list meanwhile.

Blender's lists are two pointers, to the first item and the last; each item begins with
two, to the next item and the previous one. Everything is compared with what Blender's
properties show before anything is written; where it differs the pass stays.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

_POINTER = ctypes.sizeof(ctypes.c_void_p)
_FIRST, _MOST = 64, 512  # bytes of a layer between which its list of passes begins


def add(engine: Any, layer_name: str, name: str, letters: str) -> None:
    """Add a pass to a layer of the result, unless the file has asked for it."""
    if name not in engine.get_result().layers[layer_name].passes:
        engine.add_pass(name, len(letters), letters, layer=layer_name)
        engine.spare_passes.add((layer_name, name))


def drop(engine: Any) -> None:
    """Take all that was added out of the result again."""
    for layer_name, name in sorted(engine.spare_passes):
        layer = engine.get_result().layers[layer_name]
        for view in _views(engine):
            if layer.passes.find_by_name(name, view) is not None:
                _drop(engine, layer, name, view)
    engine.spare_passes.clear()


@contextmanager
def aside(engine: Any, layer_name: str, name: str) -> Iterator[bool]:
    """Take a pass out of the result and put it back; whether there was one to take."""
    # Blender makes room for the pixels of all passes at once, as the first is begun.
    engine.end_result(engine.begin_result(0, 0, 1, 1))
    layer = engine.get_result().layers[layer_name]
    taken = []
    for view in _views(engine):
        pass_ = layer.passes.find_by_name(name, view)
        items = [item.as_pointer() for item in layer.passes]
        if pass_ is None or not _is_known(items):
            continue
        source, index = _list_of(layer, items), items.index(pass_.as_pointer())
        if source:
            _unhook(source, items, index)
            taken.append((source, items[index]))
    try:
        yield bool(taken)
    finally:
        for source, item in reversed(taken):
            _rehook(source, item)


def _drop(engine: Any, layer: Any, name: str, view: str) -> None:
    items = [item.as_pointer() for item in layer.passes]
    item = layer.passes.find_by_name(name, view).as_pointer()
    last = engine.begin_result(0, 0, 1, 1, layer=layer.name, view=view)
    try:
        layers = [each for each in last.layers if each.name == layer.name]
        if layers and _is_known(items):
            source, target = _list_of(layer, items), None
            others = [each.as_pointer() for each in layers[0].passes]
            if _is_known(others):
                target = _list_of(layers[0], others)
            if source and target:
                _unhook(source, items, items.index(item))
                _hook(target, others[-1], item)
    finally:
        engine.end_result(last, cancel=True, do_merge_results=False)


def _views(engine: Any) -> list[str]:
    return [view.name for view in engine.get_result().views] or [""]


def _is_known(items: list[int]) -> bool:
    """Whether pointers in the items lead from one to the next, and back."""
    around = [0, *items, 0]
    return len(items) > 1 and all(
        (_read(item), _read(item + _POINTER)) == (around[i + 2], around[i])
        for i, item in enumerate(items)
    )


def _list_of(layer: Any, items: list[int]) -> int | None:
    """Where in the layer the list of its passes lies."""
    base = layer.as_pointer()
    for at in range(base + _FIRST, base + _MOST, _POINTER):
        if (_read(at), _read(at + _POINTER)) == (items[0], items[-1]):
            return at
    return None


def _unhook(source: int, items: list[int], index: int) -> None:
    following = items[index + 1] if index + 1 < len(items) else 0
    before = items[index - 1] if index else 0
    _write(before if before else source, following)
    _write((following if following else source) + _POINTER, before)


def _rehook(source: int, item: int) -> None:
    """Put an item back between those that it still names."""
    following, before = _read(item), _read(item + _POINTER)
    _write(before if before else source, item)
    _write((following if following else source) + _POINTER, item)


def _hook(target: int, last: int, item: int) -> None:
    """Append an item; `last` is the last one of the list so far."""
    _write(item, 0)
    _write(item + _POINTER, last)
    _write(last, item)
    _write(target + _POINTER, item)


def _read(address: int) -> int:
    return ctypes.c_void_p.from_address(address).value or 0


def _write(address: int, value: int) -> None:
    ctypes.c_void_p.from_address(address).value = value
