"""What finishing a frame costs, part by part, and what is told of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("torch")

from xrds_core.files import read_json
from xrds_lab.shots import own_seconds
from xrds_lab.shots.own_seconds import PARTS, bench_own_seconds, ratios


def test_every_part_is_measured(tmp_path: Path) -> None:
    found = bench_own_seconds(tmp_path, (64, 36), samples=(2, 16), rounds=1, cores=(1,))
    parts = {
        n: [x["part"] for x in found["points"] if x["samples"] == n] for n in (2, 16)
    }
    assert parts[16] == list(PARTS)
    assert parts[2] == [x for x in PARTS if x != "guess"]  # few samples need none
    for row in found["points"]:
        assert row["seconds"] > 0.0
    assert read_json(tmp_path / "own-seconds.json") == found
    page = (tmp_path / "own-seconds.md").read_text("utf-8")
    assert page.count("\n| 16 | 1 |") == len(PARTS) + 1


def row(part: str, seconds: float, cores: int) -> dict[str, Any]:
    return {"samples": 2, "cores": cores, "part": part, "seconds": seconds}


def test_ratios_are_in_denoisings() -> None:
    seconds = {"accumulate": 1.0, "denoise": 10.0, "alone": 11.0, "shot": 13.0}
    seconds["card"] = 14.3
    one, two = ratios(
        [
            *(row(part, x, 1) for part, x in {**seconds, "sums": 0.8}.items()),
            *(row(part, x, 2) for part, x in {**seconds, "sums": 0.5}.items()),
        ]
    )
    assert one["accumulate"] == pytest.approx(0.1)
    assert one["shot_over_alone"] == pytest.approx(0.2)
    assert one["card"] == pytest.approx(1.1)
    assert (one["efficiency"], two["efficiency"]) == (1.0, 0.8)


def test_cores_are_doubled() -> None:
    assert own_seconds._doubled(1) == (1,)
    assert own_seconds._doubled(6) == (1, 2, 4)
