"""Bounds of shots, on a few pixels; `xrds stability --parts accumulation` does all."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("bpy")
pytest.importorskip("mitsuba_oidn")

from xrds_lab.stability import accumulation, broken_shots, moving_scenes, suite
from xrds_lab.stability.bounds import bound
from xrds_lab.stability.measured import Measured

pytestmark = pytest.mark.nightly  # it takes minutes


@pytest.fixture(autouse=True)
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(accumulation, "REFERENCE_SAMPLES", 16)
    monkeypatch.setattr(broken_shots, "LONG", 12)
    monkeypatch.setattr(moving_scenes, "SIZE", (48, 36))


def held(results: list[Measured]) -> dict[str, float]:
    values = {x.name.removeprefix("accumulation."): x.value for x in results}
    for name, value in values.items():
        limit = bound(f"accumulation.{name}").limit
        assert limit is None or value <= limit, name
    return values


def test_nothing_is_lent_across_a_cut() -> None:
    values = held(list(accumulation.shot("cut")))
    assert values["cut.below_single"] < 0.0  # frames of one side do lend
    frames = accumulation.film("teleport").frames
    assert accumulation.ghost(frames) > 0.0  # all but the ball is the same


def test_bad_frames_spoil_nothing() -> None:
    frames = accumulation.film("alpha_cards").frames
    held([*broken_shots.spoilt(frames), *broken_shots.missing(frames)])
    assert broken_shots.crashes(frames) == 0
    assert broken_shots.long(frames).curve


def test_under_a_fisheye_frames_are_rendered_by_themselves() -> None:
    held(list(accumulation.fisheye()))


def test_the_part_needs_no_weights_and_joins_the_report(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(moving_scenes, "SHOTS", {"cut": moving_scenes.cut})
    monkeypatch.setattr(accumulation, "fisheye", list)
    monkeypatch.setattr(broken_shots, "shots", list)
    result = suite.stability(tmp_path, parts=["accumulation"])
    assert {x["preset"] for x in result["checks"]} == {"full_size"}
    assert "`accumulation.cut.ghost`" in (tmp_path / "report.md").read_text()
