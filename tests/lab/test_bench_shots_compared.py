"""What a measure of shots says beside Cycles + OIDN: how sure, at equal seconds."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from xrds_lab.shots import comparison, equal_seconds, paired, verdicts
from xrds_lab.shots.bench import compared
from xrds_lab.shots.frames import REACH
from xrds_lab.shots.methods import DEFAULT, MEDIAN, XRDS

SCENES = ("car", "house", "cave", "room")


def point(scene: str, method: str, **more: Any) -> dict[str, Any]:
    radius = REACH if method == XRDS else 0
    errors = {"psnr": 30.0, "flip": 0.1, "relmse_trimmed": 0.02, "flicker": 0.02}
    shot = {"scene": scene, "motion": "pan", "samples": 2, "seconds_per_frame": None}
    return shot | {"method": method, "radius": radius, "seed": 0} | errors | more


def found(points: list[dict[str, Any]], measure: str) -> dict[str, Any]:
    entries = paired.differences(points)
    (entry,) = (e for e in entries if e["measure"] == measure)
    return entry


def pair(scene: str, gain: float, seed: int = 0, **more: Any) -> list[dict[str, Any]]:
    ours = {"psnr": 30.0 + gain, "seed": seed} | more
    return [point(scene, DEFAULT, seed=seed), point(scene, XRDS, **ours)]


# --- paired differences ---------------------------------------------------------------


def test_a_difference_is_of_the_same_scene() -> None:
    """However far scenes lie apart: only what is gained in each counts."""
    points = []
    for number, scene in enumerate(SCENES):
        level = 10.0 * number
        points += [
            point(scene, DEFAULT, psnr=20.0 + level),
            point(scene, XRDS, psnr=23.0 + level),
        ]
    gain = found(points, "psnr")
    assert (gain["mean"], gain["low"], gain["high"]) == (3.0, 3.0, 3.0)
    assert gain["scenes"] == dict.fromkeys(SCENES, 3.0)
    assert (gain["seeds"], gain["between_seeds"]) == (1, None)


def test_ratios_have_a_geometric_mean_and_the_largest_is_worst() -> None:
    points = [*pair("car", 1.0, flip=0.05), *pair("house", -0.5, flip=0.2)]
    flip, gain = found(points, "flip"), found(points, "psnr")
    assert flip["mean"] == pytest.approx(1.0)
    assert (flip["worst"], flip["worst_scene"]) == (pytest.approx(2.0), "house")
    assert (gain["worst"], gain["worst_scene"]) == (-0.5, "house")


def test_what_was_not_measured_is_left_out() -> None:
    points = [*pair("car", 1.0, flicker=None), point("house", XRDS)]
    assert {e["measure"] for e in paired.differences(points)} == {
        "psnr",
        "flip",
        "relmse_trimmed",
    }
    assert found(points, "psnr")["scenes"] == {"car": 1.0}
    assert found(points, "psnr")["low"] is None  # one scene tells nothing of others


def test_an_error_that_noise_hides_has_no_ratio() -> None:
    points = [*pair("car", 1.0, relmse_trimmed=-1e-5), *pair("house", 1.0)]
    assert found(points, "relmse_trimmed")["scenes"] == {"house": 1.0}
    assert found(points, "psnr")["scenes"] == {"car": 1.0, "house": 1.0}


def test_an_interval_is_that_of_the_mean_of_scenes() -> None:
    rng = np.random.default_rng(3)
    values = rng.normal(2.0, 1.0, 200)
    low, high = paired.interval([[x] for x in values])
    half = 1.96 * values.std() / 200**0.5
    assert low == pytest.approx(values.mean() - half, abs=0.02)
    assert high == pytest.approx(values.mean() + half, abs=0.02)
    assert paired.interval([[x] for x in values]) == (low, high)


def test_seeds_that_disagree_widen_the_interval() -> None:
    calm = [[1.0, 1.0], [1.0, 1.0], [1.0, 1.0]]
    assert paired.interval(calm) == (1.0, 1.0)
    low, high = paired.interval([[0.0, 2.0]] * 3)
    assert low < 0.6
    assert high > 1.4


def test_the_spread_between_seeds_is_within_scenes() -> None:
    points = []
    for scene, gain in (("car", 1.0), ("house", 5.0)):
        for seed in (0, 1):
            points += pair(scene, gain + seed, seed)
    gain = found(points, "psnr")
    assert gain["scenes"] == {"car": 1.5, "house": 5.5}
    assert gain["seeds"] == 2
    assert gain["between_seeds"] == pytest.approx(0.5**0.5, abs=1e-4)
    page = "\n".join(comparison.sections(compared(points)))
    assert "| pan, 2 | 2 | +3.50 (+" in page
    assert "| 0.71 |" in page


# --- who wins -------------------------------------------------------------------------


def sentences(points: list[dict[str, Any]]) -> list[str]:
    found = verdicts.verdicts(paired.differences(points))
    return [verdicts.sentence(verdict) for verdict in found]


def test_measures_that_agree_say_so() -> None:
    better = {"flip": 0.05, "relmse_trimmed": 0.01, "flicker": 0.01}
    points = [*pair("car", 1.0, **better), *pair("house", 2.0, **better)]
    assert sentences(points) == [
        "`pan`, 2: all four agree on XRDS, in every scene.",
    ]
    points[-1] |= {"flip": 0.11, "flicker": 0.03}
    assert sentences(points) == [
        "`pan`, 2: all four agree on XRDS; otherwise in house (PSNR and RelMSE for "
        "XRDS, FLIP and flicker for Cycles + OIDN).",
    ]


def test_measures_that_disagree_say_which() -> None:
    worse = {"flip": 0.2, "relmse_trimmed": 0.01, "flicker": None}
    points = pair("car", 1.0, **worse)
    assert sentences(points) == [
        "`pan`, 2: PSNR and RelMSE for XRDS, FLIP for Cycles + OIDN, in every scene.",
    ]


# --- equal seconds --------------------------------------------------------------------


def timed(scene: str, method: str, *pairs: tuple[float, float]) -> list[dict[str, Any]]:
    return [
        point(scene, method, samples=2**n, seconds_per_frame=seconds, psnr=psnr)
        for n, (seconds, psnr) in enumerate(pairs)
    ]


def test_between_points_psnr_is_linear_in_log_seconds() -> None:
    line = timed("car", DEFAULT, (1.0, 20.0), (2.0, 19.0), (4.0, 24.0))
    assert equal_seconds.psnr_at(line, 2.0) == pytest.approx(22.0)  # the frontier's
    assert equal_seconds.psnr_at(line, 1.0) == 20.0
    assert equal_seconds.psnr_at(line, 4.0) == 24.0


def test_nothing_is_extrapolated() -> None:
    line = timed("car", DEFAULT, (1.0, 20.0), (4.0, 24.0))
    assert equal_seconds.psnr_at(line, 0.9) is None
    assert equal_seconds.psnr_at(line, 4.1) is None
    assert equal_seconds.psnr_at([], 1.0) is None


def test_each_method_is_read_at_the_seconds_of_the_other() -> None:
    points = [
        *timed("car", DEFAULT, (1.0, 20.0), (4.0, 24.0)),
        *timed("car", XRDS, (0.5, 22.0), (2.0, 27.0)),
        *timed("house", DEFAULT, (1.0, 20.0), (4.0, 24.0)),
        *timed("house", XRDS, (1.0, 22.0), (8.0, 25.0)),
    ]
    known = {
        (e["scene"], e["at"], e["samples"]): e["gain"]
        for e in equal_seconds.entries(points)
    }
    assert known["car", XRDS, 1] is None  # quicker than Cycles ever was
    assert known["car", XRDS, 2] == pytest.approx(5.0)
    assert known["car", DEFAULT, 1] == pytest.approx(4.5)
    assert known["house", XRDS, 1] == pytest.approx(2.0)
    page = "\n".join(comparison.sections(compared(points)))
    assert (
        "- `pan`: at the seconds of XRDS with 2 samples (27.00 dB), Cycles + OIDN has "
        "22.00 dB: XRDS +5.00, worst +5.00 car (1 of 2 scenes; flicker 1.00 of Cycles "
        "+ OIDN's)."
    ) in page
    assert "Cycles + OIDN with 2 samples, XRDS was not timed" not in page


def test_what_others_make_of_the_same_samples_stands_beside_cycles() -> None:
    points = [
        *timed("car", DEFAULT, (1.0, 20.0), (4.0, 24.0)),
        *timed("car", XRDS, (0.5, 22.0), (8.0, 27.0)),
        point("car", MEDIAN, samples=1, psnr=20.5),
        point("car", MEDIAN, samples=2, psnr=24.2),
        point("house", MEDIAN, samples=1, psnr=10.0),
    ]
    known = {(e["at"], e["samples"]): e for e in equal_seconds.entries(points)}
    assert known[DEFAULT, 2]["peers"] == {MEDIAN: 24.2}
    assert "peers" not in known[XRDS, 2]
    assert known[DEFAULT, 1]["flicker"] == pytest.approx(1.0)
    page = "\n".join(comparison.sections(compared(points)))
    assert "; flicker 1.00 of Cycles + OIDN's); a median of three 20.50 dB." in page


def test_one_number_of_samples_has_no_equal_seconds() -> None:
    points = [*timed("car", DEFAULT, (1.0, 20.0)), *timed("car", XRDS, (0.9, 22.0))]
    assert "Equal seconds" not in "\n".join(comparison.sections(compared(points)))
