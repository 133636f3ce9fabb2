"""Files appear whole or not at all, whoever else writes them and whatever happens."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from xrds_core import atomic
from xrds_core.atomic import replacing


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_file_appears_when_it_is_whole(tmp_path: Path) -> None:
    target = tmp_path / "frame.exr"
    target.write_text("old")
    with replacing(target) as part:
        part.write_text("half")
        assert target.read_text() == "old"
        part.write_text("whole")
    assert target.read_text() == "whole"
    assert names(tmp_path) == ["frame.exr"]


@pytest.mark.parametrize("error", [OSError(28, "No space left"), KeyboardInterrupt()])
def test_an_error_leaves_what_was_there(tmp_path: Path, error: BaseException) -> None:
    target = tmp_path / "frame.exr"
    target.write_text("old")

    def write() -> None:
        with replacing(target) as part:
            part.write_text("half")
            raise error

    with pytest.raises(type(error)):
        write()
    assert target.read_text() == "old"
    assert names(tmp_path) == ["frame.exr"]


def test_a_vanished_folder_is_told_as_such(tmp_path: Path) -> None:
    folder = tmp_path / "frames"
    folder.mkdir()
    with pytest.raises(FileNotFoundError), replacing(folder / "1.exr"):
        folder.rmdir()


def test_two_may_write_one_file(tmp_path: Path) -> None:
    target = tmp_path / "frame.exr"
    with replacing(target) as one:
        one.write_text("o")
        with replacing(target) as other:
            other.write_text("other")
        assert target.read_text() == "other"
        one.write_text("one")
    assert target.read_text() == "one"
    assert names(tmp_path) == ["frame.exr"]


def test_a_killed_writer_leaves_no_frame_and_is_swept_up(tmp_path: Path) -> None:
    code = f"""
import os, signal
from pathlib import Path
from xrds_core.atomic import replacing
with replacing(Path({str(tmp_path)!r}) / "frame.exr") as part:
    part.write_text("half")
    os.kill(os.getpid(), {9})
"""
    done = subprocess.run([sys.executable, "-c", code], check=False)
    assert done.returncode
    (left,) = names(tmp_path)
    assert left != "frame.exr"
    atomic.sweep(tmp_path)
    assert names(tmp_path) == [left], "it may still be being written"
    day_before = time.time() - 86400
    os.utime(tmp_path / left, (day_before, day_before))
    (tmp_path / "frame.exr").write_text("a frame")
    atomic.sweep(tmp_path)
    assert names(tmp_path) == ["frame.exr"]


def test_a_process_that_ends_on_the_spot_leaves_nothing(tmp_path: Path) -> None:
    def write() -> None:
        with replacing(tmp_path / "frame.exr") as part:
            part.write_text("half")
            atomic.abandon()

    with pytest.raises(FileNotFoundError):
        write()
    assert not names(tmp_path)
