"""How the cost of a shot grows: runs in processes of their own, and what is fitted."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("bpy")

from xrds_core.accumulation.accumulate import accumulate
from xrds_core.accumulation.frame import store
from xrds_core.errors import SceneError, UsageError
from xrds_lab.shots import growth
from xrds_lab.shots.growth import COUNTS, RADII, Run, bench_growth
from xrds_lab.shots.synthetic import SAMPLES, frame

pytestmark = pytest.mark.nightly  # it takes minutes

SIZES = ((32, 18), (64, 36))


def test_synthetic_frames_lend_to_each_other() -> None:
    shot = [store(frame(n, 96, 54)) for n in range(3)]
    together = accumulate(shot[1], [shot[0], shot[2]])
    alone = accumulate(shot[1], [])
    assert together.samples.mean() > 1.8 * SAMPLES
    assert alone.samples == pytest.approx(SAMPLES)
    assert shot[1].noise is not None  # of halves, as rendered frames have them


def test_a_run_has_a_process_of_its_own(blend: Path) -> None:
    stages = growth.apart(Run(growth.PIXELS, SIZES[0], radius=1))
    assert [row["stage"] for row in stages] == ["accumulate", "denoise"]
    (shot,) = growth.apart(Run(growth.FRAMES, SIZES[0], 1, 2, str(blend)))
    for row in (*stages, shot):
        assert row["seconds"] > 0.0
        assert row["processor_seconds"] > 0.0
        assert row["peak_memory"] > 50e6
    with pytest.raises(SceneError, match="its process ended"):
        growth.apart(Run(growth.FRAMES, SIZES[0], 1, 2, str(blend) + "x"))


def fake(run: Run) -> list[dict[str, Any]]:
    """Seconds as the pixels, memory as their root; by the radius and frames alike."""
    x = {"pixels": run.size[0] * run.size[1], "radius": run.radius}
    row = {**x, "frames": run.frames, "by": run.by, "stage": "any"}
    size = row[run.by]
    return [row | dict(zip(growth.FIGURES, (size, 2 * size, size**0.5), strict=True))]


def test_a_second_run_measures_only_what_is_missing(
    blend: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Run] = []

    def apart(run: Run) -> list[dict[str, Any]]:
        asked.append(run)
        if run.radius == RADII[-1] and len(asked) <= 10:
            raise SceneError("killed")
        return fake(run)

    monkeypatch.setattr(growth, "apart", apart)
    first = bench_growth(blend, tmp_path / "out", SIZES)
    count = len(COUNTS) + len(RADII) + len(SIZES)
    assert len(asked) == count
    assert list(first["failures"].values()) == ["SceneError: killed"]
    assert len(first["points"]) == count - 1
    again = bench_growth(blend, tmp_path / "out", SIZES)
    assert asked[count:] == [Run(growth.BY_RADIUS, SIZES[0], RADII[-1])]
    assert again["failures"] == {}
    for fit in again["exponents"]:
        assert fit["seconds"] == pytest.approx(1.0)
        assert fit["peak_memory"] == pytest.approx(0.5)
    assert {fit["by"] for fit in again["exponents"]} == {"pixels", "radius", "frames"}
    out = tmp_path / "out"
    assert json.loads((out / "growth.json").read_text()) == again
    assert "| frames | any | 1.00 | 1.00 | 0.50 |" in (out / "growth.md").read_text()


def test_what_cannot_grow_is_wrong_usage(blend: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="two sizes"):
        bench_growth(blend, tmp_path / "out", SIZES[:1])
    with pytest.raises(UsageError, match="no scene"):
        bench_growth(tmp_path / "none.blend", tmp_path / "out", SIZES)
    assert not (tmp_path / "out").exists()
