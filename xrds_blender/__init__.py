"""The Blender add-on: the XRDS render engine and its commands.

Importing it needs neither Blender nor torch; `register()` and `render()` need Blender.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from .cycles.passes import CyclesPasses
    from .rendering.picture import Picture

__all__ = ["register", "render", "run_job", "unregister"]

T = TypeVar("T")


def register(package: str = __name__) -> None:
    """Make Blender know the engine, its settings, its panels and its command.

    `package` is the add-on's module name, under which Blender keeps its preferences.
    """
    from .command import blender_command
    from .interface import registration

    registration.register(package)
    blender_command.register()


def unregister() -> None:
    """Take back everything that `register` did."""
    from .command import blender_command
    from .interface import registration

    blender_command.unregister()
    registration.unregister()


def render(scene: Any, scale: int = 1, **choices: Any) -> Picture:
    """Render the current frame of `scene` and return its picture.

    It is rendered at full size, or at 1 / `scale` of it (2, 4, 8) and enlarged.
    `choices` are `layer`, the name of a view layer (the first that is used by default),
    and the others of `xrds_blender.planning.request.render_request`. The scene's own
    `xrds` settings and its compositor play no part, and everything in it is as before
    afterwards.

    Raises SceneError without a camera, WeightsError without the weights, UsageError
    for values out of range, Cancelled when the user stops the render.
    """
    from .interface.registration import ensure_registered
    from .rendering import render

    ensure_registered()
    return render.render(scene, scale, **choices)


def run_job(
    scene: Any, job: Callable[[CyclesPasses], T], *, layer: str | None = None
) -> T:
    """Call `job` inside a render of `scene` and return what it returns.

    `job` may render Cycles' passes by hand. One frame and one view layer (`layer`, the
    first that is used by default), without compositor and sequencer. What the job
    raises reaches the caller; engine and settings are then as before. Raises SceneError
    without a camera.
    """
    from .interface.registration import ensure_registered
    from .rendering import blender_job

    ensure_registered()
    return blender_job.run_job(scene, job, layer=layer)
