"""A .blend file, opened to be rendered."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from xrds_core.errors import SceneError, UsageError, warn
from xrds_core.files import check_input
from xrds_core.frames import in_words

from ..scene.contents import frame_range


@dataclass(frozen=True)
class SceneChoice:
    """What comes in the place of what a file was saved with; None leaves it.

    `scene`, `view_layer` and `camera` are names; `resolution` is width and height in
    pixels; `threads` are Cycles'. With a `noise_threshold` pixels take `samples` at
    most. `trusted` lets drivers and scripts of the file run.
    """

    scene: str | None = None
    view_layer: str | None = None
    camera: str | None = None
    resolution: tuple[int, int] | None = None
    threads: int | None = None
    noise_threshold: float | None = None
    samples: int | None = None
    trusted: bool = False


AS_SAVED = SceneChoice()


def open_scene(path: Path, choice: SceneChoice = AS_SAVED) -> Any:
    """Open a .blend file and return its scene, ready to render.

    Whatever Blender has open is replaced. Python in a file that is not trusted is left
    alone, which a line on stderr reports.

    Raises SceneError if there is no such file, Blender cannot read it, it has nothing
    of a chosen name, or no camera.
    """
    import bpy

    check_input(path, SceneError)
    try:
        bpy.ops.wm.open_mainfile(
            filepath=str(path.resolve()), load_ui=False, use_scripts=choice.trusted
        )
    except RuntimeError as error:
        reason = " ".join(str(error).removeprefix("Error:").split())
        raise SceneError(f"Blender cannot open {path}: {reason}") from error
    scene = bpy.context.scene
    if choice.scene is not None:
        scene = _find_named("scene", choice.scene, bpy.data.scenes, path)
    _apply(choice, scene, path)
    _check_cameras(scene, path)
    _report_what_did_not_run(scene, path)
    return scene


def _check_cameras(scene: Any, path: Path) -> None:
    """Raise SceneError where a frame would have no camera to be seen by."""
    if scene.camera is None:
        scene.frame_set(scene.frame_current)  # markers may bind one
    if scene.camera is None:
        raise SceneError(f"{path} has no camera in scene {scene.name!r}; add one")
    bound = [marker.camera for marker in scene.timeline_markers if marker.camera]
    for camera in (scene.camera, *bound):
        if camera.type != "CAMERA":
            raise SceneError(
                f"{path} has {camera.name!r}, which is no camera, as the camera of "
                f"scene {scene.name!r}; choose one, or give --camera"
            )


def frames_of(
    scene: Any, frames: Sequence[int] | None, animation: bool
) -> list[int] | None:
    """The frames that were asked for; None for the file's current one.

    Raises UsageError where `animation`, the file's range, are others than `frames`.
    """
    whole_range = list(frame_range(scene))
    if animation and frames and list(frames) != whole_range:
        raise UsageError(
            f"-a are frames {in_words(whole_range)} of the file, but other frames are "
            "asked for as well; give one of them"
        )
    return whole_range if animation else list(frames or ()) or None


def _apply(choice: SceneChoice, scene: Any, path: Path) -> None:
    if choice.view_layer is not None:
        wanted = _find_named("view layer", choice.view_layer, scene.view_layers, path)
        for layer in scene.view_layers:
            layer.use = layer == wanted
    if choice.camera is not None:
        cameras = {item.name: item for item in scene.objects if item.type == "CAMERA"}
        scene.camera = _find_named("camera", choice.camera, cameras, path)
        for marker in scene.timeline_markers:  # they would switch back
            marker.camera = None
    if choice.resolution:
        scene.render.resolution_x, scene.render.resolution_y = choice.resolution
        scene.render.resolution_percentage = 100
    if choice.noise_threshold is not None:
        cycles = scene.cycles
        cycles.use_adaptive_sampling = True
        cycles.adaptive_threshold = choice.noise_threshold
        cycles.samples = choice.samples or cycles.samples
    if choice.threads is not None:
        scene.render.threads_mode, scene.render.threads = "FIXED", choice.threads


def _find_named(kind: str, name: str, known: Any, path: Path) -> Any:
    """The entry of that name; raises SceneError, with the names that there are."""
    if name not in known:
        names = ", ".join(known.keys()) or "none"
        raise SceneError(f"{path} has no {kind} {name!r}; there are: {names}")
    return known[name]


def _report_what_did_not_run(scene: Any, path: Path) -> None:
    """Say on stderr which Python of the file Blender did not run, if any."""
    import bpy

    scene.view_layers[0].update()  # looks at drivers
    if bpy.app.autoexec_fail:
        warn(
            f"{path} holds Python that was not run ({bpy.app.autoexec_fail_message}); "
            "if you trust the file, give --enable-autoexec"
        )
