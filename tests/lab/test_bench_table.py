"""Means, gains and the windows file of the standard measure; renders nothing."""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING, Any

import pytest

from xrds_core.errors import UsageError
from xrds_lab.bench import table, windows

if TYPE_CHECKING:
    from pathlib import Path


def record(scene: str, preset: str = "fast", **psnr: float) -> dict[str, Any]:
    methods = {
        name: dict.fromkeys(table.FIGURES, 0.5) | {"psnr": value}
        for name, value in psnr.items()
    }
    own = {"scene": scene, "scale": 2, "preset": preset}
    rest = {"gain": table.gain(methods), "reference_psnr_floor": 40.0}
    return own | {"methods": methods} | rest


RECORDS = [
    record("car", xrds=30.0, bicubic=29.0, demodulated_bilinear=26.0),
    record("room", xrds=30.5, bicubic=24.0, demodulated_bilinear=31.0),
    record("room", preset="paper", bicubic=24.0, demodulated_bilinear=31.0),
]


def test_gain_is_over_the_better_baseline_of_each_window() -> None:
    assert [r["gain"] for r in RECORDS] == [1.0, -0.5, None]


def test_means_are_kept_apart_by_preset() -> None:
    means = table.means(RECORDS)
    assert means["2"]["fast"]["bicubic"]["psnr"] == 26.5
    assert means["2"]["fast"]["bicubic"]["windows"] == 2
    assert means["2"]["paper"]["bicubic"]["psnr"] == 24.0
    assert "xrds" not in means["2"]["paper"]


def test_worst_names_the_scene() -> None:
    assert table.worst(RECORDS) == {
        "2": {"fast": {"mean": 0.25, "gain": -0.5, "scene": "room"}}
    }


def test_text_shows_every_window_and_what_is_missing() -> None:
    report = {
        "scenes": RECORDS,
        "mean": table.means(RECORDS),
        "worst": table.worst(RECORDS),
    }
    blocks = table.text(report).split("\n\n")
    assert [b.split(",")[0] for b in blocks] == ["x2 fast", "x2 paper"]
    room = next(row for row in blocks[0].splitlines() if row.startswith("room"))
    assert room.split() == [
        "room",
        "30.50",
        "24.00",
        "31.00",
        *"---",
        "-0.50",
        "40.00",
    ]
    assert "worst gain -0.50 dB: room" in blocks[0]
    assert "worst" not in blocks[1]


def write_windows(folder: Path) -> Path:
    entry = {"resolution": [192, 108], "window": [16, 8, 64, 48], "floor_psnr": 40}
    (folder / "windows.json").write_text(json.dumps({"car": entry}), "utf-8")
    return folder / "windows.json"


def test_windows_file_is_read(tmp_path: Path) -> None:
    window = windows.read_windows(write_windows(tmp_path))["car"]
    assert window == windows.Window(192, 108, 16, 8, 64, 48, 40)
    assert window.whole == windows.Window(192, 108, 0, 0, 192, 108)


def test_what_is_missing_is_named(tmp_path: Path) -> None:
    file = write_windows(tmp_path)
    for name in ("car", "boat"):
        (tmp_path / f"{name}.blend").write_bytes(b"scene")
    find = windows.find_shots
    with pytest.raises(UsageError, match=r"no scene .*ship\.blend"):
        find([tmp_path / "ship.blend"], file, tmp_path)
    with pytest.raises(UsageError, match="no window for boat; it has car"):
        find([tmp_path / "boat.blend"], file, tmp_path)
    with pytest.raises(UsageError, match=r"no reference .*car\.exr"):
        find([tmp_path / "car.blend"], file, tmp_path)
    (tmp_path / "car.exr").write_bytes(b"")
    (shot,) = find([tmp_path / "car.blend"], file, tmp_path)
    assert (shot.name, shot.window.x) == ("car", 16)
    assert shot.digest == hashlib.sha256(b"scene").hexdigest()[:12]


@pytest.mark.parametrize("text", ["", "[]", '{"car": {"window": [1, 2, 3, 4]}}'])
def test_another_file_is_not_a_windows_file(tmp_path: Path, text: str) -> None:
    (tmp_path / "w.json").write_text(text, "utf-8")
    with pytest.raises(UsageError, match="not a windows file"):
        windows.read_windows(tmp_path / "w.json")
