"""Denoise Rendered Frames: a sequence of EXR files, as `xrds denoise` does it.

The work runs in a thread of its own, which knows no Blender; a modal operator shows how
far it is.
"""

from __future__ import annotations

import threading
import time
import traceback
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy
from bpy.props import CollectionProperty, EnumProperty, IntProperty, StringProperty

from xrds_core.errors import Cancelled, PictureError, UsageError, XRDSError, finished
from xrds_core.frames import MOST_RADIUS, RADIUS, find_sequences, in_words
from xrds_core.progress import duration

from ..internals.lifetimes import PROCESS
from ..planning.request import Machine
from .panel.paragraph import translated
from .preference_values import preference_values
from .properties import DENOISE
from .translations import CONTEXT

_LOOKS = 0.2  # seconds between looks at the work
_FOLDER = "denoised"


@dataclass
class Work:
    """A sequence that is being denoised; `run` may be called in any thread.

    `part` of it is done. Once it `is_over` there is a `result` or an `error`; while it
    runs it ends soon after `is_stopped` was set.
    """

    source: str
    output: str
    frames: list[int] | None
    radius: int
    quality: str
    machine: Machine
    cameras: Path | None = None
    part: float = 0.0
    is_stopped: bool = False
    is_over: bool = False
    result: dict[str, Any] | None = None
    error: str = ""
    began: float = field(default_factory=time.perf_counter)

    def run(self) -> None:
        """Denoise; frames that are there already, of the same inputs, are left."""
        finished.clear()
        try:
            self.result = self._denoise()
        except Cancelled:
            self.is_stopped = True
        except XRDSError as error:
            self.error = str(error)
        except Exception as error:  # nobody else would see it
            traceback.print_exc()
            self.error = f"XRDS failed: {type(error).__name__}: {error}"
        self.is_over = True

    def _denoise(self) -> dict[str, Any]:
        from xrds_core.denoising import Denoiser
        from xrds_core.shot_files.cameras import read_cameras
        from xrds_core.shot_files.frame_file import Reading
        from xrds_core.shot_files.sequence import Files, denoise_sequence

        here = self.machine
        device = "cpu" if here.device == "cpu" else "auto"
        denoiser = Denoiser(
            self.quality,
            device,
            threads=here.threads or 0,
            memory_limit=here.memory_limit,
        )
        cameras = None if self.cameras is None else read_cameras(self.cameras)
        others = () if self.cameras is None else (self.cameras,)
        return denoise_sequence(
            Files(self.source, self.output, others=others),
            denoiser,
            frames=self.frames,
            radius=self.radius,
            reading=Reading(cameras=cameras),
            resume=True,
            progress=self._note,
        )

    def _note(self, part: float) -> bool:
        self.part = part
        return not self.is_stopped

    @property
    def seconds(self) -> float:
        """Since it began."""
        return time.perf_counter() - self.began

    def status(self) -> str:
        """How far it is, and how long it will take."""
        if self.is_stopped:
            return translated("XRDS stops after what it is doing")
        percent = round(100 * self.part)
        if self.part < 0.01:
            return translated("XRDS denoises frames. Esc stops")
        left = duration(self.seconds * (1 - self.part) / self.part)
        text = "XRDS denoises frames: {percent} %, about {left} left. Esc stops"
        return translated(text, percent=percent, left=left)

    def outcome(self) -> tuple[str, str]:
        """What to report at the end, and how grave it is."""
        if self.error:
            return "ERROR", self.error
        folder, spent = Path(self.output).parent, duration(self.seconds)
        if self.result is None:
            text = "XRDS was stopped; frames denoised into {folder} in {time}: {count}"
            return "INFO", translated(
                text, count=len(finished), folder=folder, time=spent
            )
        done, kept = (self.result[name] for name in ("frames", "kept"))
        text = "XRDS: frames denoised into {folder} in {time}: {count}"
        line = translated(text, count=len(done), folder=folder, time=spent)
        if kept:
            line += translated("; there already: {count}", count=len(kept))
        missing = self.result["left_out"]
        if not missing:
            return "INFO", line
        numbers = in_words([each["frame"] for each in missing])
        text = "; could not be read: {numbers} ({reason})"
        reason = missing[0]["reason"]
        return "WARNING", line + translated(text, numbers=numbers, reason=reason)


@dataclass
class _Current:
    """The work that goes on, or was the last."""

    work: Work | None = None

    @property
    def goes_on(self) -> bool:
        return self.work is not None and not self.work.is_over


def chosen_frames(folder: Path, names: list[str]) -> tuple[str, list[int] | None]:
    """The pattern of the files that were chosen, and their numbers.

    All EXR files of the folder without any `names`; the numbers are None for all.
    Raises XRDSError where there is not one sequence.
    """
    there = names
    if not names:
        if not folder.is_dir():
            raise PictureError(f"no folder {folder}; choose the frames' folder")
        there = [x.name for x in folder.iterdir() if x.suffix.lower() == ".exr"]
    others = [name for name in there if Path(name).suffix.lower() != ".exr"]
    if others:
        raise UsageError(f"{others[0]} is no .exr file; choose the frames of one shot")
    if not there:
        raise PictureError(f"no .exr file in {folder}; choose a folder with frames")
    found = find_sequences(there)
    if len(found) > 1:
        several = ", ".join(sorted(found)[:3])
        raise UsageError(f"{several} in {folder} are several shots; choose one's files")
    ((pattern, numbers),) = found.items()
    return str(folder / pattern), (numbers or None) if names else None


class XRDS_OT_denoise_files(bpy.types.Operator):
    """Denoise frames that lie in EXR files, each with the samples of its neighbours. Choose a folder, or files of one shot. Frames that are there already are skipped"""  # noqa: E501  # Blender's tooltip

    bl_idname = "xrds.denoise_files"
    bl_label = "Denoise Rendered Frames"

    directory: StringProperty(subtype="DIR_PATH", options={"HIDDEN", "SKIP_SAVE"})
    files: CollectionProperty(
        type=bpy.types.OperatorFileListElement, options={"HIDDEN", "SKIP_SAVE"}
    )
    filter_glob: StringProperty(default="*.exr", options={"HIDDEN"})
    output: StringProperty(
        name="Output",
        translation_context=CONTEXT,
        subtype="DIR_PATH",
        description="Folder of the denoised frames. Without one they go into the "
        "folder denoised beside the files",
    )
    temporal_radius: IntProperty(
        name="Frames Before and After",
        translation_context=CONTEXT,
        default=RADIUS,
        min=0,
        max=MOST_RADIUS,
        description="Neighbour frames on each side whose samples are reused",
    )
    denoise: EnumProperty(
        name="Denoising", translation_context=CONTEXT, items=DENOISE, default="high"
    )
    cameras: StringProperty(
        name="Cameras",
        translation_context=CONTEXT,
        subtype="FILE_PATH",
        description="What xrds cameras wrote, for files that do not hold their "
        "cameras: without one such frames are denoised one by one",
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return not PROCESS.of(_Current).goes_on

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            work = self._work()
        except XRDSError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        PROCESS.of(_Current).work = work
        if bpy.app.background:
            work.run()
            return _report(self, work)
        threading.Thread(target=work.run, daemon=True).start()
        bpy.ops.xrds.watch_denoising("INVOKE_DEFAULT")
        return {"FINISHED"}

    def _work(self) -> Work:
        folder = Path(bpy.path.abspath(self.directory))
        names = [each.name for each in self.files if each.name]
        source, frames = chosen_frames(folder, names)
        output = folder / _FOLDER
        if self.output:
            output = Path(bpy.path.abspath(self.output))
        here = preference_values()
        return Work(
            source,
            str(output / Path(source).name),
            frames,
            self.temporal_radius,
            self.denoise,
            Machine(here.device, here.memory_limit, here.threads),
            Path(bpy.path.abspath(self.cameras)) if self.cameras else None,
        )


class XRDS_OT_watch_denoising(bpy.types.Operator):
    """Show how far the frames are"""

    bl_idname = "xrds.watch_denoising"
    bl_label = "Denoising"
    bl_options = {"INTERNAL"}

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        manager = context.window_manager
        self._timer = manager.event_timer_add(_LOOKS, window=context.window)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        work = PROCESS.of(_Current).work
        assert work is not None
        if event.type == "ESC" and event.value == "PRESS":
            work.is_stopped = True
        if not work.is_over:
            if event.type in {"TIMER", "ESC"}:
                context.workspace.status_text_set(work.status())
            return {"PASS_THROUGH"}
        context.window_manager.event_timer_remove(self._timer)
        context.workspace.status_text_set(None)
        return _report(self, work)

    def cancel(self, context: bpy.types.Context) -> None:
        work = PROCESS.of(_Current).work
        assert work is not None
        work.is_stopped = True


def _report(operator: bpy.types.Operator, work: Work) -> set[str]:
    kind, line = work.outcome()
    operator.report({kind}, line)
    return {"CANCELLED" if kind == "ERROR" else "FINISHED"}


def draw_entry(self: Any, context: bpy.types.Context) -> None:
    """Draw the entry of the Render menu."""
    self.layout.operator(
        XRDS_OT_denoise_files.bl_idname,
        text=translated("Denoise Rendered Frames…"),
        icon="FILE_FOLDER",
        translate=False,
    )


CLASSES = XRDS_OT_denoise_files, XRDS_OT_watch_denoising


def register() -> None:
    """Register the operators and the menu entry."""
    for kind in CLASSES:
        bpy.utils.register_class(kind)
    bpy.types.TOPBAR_MT_render.append(draw_entry)


def unregister() -> None:
    """Take them back; what goes on is stopped."""
    current = PROCESS.of(_Current)
    if current.work is not None:
        current.work.is_stopped = True
    bpy.types.TOPBAR_MT_render.remove(draw_entry)
    for kind in reversed(CLASSES):
        bpy.utils.unregister_class(kind)
