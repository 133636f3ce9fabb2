"""Outputs that cannot be written, or must not be, are refused before the work."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from xrds_core.errors import PictureError
from xrds_core.files import check_input, check_output

pytestmark = pytest.mark.skipif(os.name == "nt", reason="such files are POSIX'")


def pipe(path: Path) -> None:
    os.mkfifo(path)


def device_behind_a_link(path: Path) -> None:
    path.symlink_to(os.devnull)


def broken_link(path: Path) -> None:
    path.symlink_to(path.with_name("nowhere"))


def endless_link(path: Path) -> None:
    path.symlink_to(path)


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (Path.mkdir, "folder"),
        (pipe, "no regular file"),
        (device_behind_a_link, "no regular file"),
        (broken_link, "leads nowhere"),
        (endless_link, "Too many levels"),
    ],
)
def test_what_is_no_file_is_refused(make: object, reason: str, tmp_path: Path) -> None:
    path = tmp_path / "out.exr"
    make(path)  # type: ignore[operator]
    kept = path.lstat()
    with pytest.raises(PictureError, match=f"^cannot write .*out.exr .*{reason}"):
        check_output(path)
    assert path.lstat() == kept


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("x" * 256 + ".exr", "too long"),
        (os.fsdecode(b"caf\xe9.exr"), "not UTF-8"),
        ("file/out.exr", "Not a directory"),
    ],
)
def test_names_that_no_file_can_have_are_refused(
    name: str, reason: str, tmp_path: Path
) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(PictureError, match=reason) as error:
        check_output(tmp_path / name)
    assert str(error.value).isprintable()


def test_an_input_is_no_output(tmp_path: Path) -> None:
    source, link = tmp_path / "in.exr", tmp_path / "link.exr"
    source.touch()
    link.symlink_to(source)
    for path in (source, link, tmp_path / "." / "in.exr"):
        with pytest.raises(PictureError, match="it is an input"):
            check_output(path, (tmp_path / "other.exr", source))
    check_output(tmp_path / "out.exr", (source,))


def test_the_longest_name_is_taken(tmp_path: Path) -> None:
    check_output(tmp_path / "new" / ("x" * 251 + ".exr"))
    assert not list((tmp_path / "new").iterdir())


def test_many_may_begin_one_shot_together(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also on machines where they have the same process number, as in containers."""
    monkeypatch.setattr(os, "getpid", lambda: 7)
    with ThreadPoolExecutor(16) as pool:
        begun = [
            pool.submit(check_output, tmp_path / "new" / "folder" / "1.exr")
            for _ in range(400)
        ]
        for each in begun:
            each.result()
    assert not list((tmp_path / "new" / "folder").iterdir())


@pytest.fixture
def nobody() -> Iterator[None]:
    """Root may look into every folder; others may not."""
    if os.geteuid() != 0:
        yield
        return
    os.seteuid(65534)
    yield
    os.seteuid(0)


def test_a_folder_that_cannot_be_searched_is_told(
    tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    closed = tmp_path / "closed"
    closed.mkdir()
    closed.chmod(0)
    request.getfixturevalue("nobody")
    with pytest.raises(PictureError, match=r"cannot read .*Permission denied"):
        check_input(closed / "in.exr")
    with pytest.raises(PictureError, match=r"cannot write .*Permission denied"):
        check_output(closed / "out.exr")


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="POSIX only")
def test_read_only_files_and_folders_are_refused(tmp_path: Path) -> None:
    if os.geteuid() == 0:
        pytest.skip("nothing is forbidden to root")
    path = tmp_path / "out.exr"
    path.touch(0o400)
    with pytest.raises(PictureError, match="read-only"):
        check_output(path)
    path.unlink()
    tmp_path.chmod(0o500)
    with pytest.raises(PictureError, match=re.escape(str(tmp_path))):
        check_output(path)
