"""Denoise Rendered Frames: the operator, and what shows how far it is."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import pytest
from sequences import frame, picture, write

pytest.importorskip("mitsuba_oidn")

from xrds_blender.interface import denoise_files
from xrds_blender.interface.denoise_files import Work, XRDS_OT_watch_denoising
from xrds_blender.interface.registration import ensure_registered
from xrds_blender.internals.lifetimes import PROCESS
from xrds_blender.planning.request import Machine
from xrds_core.denoising import Denoiser
from xrds_core.shot_files.sequence import Files, denoise_sequence


@pytest.fixture(autouse=True)
def registered() -> Iterator[None]:
    ensure_registered()
    yield
    PROCESS.of(denoise_files._Current).work = None


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Four frames as Cycles writes them, in a folder."""
    for number in range(1, 5):
        write(tmp_path / "noisy", frame(number))
    return tmp_path / "noisy"


def run(folder: Path, *names: str, **more: Any) -> Work:
    files = [{"name": name} for name in names]
    choice = {"denoise": "fast", "temporal_radius": 1, **more}
    bpy.ops.xrds.denoise_files(directory=str(folder), files=files, **choice)
    work = PROCESS.of(denoise_files._Current).work
    assert work is not None
    return work


def names_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_folder_gives_what_the_command_gives(folder: Path) -> None:
    bpy.context.scene.render.engine = "BLENDER_WORKBENCH"
    kind, line = run(folder).outcome()
    out = folder / "denoised"
    assert (kind, names_in(out)) == ("INFO", names_in(folder)[:4])
    assert line.startswith(f"XRDS: frames denoised into {out} in ")
    assert line.endswith(": 4")
    expected = str(folder.parent / "####.exr")
    files = Files(str(folder / "####.exr"), expected)
    denoise_sequence(files, Denoiser("fast", "auto"), radius=1)
    for number in range(1, 5):
        name = f"{number:04d}.exr"
        ours, theirs = picture(out / name), picture(folder.parent / name)
        assert (ours == theirs).all()


def test_chosen_files_alone_and_what_is_there_stays(folder: Path) -> None:
    out = folder.parent / "out"
    run(folder, "0002.exr", "0003.exr", output=str(out))
    assert names_in(out) == ["0002.exr", "0003.exr"]
    before = (out / "0002.exr").stat().st_mtime_ns
    _, line = run(folder, output=str(out)).outcome()
    assert names_in(out) == names_in(folder)
    assert (out / "0002.exr").stat().st_mtime_ns == before
    assert line.endswith(": 2; there already: 2")


def test_a_frame_that_cannot_be_read_is_named(folder: Path) -> None:
    (folder / "0003.exr").write_bytes(b"no picture")
    kind, line = run(folder).outcome()
    assert kind == "WARNING"
    assert ": 3; could not be read: 3 (" in line


def test_what_cannot_be_done_is_one_line(folder: Path) -> None:
    def line(*given: Any, **more: Any) -> str:
        with pytest.raises(RuntimeError) as error:
            run(*given, **more)
        (said,) = str(error.value).strip().splitlines()
        return said

    empty = folder.parent / "empty"
    empty.mkdir()
    assert f"no .exr file in {empty}" in line(empty)
    assert "no folder" in line(folder / "none")
    write(folder / "other", frame(1))
    (folder / "other" / "0001.exr").rename(folder / "beauty_0001.exr")
    assert "are several shots; choose one's files" in line(folder)
    assert "is no .exr file" in line(folder, "0001.png")
    assert "it is an input" in line(folder, "0001.exr", output=str(folder))
    flat = folder.parent / "flat"
    write(flat, frame(1), {"radiance": "RGB"})
    assert "0001.exr" in line(flat)
    taken = folder.parent / "taken"
    taken.write_bytes(b"")
    assert "cannot write" in line(folder, "0001.exr", output=str(taken))


class Manager:
    def event_timer_remove(self, timer: Any) -> None:
        assert timer == "timer"


class Watch:
    """The modal operator without a window."""

    def __init__(self) -> None:
        self.status: list[str | None] = []
        self.reports: list[tuple[set[str], str]] = []
        self._timer = "timer"
        self.context = SimpleNamespace(
            window_manager=Manager(),
            workspace=SimpleNamespace(status_text_set=self.status.append),
        )

    def report(self, kind: set[str], line: str) -> None:
        self.reports.append((kind, line))

    def send(self, kind: str) -> set[str]:
        event = SimpleNamespace(type=kind, value="PRESS")
        return XRDS_OT_watch_denoising.modal(self, self.context, event)


def test_escape_stops_between_whole_files(folder: Path) -> None:
    out = folder.parent / "out"
    work = Work(
        *(str(folder / "####.exr"), str(out / "####.exr")),
        *(None, 1, "fast", Machine("cpu", threads=1)),
    )
    PROCESS.of(denoise_files._Current).work = work
    watch, reached, go_on = Watch(), threading.Event(), threading.Event()
    note = work._note

    def wait_in_second(part: float) -> bool:
        if part > 0.25:
            reached.set()
            go_on.wait(10)
        return note(part)

    work._note = wait_in_second  # type: ignore[method-assign]
    thread = threading.Thread(target=work.run)
    thread.start()
    assert reached.wait(10)
    assert not bpy.ops.xrds.denoise_files.poll()
    assert watch.send("TIMER") == {"PASS_THROUGH"}
    assert "XRDS denoises frames: " in str(watch.status[-1])
    assert watch.send("ESC") == {"PASS_THROUGH"}
    assert watch.status[-1] == "XRDS stops after what it is doing"
    go_on.set()
    thread.join(10)
    assert watch.send("TIMER") == {"FINISHED"}
    assert watch.status[-1] is None
    ((kind, line),) = watch.reports
    assert kind == {"INFO"}
    assert line.startswith(f"XRDS was stopped; frames denoised into {out} in ")
    assert line.endswith(": 1")
    assert names_in(out) == ["0001.exr"]


def test_the_entry_is_in_the_render_menu() -> None:
    assert denoise_files.draw_entry in bpy.types.TOPBAR_MT_render._dyn_ui_initialize()
