"""Settings borrowed for the time of one render and given back whatever happens.

Nothing here touches the user's scene: what is set belongs to the evaluated scene or
to the render pipeline's own copy of the render settings.
"""

from __future__ import annotations

import ctypes
import threading
import time
from collections.abc import Callable
from typing import Any

from xrds_core.errors import SceneError

_WHILE_DRAWING = "Writing to ID classes in this context is not allowed"
_LONGEST_DRAWING = 60.0  # seconds


class Borrowed:
    """Attributes set on Blender's structs; the old values return on exit.

    A render may evaluate other frames, as for vectors and motion blur: an evaluated
    data-block stays then, but what it holds is made anew. So structs inside of one are
    looked up again before they are touched.
    """

    def __init__(self) -> None:
        self._old: list[tuple[Callable[[], Any], str, Any]] = []

    def __enter__(self) -> Borrowed:
        return self

    def __exit__(self, *_: object) -> None:
        self.give_back()

    def set(self, owner: Any, **values: Any) -> None:
        """Set attributes of `owner`; those this Blender does not have are skipped."""
        again = _finder(owner)
        for name, value in values.items():
            if not hasattr(owner, name):
                continue
            old = getattr(owner, name)
            if old != value:
                self._old.append((again, name, old))
                write(owner, name, value)

    def give_back(self) -> None:
        while self._old:
            again, name, value = self._old.pop()
            write(again(), name, value)

    def forget(self) -> None:
        """Give nothing back: the owners are gone, and touching them would crash."""
        self._old.clear()


def write(owner: Any, name: str, value: Any) -> None:
    """Set an attribute, as soon as Blender lets a render's thread do so.

    While Python draws a part of the window, Blender lets no thread write.
    """
    end = time.monotonic() + _LONGEST_DRAWING
    while True:
        try:
            setattr(owner, name, value)
            return
        except AttributeError as error:
            is_drawing = _WHILE_DRAWING in str(error)
            draws_itself = threading.current_thread() is threading.main_thread()
            if not is_drawing or draws_itself or time.monotonic() > end:
                raise
        time.sleep(0.001)  # lets the main thread go on


def _finder(owner: Any) -> Callable[[], Any]:
    """What finds `owner` again in its data-block; itself where it is in none."""
    block = getattr(owner, "id_data", None)
    if block is None or block == owner:
        return lambda: owner
    for layer in getattr(block, "view_layers", ()):
        if layer.cycles == owner:  # Blender knows no path to these
            name = layer.name
            return lambda: block.view_layers[name].cycles
    path = owner.path_from_id()
    return lambda: block.path_resolve(path)


class PipelineSettings:
    """The numbers of the running render that Python may not set, set in place.

    `RenderEngine.render` is the pipeline's own copy of the render settings, which
    Cycles reads. Some of its properties have update call-backs that crash on such a
    copy, so their bytes are written. Where they lie is learnt from the evaluated
    scene's settings, the same struct: toggle, compare, put back. Every write is read
    back through Blender; anything unexpected is a SceneError and nothing is rendered.
    """

    NAMES = ("use_persistent_data", "resolution_x", "resolution_y")
    _SPAN = 2048  # bytes of the struct that are compared; the three lie well inside
    _places: dict[str, tuple[int, int]] | None = None

    def __init__(self, render: Any, evaluated: Any) -> None:
        if PipelineSettings._places is None:
            PipelineSettings._places = self._learn(evaluated.render)
        self._render = render
        self._old: list[tuple[str, int | bool]] = []
        for name in self.NAMES:
            if self._peek(name) != getattr(render, name):
                raise _unknown_layout(name)

    def set(self, **values: int | bool) -> None:
        for name, value in values.items():
            old = getattr(self._render, name)
            if old != value:
                self._old.append((name, old))
                self._poke(name, value)

    def give_back(self, keep: int = 0) -> None:
        """Undo all but the first `keep` settings, the last one first."""
        while len(self._old) > keep:
            self._poke(*self._old.pop())

    @property
    def depth(self) -> int:
        """How many settings are set now, for `give_back(keep=...)`."""
        return len(self._old)

    @classmethod
    def _learn(cls, render: Any) -> dict[str, tuple[int, int]]:
        return {name: cls._find(render, name) for name in cls.NAMES}

    @classmethod
    def _find(cls, render: Any, name: str) -> tuple[int, int]:
        """Byte offset and bit mask (0 for a 32-bit number) of one property."""
        base, old = render.as_pointer(), getattr(render, name)
        is_flag = isinstance(old, bool)
        before = ctypes.string_at(base, cls._SPAN)
        try:
            write(render, name, (not old) if is_flag else old ^ 0x0155)
            other = getattr(render, name)
            after = ctypes.string_at(base, cls._SPAN)
        finally:
            write(render, name, old)
        changed = [i for i in range(cls._SPAN) if before[i] != after[i]]
        if is_flag and len(changed) == 1:
            mask = before[changed[0]] ^ after[changed[0]]
            if mask.bit_count() == 1 and bool(after[changed[0]] & mask) is other:
                return changed[0], mask
        elif not is_flag and changed and changed[-1] - changed[0] < 4:
            at = changed[0]
            if before[at : at + 4] == old.to_bytes(4, "little"):
                return at, 0
        raise _unknown_layout(name)

    def _place(self, name: str) -> tuple[int, int]:
        assert PipelineSettings._places is not None
        offset, mask = PipelineSettings._places[name]
        return self._render.as_pointer() + offset, mask

    def _peek(self, name: str) -> int | bool:
        address, mask = self._place(name)
        if mask:
            return bool(ctypes.c_ubyte.from_address(address).value & mask)
        return ctypes.c_int32.from_address(address).value

    def _poke(self, name: str, value: int | bool) -> None:
        address, mask = self._place(name)
        if mask:
            flags = ctypes.c_ubyte.from_address(address)
            flags.value = (flags.value | mask) if value else (flags.value & ~mask)
        else:
            ctypes.c_int32.from_address(address).value = value
        if getattr(self._render, name) != value:
            raise _unknown_layout(name)


def _unknown_layout(name: str) -> SceneError:
    import bpy

    return SceneError(
        f"Blender {bpy.app.version_string} stores the render setting {name!r} in a way "
        "that XRDS does not know; render with Cycles or use a supported Blender"
    )
