"""Work inside of Blender's render: what Blender asks for, or what a caller asks for."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from xrds_core.errors import Cancelled, SceneError, XRDSError

from ..cycles import live
from ..cycles.passes import CyclesPasses
from ..internals import engine_override, spare_passes
from ..internals.borrowed import Borrowed
from ..internals.lifetimes import PROCESS

T = TypeVar("T")
_START = 5.0  # seconds in which Blender starts a render


@dataclass
class _Task:
    """Work that waits for Blender to call the engine, and how it ended."""

    work: Callable[[Any, Any], Any]
    has_begun: bool = False
    results: list[Any] = field(default_factory=list)
    error: BaseException | None = None


@dataclass
class _Waiting:
    """The work that Blender's next call of the engine is for, if there is any."""

    task: _Task | None = None


def run_job(
    scene: Any, job: Callable[[CyclesPasses], T], *, layer: str | None = None
) -> T:
    """As `xrds_blender.run_job`; the engine must be registered."""

    def work(engine: Any, depsgraph: Any) -> T:
        with CyclesPasses(engine, depsgraph, noisy=True, depth=True) as passes:
            return job(passes)

    return call_engine(scene, work, layer)


def render_in(engine: Any, depsgraph: Any, requested: Callable[[], object]) -> None:
    """Do the work that waits for the engine, or what Blender requests: `requested`.

    The result then has no passes but those that the file asks for.
    """
    live.clear()
    try:
        _work_in(engine, depsgraph, requested)
    finally:
        spare_passes.drop(engine)


def _work_in(engine: Any, depsgraph: Any, requested: Callable[[], object]) -> None:
    task = PROCESS.of(_Waiting).task
    if task is not None:
        task.has_begun = True
        try:
            task.results.append(task.work(engine, depsgraph))
        except BaseException as error:  # Blender would print it; the caller gets it
            task.error = error
        return
    try:
        requested()
    except Cancelled:
        return  # it was Blender that cancelled
    except XRDSError as error:
        _fail(engine, str(error))
    except Exception as error:  # Blender calls: show it beside the black picture
        traceback.print_exc()
        _fail(engine, f"XRDS failed: {type(error).__name__}: {error}")


def _fail(engine: Any, message: str) -> None:
    """One line in Blender's log and reports; nothing is saved then."""
    engine.report({"ERROR"}, message)


def call_engine(
    scene: Any, work: Callable[[Any, Any], T], layer: str | None = None
) -> T:
    """Let Blender render one layer of `scene` with `work` as the engine's.

    `work` takes the engine and the dependency graph; what it returns is returned, what
    it raises is raised. Raises SceneError where Blender does not render.
    """
    job = Job(scene, work, layer)
    try:
        job.begin("EXEC_DEFAULT")
    finally:
        job.end()
    return job.result()


class Job(Generic[T]):
    """A render of one layer of `scene` with `work` as the engine's.

    Begun with INVOKE_DEFAULT it goes on beside the window, as F12's does, with
    Blender's progress bar and Esc. All of it is for the main thread. Raises SceneError,
    when it is made, where it cannot be.
    """

    def __init__(
        self, scene: Any, work: Callable[[Any, Any], T], layer: str | None = None
    ) -> None:
        import bpy

        if PROCESS.of(_Waiting).task is not None:
            raise SceneError("a render is already running; wait until it has finished")
        if not hasattr(bpy.types.Scene, "xrds"):
            raise SceneError(
                "the engine is not registered; call xrds_blender.register()"
            )
        self._scene, self._layer = scene, _layer_name(scene, layer)
        self._task, self._borrowed = _Task(work), Borrowed()
        self._waits_until = 0.0

    def begin(self, how: str) -> None:
        """Begin, and without a window render to the end."""
        import bpy

        PROCESS.of(_Waiting).task = self._task
        name, task = self._scene.name, self._task
        try:
            self._borrowed.set(
                self._scene.render, use_compositing=False, use_sequencer=False
            )
            engine_override.begin(self._scene)
            done = bpy.ops.render.render(how, scene=name, layer=self._layer)
            self._waits_until = time.monotonic() + _START * ("RUNNING_MODAL" in done)
        except XRDSError as error:
            task.error = error
        except RuntimeError as error:
            # Blender says the same once for each report
            lines = [x.removeprefix("Error:").strip() for x in str(error).splitlines()]
            message = "; ".join(dict.fromkeys(filter(None, lines)))
            task.error = task.error or SceneError(message)

    def is_running(self) -> bool:
        """Whether Blender still renders; to be asked again and again."""
        import bpy

        if self._task.has_begun:  # and looks at its own copy of the settings
            self._borrowed.give_back()
        if bpy.app.is_job_running("RENDER"):
            return True
        # what was begun beside the window starts a little later
        return not self._task.has_begun and time.monotonic() < self._waits_until

    def end(self) -> None:
        """Put all back as it was before."""
        self._borrowed.give_back()
        PROCESS.of(_Waiting).task = None
        engine_override.withdraw()

    def result(self) -> T:
        """What `work` has returned; what it has raised is raised."""
        task = self._task
        if task.error is not None:
            raise task.error
        if not task.results:
            name = self._scene.name
            raise XRDSError(f"scene {name!r} was not rendered; see Blender's console")
        return task.results[0]


def _layer_name(scene: Any, wanted: str | None) -> str:
    if scene.camera is None:
        raise SceneError(f"scene {scene.name!r} has no camera; add one")
    names = [layer.name for layer in scene.view_layers if layer.use]
    if wanted is not None and wanted not in scene.view_layers:
        known = ", ".join(layer.name for layer in scene.view_layers)
        raise SceneError(
            f"scene {scene.name!r} has no view layer {wanted!r}; it has {known}"
        )
    if wanted is None and not names:
        raise SceneError(f"scene {scene.name!r} uses no view layer; switch one on")
    return wanted or names[0]
