"""The table of budgets below a sample per pixel, of made-up measurements."""

from __future__ import annotations

from typing import Any

import pytest

from xrds_blender.planning.settings import Network
from xrds_lab.bench.low_budgets import CACHED, FRESH, LowSweep, markdown, rows


def point(
    scene: str,
    method: str,
    psnr: float,
    seconds: float,
    samples: int,
    scale: int,
    guide_samples: int = 0,
    guides: float = 0.0,
) -> dict[str, Any]:
    return {
        "scene": scene,
        "method": method,
        "label": f"{method} x{scale}, {samples}",
        "settings": {
            "samples": samples,
            "scale": scale,
            "guide_samples": guide_samples,
        },
        "seconds": {"total": seconds, "guides": guides},
        "psnr": psnr,
    }


@pytest.fixture
def measured() -> list[dict[str, Any]]:
    return [
        point("a", "oidn", 29.0, 6.5, 1, 1),
        point("a", "bicubic", 22.0, 2.0, 1, 2),
        point("a", "bicubic", 25.0, 4.0, 4, 2),
        point("a", "bicubic", 28.0, 9.0, 16, 2),
        point("a", "xrds", 24.0, 5.0, 1, 4, FRESH, guides=1.0),
        point("a", "xrds", 27.0, 6.0, 1, 2, FRESH, guides=1.0),
        point("a", "xrds", 24.5, 8.0, 1, 4, CACHED, guides=4.5),
        point("a", "xrds", 27.5, 9.5, 1, 2, CACHED, guides=4.5),
        point("b", "bicubic", 30.0, 1.0, 1, 2),
        point("b", "xrds", 29.0, 2.0, 1, 4, FRESH, guides=0.5),
    ]


def row(table: list[dict[str, Any]], samples: float, guides: str) -> dict[str, Any]:
    (found,) = [r for r in table if (r["samples"], r["guides"]) == (samples, guides)]
    return found


def test_the_other_way_gets_the_same_seconds(measured: list[dict[str, Any]]) -> None:
    table = rows(measured)
    least = row(table, 1 / 16, "rendered")
    assert [s["xrds"] for s in least["scenes"]] == [24.0, 29.0]
    assert [s["lowered"] for s in least["scenes"]] == [25.0, 30.0]
    assert least["gain"] == pytest.approx(-1.0)
    quarter = row(table, 1 / 4, "rendered")
    assert [s["xrds"] for s in quarter["scenes"]] == [27.0, 29.0]
    assert quarter["gain"] == pytest.approx((2.0 - 1.0) / 2)
    assert quarter["worst"] == {"scene": "b", "gain": -1.0}
    assert quarter["full_size_fits"] == 0


def test_kept_guides_cost_no_seconds(measured: list[dict[str, Any]]) -> None:
    quarter = row(rows(measured), 1 / 4, "kept")
    (scene,) = quarter["scenes"]  # b has none
    assert (scene["xrds"], scene["seconds"]) == (27.5, 5.0)
    assert scene["lowered"] == 25.0


def test_where_a_sample_per_pixel_fits_is_told(measured: list[dict[str, Any]]) -> None:
    measured[0]["seconds"]["total"] = 5.5
    quarter = row(rows(measured), 1 / 4, "rendered")
    assert quarter["full_size_fits"] == 1
    told = "\n".join(markdown(rows(measured)))
    assert "| 0.25 | rendered | 27.50 | 28.00 | +0.50, -1.00 b | 1 of 2 |" in told


def test_nothing_within_a_budget_is_no_line(measured: list[dict[str, Any]]) -> None:
    few = [p for p in measured if p["settings"]["scale"] != 4]
    assert {r["samples"] for r in rows(few)} == {1 / 4, 1 / 2}


def test_every_network_is_tried_with_both_kinds_of_guides() -> None:
    networks = tuple(Network("fast", scale) for scale in (2, 4, 8))
    configs = LowSweep(networks).configurations()
    assert len(set(configs)) == len(configs)
    tried = {(c.scale, c.guide_samples) for c in configs if c.method == "xrds"}
    assert tried == {(s, g) for s in (2, 4, 8) for g in (FRESH, CACHED)}
