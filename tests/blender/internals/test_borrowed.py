"""Settings set from a render's thread while the window is drawn."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from xrds_blender.internals.borrowed import Borrowed


class XRDS_OT_draws(bpy.types.Operator):  # noqa: N801  # as Blender names them
    """Asked whether it can run, it lets nobody write, as a panel that is drawn."""

    bl_idname = "xrds.draws"
    bl_label = "Draws"
    while_drawing: Callable[[], object]

    @classmethod
    def poll(cls, context: Any) -> bool:
        cls.while_drawing()
        return True


@pytest.fixture
def drawing() -> Iterator[Callable[[Callable[[], object]], None]]:
    """Does something while Blender lets Python write nothing."""

    def draw(work: Callable[[], object]) -> None:
        XRDS_OT_draws.while_drawing = staticmethod(work)
        bpy.ops.xrds.draws.poll()

    bpy.utils.register_class(XRDS_OT_draws)
    yield draw
    bpy.utils.unregister_class(XRDS_OT_draws)


def test_a_render_waits_until_the_window_is_drawn(
    life: Any, drawing: Callable[[Callable[[], object]], None]
) -> None:
    """Both ways: settings are set, and given back. In 4.3 drawing stops all threads."""
    seen: list[object] = []
    before = life.cycles.seed

    def borrow() -> None:
        try:
            with Borrowed() as borrowed:
                borrowed.set(life.cycles, seed=before + 1)
                seen.append(life.cycles.seed)
        except BaseException as error:
            seen.append(error)

    def draw() -> None:
        thread.start()
        time.sleep(0.2)

    thread = threading.Thread(target=borrow)
    drawing(draw)
    thread.join(10)
    assert seen == [before + 1]
    assert life.cycles.seed == before


def test_what_draws_does_not_wait_for_itself(
    life: Any, drawing: Callable[[Callable[[], object]], None]
) -> None:
    def draw() -> None:
        with pytest.raises(AttributeError, match="not allowed"), Borrowed() as borrowed:
            borrowed.set(life.cycles, seed=life.cycles.seed + 1)

    drawing(draw)
