"""Files appear whole or not at all, whoever else writes them and whatever happens."""

from __future__ import annotations

import os
import signal
import stat
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from xrds_core import files
from xrds_core.errors import XRDSError
from xrds_core.files import replacing


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


# --- links and special files ----------------------------------------------------------


def test_a_link_stays_and_its_file_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    real, link = tmp_path / "there" / "real.exr", tmp_path / "link.exr"
    real.write_text("old")
    link.symlink_to(real)
    with replacing(link) as part:
        part.write_text("new")
    assert link.is_symlink()
    assert real.read_text() == "new"
    assert names(tmp_path / "there") == ["real.exr"]


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such files")
def test_pipes_and_devices_are_never_replaced(tmp_path: Path) -> None:
    pipe, link = tmp_path / "pipe.exr", tmp_path / "null.exr"
    os.mkfifo(pipe)
    link.symlink_to(os.devnull)
    for target in (pipe, link):
        with pytest.raises(OSError, match="no regular file"), replacing(target) as part:
            part.write_text("new")
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert stat.S_ISCHR(Path(os.devnull).stat().st_mode)


# --- killed ---------------------------------------------------------------------------


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", None)
    monkeypatch.setenv("TMPDIR", str(folder))
    return folder


KILLED = """
import os, signal, sys
from pathlib import Path
from xrds_core.files import replacing, scratch_folder
with replacing(Path(sys.argv[1]) / "frame.exr") as part, scratch_folder() as folder:
    part.write_text("half")
    (folder / "archive").write_text("half")
    os.kill(os.getpid(), signal.SIGKILL)
"""


def kill_a_writer(folder: Path) -> Path:
    """What is left of a frame that was being written in `folder`."""
    done = subprocess.run([sys.executable, "-c", KILLED, str(folder)], check=False)
    assert done.returncode == -signal.SIGKILL
    (left,) = folder.glob(".*")
    return left


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGKILL")
def test_what_a_killed_process_left_is_swept_up_wherever_it_lies(
    tmp_path: Path, temporary: Path
) -> None:
    folder = tmp_path / "frames"
    folder.mkdir()
    (folder / "1.exr").write_text("a frame")
    kill_a_writer(folder)
    assert names(temporary)
    files.sweep()
    assert not names(temporary)
    assert names(folder) == ["1.exr"]


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGKILL")
def test_a_folder_is_swept_without_links(tmp_path: Path, temporary: Path) -> None:
    folder = tmp_path / "frames"
    folder.mkdir()
    kill_a_writer(folder)
    files.sweep(folder)
    assert not names(folder)


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGKILL")
def test_another_machine_may_still_be_writing_for_an_hour(
    tmp_path: Path, temporary: Path
) -> None:
    folder = tmp_path / "frames"
    folder.mkdir()
    left = kill_a_writer(folder)
    elsewhere = left.rename(left.with_name(".xrds-" + "0" * 8 + left.name[14:]))
    files.sweep(folder)
    assert names(folder) == [elsewhere.name]
    day_before = time.time() - 86400
    os.utime(elsewhere, (day_before, day_before))
    files.sweep(folder)
    assert not names(folder)


def test_what_is_being_written_and_what_others_left_stays(tmp_path: Path) -> None:
    day_before = time.time() - 86400
    others = [".work.unfinished", ".xrds-mine.unfinished", ".xrds-1.unfinished"]
    for name in others:
        (tmp_path / name).write_text("somebody's")
        os.utime(tmp_path / name, (day_before, day_before))
    with replacing(tmp_path / "frame.exr") as part:
        part.write_text("half")
        files.sweep(tmp_path)
        files.sweep()
        part.write_text("whole")
    assert names(tmp_path) == sorted([*others, "frame.exr"])


def test_a_link_that_leads_to_a_foreign_file_takes_nothing_along(
    tmp_path: Path, temporary: Path
) -> None:
    precious = tmp_path / "precious"
    precious.write_text("somebody's")
    link = temporary / f".xrds-{'0' * 8}-1-abc.unfinished"
    link.symlink_to(precious)
    day_before = time.time() - 86400
    os.utime(link, (day_before, day_before), follow_symlinks=False)
    files.sweep()
    assert not names(temporary)
    assert precious.exists()


ENDING = """
import os, sys, threading
from pathlib import Path
from xrds_core.files import abandon, replacing

folder = Path(sys.argv[1])
with replacing(folder / "frame.exr") as part:
    part.write_text("half")
    abandon()

    def write_more() -> None:
        with replacing(folder / "other.exr") as part:
            part.write_text("half")

    thread = threading.Thread(target=write_more, daemon=True)
    thread.start()
    thread.join(0.2)
    os._exit(3)
"""


def test_a_process_that_ends_on_the_spot_leaves_nothing(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-c", ENDING, str(tmp_path)], check=False)
    assert done.returncode == 3
    assert not names(tmp_path)


@pytest.mark.parametrize("content", [b"", b"{", b"\xff\xfe", b"[1, 2"])
def test_a_damaged_record_is_named(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "runs.json"
    files.write_json(path, {"a": [1]})
    assert files.read_json(path) == {"a": [1]}
    path.write_bytes(content)
    with pytest.raises(XRDSError, match=r"runs\.json is damaged"):
        files.read_json(path)
