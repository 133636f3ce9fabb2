"""The measure of the parts of the light over one scene of a few pixels."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from xrds_lab.shots import light
from xrds_lab.shots.light import ONE_BY_ONE, RAW, SHOT, STILL

pytestmark = pytest.mark.nightly  # it takes minutes


def run(blend: Path) -> dict[str, Any]:
    return light.bench_light_parts(
        [blend], blend.parent / "out", resolution=(96, 64), reference_samples=64
    )


def test_parts_are_judged_once(blend: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = run(blend)
    assert first["failures"] == {}
    rows = {(row["sum"], row["part"]): row for row in first["parts"]}
    for kind in ("lobes", "groups"):
        deviation = rows.pop((kind, "deviation of the sum"))
        assert max(deviation[STILL], deviation[SHOT]) < 1e-5
    seconds = rows.pop(("", "seconds"))
    assert min(seconds[x] for x in (ONE_BY_ONE, STILL, SHOT)) > 0.0
    assert {part for kind, part in rows if kind == "groups"} == {
        "Combined_scene",
        "Combined_lamp",
    }
    means = {x: np.mean([row[x] for row in rows.values()]) for x in light.METHODS}
    assert means[RAW] + 3.0 < means[STILL] < means[SHOT]

    def refuse(*_: Any, **__: Any) -> None:
        raise AssertionError("measured again")

    monkeypatch.setattr(light, "_render", refuse)
    assert run(blend)["parts"] == first["parts"]
