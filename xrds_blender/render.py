"""The one path from a scene to a picture; every button and command ends here."""

from __future__ import annotations

import sys
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any, TypeVar

from xrds_core.errors import Cancelled, SceneError, XRDSError

from .job import Picture, RenderJob
from .layer import render_layer
from .passes import CyclesPasses

__all__ = ["Picture", "RenderJob", "render", "run_job"]

T = TypeVar("T")


@dataclass
class _Task:
    """Work that waits for Blender to call the engine, and how it ended."""

    work: Callable[[Any, Any], Any]
    results: list[Any] = field(default_factory=list)
    error: BaseException | None = None


_task: _Task | None = None


def render(
    scene: Any, scale: int = 2, *, layer: str | None = None, **choices: Any
) -> Picture:
    """Render the current frame of `scene` and return its picture.

    `choices` are the other fields of RenderJob; `layer` names the view layer, else it
    is the first that is used. The scene's own `xrds` settings play no part, its
    compositor neither, and everything in it is as before afterwards.

    Raises SceneError without a camera, WeightsError without the weights, UsageError
    for values out of range, Cancelled when the user stops the render.
    """
    job, start = RenderJob(scale=scale, **choices), time.perf_counter()

    def work(engine: Any, depsgraph: Any) -> Picture:
        return render_layer(engine, depsgraph, job, start)

    return _run(scene, work, layer)


def run_job(
    scene: Any, job: Callable[[CyclesPasses], T], *, layer: str | None = None
) -> T:
    """Call `job` inside a render of `scene` and return what it returns.

    One frame and one view layer (`layer`, else the first that is used), without
    compositor and sequencer. What the job raises reaches the caller; engine and
    settings are then as before. Raises SceneError without a camera.
    """

    def work(engine: Any, depsgraph: Any) -> T:
        with CyclesPasses(engine, depsgraph, noisy=True, depth=True) as passes:
            return job(passes)

    return _run(scene, work, layer)


def evaluate(scene: Any, look: Callable[[Any], T]) -> T:
    """Return what `look` finds in the dependency graph of a render of `scene`.

    Nothing is rendered. Raises SceneError without a camera.
    """
    return _run(scene, lambda _, depsgraph: look(depsgraph), None)


def render_in(engine: Any, depsgraph: Any) -> None:
    """Do what Blender asks of the engine, or the work that waits for it."""
    if _task is not None:
        try:
            _task.results.append(_task.work(engine, depsgraph))
        except BaseException as error:  # Blender would print it; the caller gets it
            _task.error = error
        return
    try:
        render_layer(engine, depsgraph, RenderJob.of(depsgraph.scene_eval.xrds))
    except Cancelled:
        return  # Blender knows: it is who told us
    except XRDSError as error:
        _fail(engine, str(error))
    except Exception as error:  # Blender calls: show it beside the black picture
        traceback.print_exc()
        _fail(engine, f"XRDS failed: {type(error).__name__}: {error}")


def _fail(engine: Any, message: str) -> None:
    """One line in Blender's log and reports; nothing is saved then."""
    engine.report({"ERROR"}, message)


def _run(scene: Any, work: Callable[[Any, Any], T], layer: str | None) -> T:
    """Let Blender render one layer of `scene` with `work` as the engine's."""
    import bpy

    from . import ensure_registered
    from .borrowed import Borrowed

    global _task
    ensure_registered()
    if _task is not None:
        raise SceneError("a render is running already; wait for its end")
    name = _layer_name(scene, layer)
    task = _task = _Task(work)
    try:
        with Borrowed() as borrowed:
            borrowed.set(
                scene.render, engine="XRDS", use_compositing=False, use_sequencer=False
            )
            bpy.ops.render.render(scene=scene.name, layer=name)
    except RuntimeError as error:
        message = str(error).removeprefix("Error: ").strip()
        task.error = task.error or SceneError(message)
    finally:
        _task = None
    if task.error is not None:
        raise task.error
    if not task.results:
        raise XRDSError(f"scene {scene.name!r} was not rendered; see Blender's log")
    return task.results[0]  # type: ignore[no-any-return]


def _layer_name(scene: Any, wanted: str | None) -> str:
    if scene.camera is None:
        raise SceneError(f"scene {scene.name!r} has no camera; add one")
    names = [layer.name for layer in scene.view_layers if layer.use]
    if wanted is not None and wanted not in scene.view_layers:
        known = ", ".join(layer.name for layer in scene.view_layers)
        raise SceneError(
            f"scene {scene.name!r} has no layer {wanted!r}; it has {known}"
        )
    if wanted is None and not names:
        raise SceneError(f"scene {scene.name!r} renders no view layer; switch one on")
    return wanted or names[0]


class _CallableModule(ModuleType):
    """`xrds_blender.render` is this module and the public function at once.

    Python sets the module as attribute of its package whatever else has that name.
    """

    def __call__(self, scene: Any, scale: int = 2, **choices: Any) -> Picture:
        return render(scene, scale, **choices)


sys.modules[__name__].__class__ = _CallableModule
