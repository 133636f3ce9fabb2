"""The figure of the first page: points that were timed, Same Picture beside them."""

from __future__ import annotations

from pathlib import Path

import pytest

from xrds_lab.pages import shot_plot
from xrds_lab.pages.results import Results
from xrds_lab.shots.frames import REACH
from xrds_lab.shots.methods import DEFAULT, MEDIAN, SAME_PICTURE, THRESHOLD, XRDS
from xrds_lab.shots.plot import LINES

RESULTS = Path(__file__).resolve().parents[2] / "docs/results"


def point(method: str, seconds: float | None, samples: int = 16) -> dict[str, object]:
    return {
        "scene": "cubes",
        "motion": "pan",
        "method": method,
        "samples": samples,
        "radius": {DEFAULT: 0, XRDS: REACH}.get(method, 1),
        "seconds_per_frame": seconds,
        "psnr": 30.0,
        "flicker": 0.02,
    }


def test_the_figure_is_drawn_from_the_results(tmp_path: Path) -> None:
    shot_plot.draw(Results(RESULTS), tmp_path / "shots.svg")
    assert b"<svg" in (tmp_path / "shots.svg").read_bytes()


def test_what_is_made_of_cycles_frames_takes_their_seconds() -> None:
    cycles = {("cubes", 16): point(DEFAULT, 12.0)}
    priced = shot_plot._priced(point(MEDIAN, None), cycles)
    assert priced["seconds_per_frame"] == 12.0


def test_same_picture_lies_where_the_longest_shot_puts_it() -> None:
    row = {"scene": "cubes", "motion": "pan", "samples": 16, "noise_threshold": None}
    short = {"size": "256x192", "frames": 21}
    small = {"size": "64x48", "frames": 49}
    large = {"size": "128x96", "frames": 49}
    poor = {"late_share": 0.9, "gain": -1.0, "flicker": 0.02}
    good = {"late_share": 0.25, "gain": 0.5, "flicker": 0.01}
    cases = ((short, poor), (large, good), (small, poor))
    rows = [row | x | {"method": "cycles_oidn", "flicker": 0.02} for x, _ in cases]
    rows += [row | x | result | {"method": SAME_PICTURE} for x, result in cases]
    points = [point(DEFAULT, 12.0), point(XRDS, 6.0, 2), point(XRDS, 20.0)]
    (found,) = shot_plot._sooner(rows, points)
    assert (found["seconds_per_frame"], found["psnr"]) == (8.0, 30.5)  # of 4 samples
    assert found["flicker"] == pytest.approx(0.01)
    assert (found["method"], found["radius"]) in LINES


def test_a_threshold_relates_to_even_samples_as_in_the_windows_of_both() -> None:
    what = {"scene": "cubes", "motion": "pan", "size": "64x48", "frames": 21}
    cycles = {"method": "cycles_oidn", "noise_threshold": None}
    few = {"samples": 4, "psnr": 0.0, "flicker": 1.0, "processor_seconds": 1.0}
    near = {"samples": 16, "psnr": 33.0, "flicker": 0.04, "processor_seconds": 8.0}
    many = {"samples": 64, "psnr": 40.0, "flicker": 0.01, "processor_seconds": 99.0}
    asked = {"noise_threshold": 0.1, "samples": 4096}
    far = {"psnr": 35.0, "flicker": 0.02, "processor_seconds": 24.0}
    ours = {"late_ratio": 0.5, "gain": 1.0, "flicker": 0.01}
    rows = [what | cycles | x for x in (few, near, many, asked | far)]
    rows.append(what | asked | ours | {"method": SAME_PICTURE})
    theirs, own = shot_plot._adaptive(rows, [point(DEFAULT, 12.0)])
    assert (theirs["seconds_per_frame"], theirs["psnr"]) == (36.0, 32.0)
    assert (own["seconds_per_frame"], own["psnr"]) == (18.0, 33.0)
    assert theirs["flicker"] == pytest.approx(0.01)
    assert own["flicker"] == pytest.approx(0.005)
    for found, method in ((theirs, THRESHOLD), (own, SAME_PICTURE)):
        assert found["method"] == method
        assert (method, found["radius"]) in LINES


def test_results_without_shots_are_told(tmp_path: Path) -> None:
    results = Results(tmp_path)
    nothing = {"shots": [], "settings": {"seconds_resolution": None}}
    results.__dict__.update(shots=nothing, same_picture=[])
    with pytest.raises(ValueError, match="no shots"):
        shot_plot.draw(results, tmp_path / "shots.svg")
