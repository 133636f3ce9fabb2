"""The measure of the same picture over one scene of a few pixels: made and resumed."""

from __future__ import annotations

import json
import statistics
from argparse import Namespace
from pathlib import Path
from typing import Any

import pytest

from xrds_core.errors import UsageError
from xrds_lab.bench.windows import Window, find_shots
from xrds_lab.cards import cycles
from xrds_lab.commands import bench_shots
from xrds_lab.shots import motions, sooner
from xrds_lab.shots.methods import CYCLES, SAME_PICTURE, SAME_SAMPLES
from xrds_lab.shots.sooner import Case

pytestmark = pytest.mark.nightly  # it takes minutes

SIZE = (64, 48)


def run(blend: Path, *cases: Case) -> dict[str, Any]:
    return sooner.bench_same_picture(
        [blend],
        blend.parent / "out",
        cases,
        resolution=SIZE,
        reference_samples=64,
    )


def test_each_method_has_a_row_that_is_measured_once(
    blend: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = run(blend, Case("pan", 8))
    assert first["failures"] == {}
    rows = {row["method"]: row for row in first["shots"]}
    assert list(rows) == [CYCLES, SAME_PICTURE, SAME_SAMPLES]
    assert rows[CYCLES]["ratio"] == 1.0
    assert rows[CYCLES]["gain"] == 0.0
    assert len(rows[SAME_PICTURE]["shares"]) == sooner.FRAMES
    late = statistics.median(rows[SAME_PICTURE]["shares"][-7:])
    assert rows[SAME_PICTURE]["late_share"] == pytest.approx(late, abs=1e-3)
    assert rows[SAME_PICTURE]["mean_share"] <= 1.0
    assert 0 < rows[SAME_PICTURE]["stages"]["beauty"] < rows[CYCLES]["seconds"] * 2
    assert rows[SAME_SAMPLES]["gain"] > rows[SAME_PICTURE]["gain"] - 1.0
    assert all(0 < row["flicker"] < 0.1 for row in rows.values())
    assert all(row["seconds"] > 0 and row["psnr"] > 15 for row in rows.values())
    report = (blend.parent / "out" / "report.md").read_text()
    assert report.count("| cubes | 8 |") == 3
    assert {row["frames"] for row in rows.values()} == {sooner.FRAMES}

    def refuse(*_: Any, **__: Any) -> None:
        raise AssertionError("measured again")

    for name in ("_cycles", "_same_picture", "_same_samples"):
        monkeypatch.setattr(sooner, name, refuse)
    assert run(blend, Case("pan", 8))["shots"] == first["shots"]


def test_more_can_be_rendered_than_is_judged(blend: Path) -> None:
    windows = blend.parent / "windows.json"
    window = {"resolution": [96, 72], "window": [30, 40, 32, 32], "floor_psnr": None}
    windows.write_text(json.dumps({blend.stem: window}))
    out, cache = blend.parent / "out", blend.parent / "cache"

    def measured(around: tuple[int, int] | None) -> dict[str, Any]:
        found = sooner.bench_same_picture(
            [blend],
            out,
            [Case("pan", 8)],
            windows=windows,
            around=around,
            cache=cache,
            reference_samples=64,
        )
        assert found["failures"] == {}
        return {row["method"]: row for row in found["shots"]}

    small, large = measured(None), measured((64, 72))
    assert small[CYCLES]["size"] == "32x32"
    assert large[CYCLES]["size"] == "64x72"
    # the same window of the same frame; a denoiser sees what is around it, and gains
    gained = large[CYCLES]["psnr"] - small[CYCLES]["psnr"]
    assert -1.0 < gained < 2.0
    with pytest.raises(UsageError, match="16x72 is not between the window, 32x32"):
        measured((16, 72))


@pytest.mark.parametrize(
    ("place", "expected"), [((30, 40), (14, 0)), ((0, 0), (0, 0)), ((64, 8), (32, 0))]
)
def test_a_larger_window_ends_where_the_frame_does(
    place: tuple[int, int], expected: tuple[int, int]
) -> None:
    window = Window(96, 72, *place, 32, 32)
    larger = window.around(64, 72)
    assert (larger.x, larger.y) == expected
    rows, columns = window.within(larger)
    assert (columns.start + larger.x, rows.start + larger.y) == place
    assert (columns.stop - columns.start, rows.stop - rows.start) == (32, 32)


def test_a_card_that_is_not_here_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cycles, "find_card", lambda: cycles.CPU)
    options = Namespace(
        card=True, motions=(), samples=(8,), noise_thresholds=None, frames=21
    )
    with pytest.raises(UsageError, match="no graphics card"):
        bench_shots._same_picture(options)


def test_a_shot_that_is_too_short_is_refused(blend: Path) -> None:
    with pytest.raises(UsageError, match="8 frames"):
        run(blend, Case("pan", 8, frames=8))


def test_a_file_may_move_as_it_says(blend: Path) -> None:
    (shot,) = find_shots([blend], None, None, SIZE)
    ends = [
        (scene.frame_start, scene.frame_end, scene.camera.animation_data is None)
        for scene in (
            sooner._opened(shot, Case(motion, 8), 8) for motion in (motions.FILE, "pan")
        )
    ]
    assert ends == [(1, 250, True), (1, 17, False)]
