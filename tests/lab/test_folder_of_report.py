"""The folder of a bench's report: made, gone on with, or refused."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from xrds_core.errors import UsageError
from xrds_core.version import package_version
from xrds_lab.bench.folder_of_report import make_folder
from xrds_lab.shots.own_seconds import bench_own_seconds
from xrds_lab.shots.sooner import Case, bench_same_picture


def report_of(folder: Path, version: str) -> Path:
    results = {"machine": {"xrds": version}, "shots": []}
    (folder / "results.json").write_text(json.dumps(results))
    return folder


def test_an_unfinished_report_goes_on(tmp_path: Path) -> None:
    make_folder(tmp_path / "new" / "folder")
    assert (tmp_path / "new" / "folder").is_dir()
    make_folder(report_of(tmp_path, package_version()))


@pytest.mark.parametrize("text", ["[]", '{"machine": null}', '{"shots": []}'])
def test_what_is_no_report_is_written_over(tmp_path: Path, text: str) -> None:
    (tmp_path / "results.json").write_text(text)
    make_folder(tmp_path)


def test_another_version_is_refused_before_anything_is_measured(tmp_path: Path) -> None:
    old = report_of(tmp_path, "0.0.9")
    before = (old / "results.json").read_bytes()
    with pytest.raises(UsageError, match=r"report of XRDS 0\.0\.9, this is"):
        bench_own_seconds(old, (64, 48))
    with pytest.raises(UsageError, match="give another folder"):
        bench_same_picture([tmp_path / "no.blend"], old, [Case("pan", 8)])
    assert [path.name for path in old.iterdir()] == ["results.json"]
    assert (old / "results.json").read_bytes() == before
