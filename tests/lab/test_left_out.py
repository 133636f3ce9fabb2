"""What a super-resolution picture of a few pixels is rendered without."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from xrds_blender.planning.plan import SAVINGS
from xrds_core.errors import UsageError
from xrds_lab.bench import left_out
from xrds_lab.bench.left_out import bench_left_out


def test_a_scene_is_measured_once_with_and_without_what_it_lacks(
    blend: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = bench_left_out([blend], tmp_path / "out", resolution=(96, 64), rounds=1)
    assert found["failures"] == {}
    (row,) = found["shots"]
    assert (row["scene"], row["size"]) == ("cubes", "96x64")
    assert row["seconds_all"] > 0
    assert row["seconds_planned"] > 0
    assert row["psnr"] > 40  # what was left out does not show
    assert row["decisions"]["guide bounces"] == "4, none diffuse"  # it has a mirror
    assert row["decisions"]["guide lights"] != "all"
    assert set(row["decisions"]) & set(SAVINGS)
    written = json.loads((tmp_path / "out" / "results.json").read_text())
    assert written["shots"] == found["shots"]
    assert (tmp_path / "out" / "results.csv").read_text().count("\n") == 2
    monkeypatch.setattr(left_out, "_measured", None)  # it is not asked again
    again = bench_left_out([blend], tmp_path / "out", resolution=(96, 64), rounds=1)
    assert again["shots"] == found["shots"]


def test_missing_files_are_told_before_anything_is_rendered(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="nowhere"):
        bench_left_out([tmp_path / "nowhere.blend"], tmp_path / "out")
