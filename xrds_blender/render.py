"""The one path from a scene to a picture; every button and command ends here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

from xrds_core.errors import SceneError, XRDSError

from .passes import CyclesPasses

T = TypeVar("T")


@dataclass
class _Running:
    """A job that waits for Blender to call the engine, and how it ended."""

    job: Callable[[CyclesPasses], Any]
    done: bool = False
    result: Any = None
    error: BaseException | None = None


_running: _Running | None = None


def render_layer(engine: Any, depsgraph: Any) -> None:
    """Render one view layer of one frame into the engine's result."""
    if _running is not None:
        _run_in(_running, engine, depsgraph)


def _run_in(running: _Running, engine: Any, depsgraph: Any) -> None:
    try:
        with CyclesPasses(engine, depsgraph, extra=True) as passes:
            running.result = running.job(passes)
            running.done = True
    except BaseException as error:  # Blender would only print it; the caller gets it
        running.error = error


def run_job(
    scene: Any,
    job: Callable[[CyclesPasses], T],
    *,
    layer: str | None = None,
    write: bool = False,
) -> T:
    """Call `job` inside a render of `scene` and return what it returns.

    One frame and one view layer (`layer`, else the first that is used), without
    compositor and sequencer. What the job raises reaches the caller; engine and
    settings are then as before. Raises SceneError without a camera.
    """
    import bpy

    from . import ensure_registered
    from .borrowed import Borrowed

    global _running
    ensure_registered()
    if scene.camera is None:
        raise SceneError(
            f"scene {scene.name!r} has no camera; add one and render again"
        )
    if _running is not None:
        raise SceneError("a render is running already; wait for its end")
    name = layer or next((v.name for v in scene.view_layers if v.use), None)
    if name is None:
        raise SceneError(f"scene {scene.name!r} has no view layer in use")
    running = _running = _Running(job)
    try:
        with Borrowed() as borrowed:
            borrowed.set(
                scene.render,
                engine="XRDS",
                use_compositing=False,
                use_sequencer=False,
            )
            bpy.ops.render.render(scene=scene.name, layer=name, write_still=write)
    except RuntimeError as error:
        running.error = running.error or SceneError(str(error).strip())
    finally:
        _running = None
    if running.error is not None:
        raise running.error
    if not running.done:
        raise XRDSError(f"scene {scene.name!r} was not rendered; see Blender's log")
    return running.result  # type: ignore[no-any-return]
