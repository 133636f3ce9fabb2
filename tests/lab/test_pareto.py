"""Frontiers, crossings and fits of the report; nothing is rendered."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from xrds_blender.planning.settings import Denoising, Network
from xrds_core.errors import Cancelled
from xrds_core.native.library import processors
from xrds_lab.bench import machine, pareto, same_picture
from xrds_lab.bench.inputs import OFF
from xrds_lab.bench.journal import MOST_KILLS, Journal
from xrds_lab.bench.stages import (
    GUIDE_DENOISER,
    PLAIN_FRAME,
    XRDS_FRAME,
    StageTimes,
    in_process_name,
    task_name,
)
from xrds_lab.bench.sweep import Config, Sweep, adaptive, anchor, anchors, xrds


def point(seconds: float, psnr: float, method: str = "oidn", **more: Any) -> Any:
    settings = {"denoiser": "HIGH-ACCURATE", "scale": 1} | more
    stages = {"total": seconds, "guides": 1.0, "beauty": seconds - 1.0}
    return {
        "scene": "car",
        "method": method,
        "settings": settings,
        "label": f"{method} {seconds:g}",
        "seconds": stages,
        "psnr": psnr,
        "relmse_trimmed": 10 ** (-psnr / 10),
    }


OIDN = [point(10, 20), point(20, 30), point(15, 19), point(40, 33)]
XRDS = [
    point(5, 22, "xrds", scale=4),
    point(12, 26, "xrds", scale=2),
]


def test_frontier_leaves_out_what_is_beaten() -> None:
    assert [p["psnr"] for p in pareto.frontier(OIDN)] == [20, 30, 33]
    falling = pareto.frontier(OIDN, "relmse_trimmed")
    assert [p["psnr"] for p in falling] == [20, 30, 33]


def test_best_within_keeps_to_the_seconds() -> None:
    assert pareto.best_within(OIDN, 19.9)["psnr"] == 20
    assert pareto.best_within(OIDN, 9.9) is None


def test_curve_is_linear_in_log_seconds() -> None:
    assert pareto.at(OIDN, 9.0) is None
    assert pareto.at(OIDN, 200**0.5) == pytest.approx(25)
    assert pareto.at(OIDN, 400.0) == 33


def test_crossings_name_who_is_better_from_where() -> None:
    found = pareto.crossings(XRDS, OIDN)
    assert [change["ours_better"] for change in found] == [True, False]
    assert found[0]["seconds"] == 5
    assert pareto.at(OIDN, found[1]["seconds"]) >= 26


def test_seconds_of_the_same_picture_are_read_off_the_rivals_frontier() -> None:
    plain = [
        point(10, 20, samples=1),
        point(40, 30, samples=4),
        point(15, 19, samples=2),
    ]
    ours = point(8, 25, "xrds", samples=16, scale=4, guide_samples=2)
    lost = point(60, 26, "full_size", samples=4)
    found = same_picture.entries("car", [*plain, ours, lost], 10.0, (0.5, 1.0, 8.0))
    assert [e["budget"] for e in found] == [1.0, 8.0]
    first, last = found
    assert first["rival_seconds"] == pytest.approx(20)  # between 10 and 40 s
    assert first["gain"] == pytest.approx(2.5)
    assert (first["samples"], first["rival_samples"]) == (3.0, pytest.approx(2.0))
    assert last["gain"] < 1
    quick = point(12, 26, "oidn_adaptive", samples=64)
    more = same_picture.entries("car", [*plain, ours, quick], 10.0, (1.0,))
    assert 10 < more[0]["rival_seconds"] < 12  # on the way to the adaptive one
    assert more[0]["rival_samples"] == first["rival_samples"]
    unreached = point(9, 31, "xrds", samples=4, scale=2)
    (none,) = same_picture.entries("cave", [*plain, unreached], 10.0, (1.0,))
    assert none["rival_seconds"] is none["gain"] is None
    assert same_picture.in_order([none, first, last]) == [last, first, none]


def test_a_picture_worse_than_any_rival_costs_the_quickest() -> None:
    assert same_picture.least(OIDN, 10.0, lambda p: p["seconds"]["total"]) == 10


def test_cached_guides_cost_nothing() -> None:
    groups = pareto.groups([*OIDN, *XRDS])
    assert [p["seconds"]["total"] for p in groups[pareto.CACHED]] == [4, 11]
    assert [p["seconds"]["total"] for p in groups["XRDS"]] == [5, 12]
    assert set(groups) >= {"XRDS x2", "XRDS x4", "OIDN, default"}
    assert "bicubic" not in groups


def test_full_size_is_one_of_our_ways() -> None:
    ours = point(7, 24, "full_size", denoiser="XRDS-HIGH")
    groups = pareto.groups([*OIDN, *XRDS, ours])
    assert groups["XRDS"] == [*XRDS, ours]
    assert groups["XRDS x1"] == [ours]
    assert ours in groups[pareto.CACHED]


def test_mean_curve_is_over_all_scenes_alike() -> None:
    scenes = {"a": (OIDN, 10.0), "b": ([point(2, 25)], 1.0)}
    curve = pareto.mean_curve(scenes)
    assert curve[0][0] >= 2  # before, the second scene has nothing
    assert curve[-1][1] == (33 + 25) / 2


# --- seconds as sums of stages --------------------------------------------------------

NETWORK = Network("fast", 2)
SWEEP = Sweep((NETWORK,))
FULL_SIZE = Config("full_size", 4, Denoising.XRDS_HIGH)


def timed(tmp_path: Path) -> StageTimes:
    """A machine where a sample takes 2 s, OIDN 5 s; the second round is slow."""
    times = StageTimes(tmp_path / "times.json")
    denoise = {"HIGH-ACCURATE": 5.0, "HIGH-FAST": 1.0}
    for slow in (1.0, 1.5, 1.0):
        for request in anchors(SWEEP.configurations()):
            each = {"plain": 2.0, "low": 0.5, "guides": 1.0, "full": 2.5}[request.kind]
            seconds = 0.1 + each * request.samples
            if request.denoiser not in {None, OFF}:
                part = denoise.get(request.denoiser, 3.0) / request.scale**2
                seconds += part
            run = {"seconds": slow * seconds, "cpu": 2 * slow * seconds, "peak": 100}
            times.add(task_name(request), run)
        for name in (PLAIN_FRAME, XRDS_FRAME):
            times.add(name, {"seconds": 9.0, "cpu": 9.0, "peak": 50, "other": 0.25})
        times.add("sync", {"seconds": 0.5, "cpu": 0.5, "peak": 10})
        name = in_process_name(xrds(NETWORK))
        times.add(name, {"seconds": 4.0, "cpu": 8.0, "peak": 300})
        ours = in_process_name(FULL_SIZE)
        times.add(ours, {"seconds": 3.0, "cpu": 6.0, "peak": 200})
        times.add(GUIDE_DENOISER, {"seconds": 2.5, "cpu": 5.0, "peak": 300})
    return times


def test_seconds_are_sums_of_the_stages_medians(tmp_path: Path) -> None:
    times = timed(tmp_path)
    plain = times.cost(Config("oidn", 16, "HIGH-ACCURATE"))
    assert plain.seconds == pytest.approx(
        {
            "sync": 0.5,
            "beauty": 40.1,  # with guides, as at scale 1
            "denoise": 4.5,
            "guides": 0.0,
            "network": 0.0,
            "other": 0.25,
            "total": 45.35,
        }
    )
    assert plain.peak_memory == 100
    own = times.cost(Config("xrds", 8, "HIGH-FAST", 2, "fast", 4))
    assert own.seconds["beauty"] == pytest.approx(4.1)
    assert own.seconds["network"] == 4.0
    assert own.seconds["denoise"] == pytest.approx(0.25)
    assert own.seconds["guides"] == pytest.approx(6.6)  # with their denoiser
    cpu = 0.5 + 0.25 + 2 * (4.1 + 0.25 + 4.1) + 8 + 5
    assert own.cpu_seconds == pytest.approx(cpu)
    assert own.peak_memory == 300


def test_the_denoised_and_scale_1_take_the_same_samples(tmp_path: Path) -> None:
    times = timed(tmp_path)
    rival = times.cost(Config("oidn", 4, Denoising.HIGH_FAST)).seconds
    assert rival["beauty"] == times.cost(FULL_SIZE).seconds["beauty"]
    bare = times.cost(Config("cycles", 4)).seconds
    assert bare["beauty"] == pytest.approx(8.1)  # without guides


def test_full_size_pays_for_its_guides_and_for_our_denoiser(tmp_path: Path) -> None:
    cost = timed(tmp_path).cost(FULL_SIZE)
    assert cost.seconds["beauty"] == pytest.approx(10.1)
    assert cost.seconds["denoise"] == 3.0
    assert cost.total == pytest.approx(0.5 + 10.1 + 3.0 + 0.25)
    assert cost.peak_memory == 200


def test_adaptive_sampling_costs_what_its_own_frames_took(tmp_path: Path) -> None:
    times = timed(tmp_path)
    config = adaptive(0.1, Denoising.HIGH_ACCURATE)
    with pytest.raises(KeyError, match=r"adaptive 0\.1"):
        times.cost(config)
    for seconds in (7.0, 9.0, 8.0):
        run = {"seconds": seconds, "cpu": 15.0, "peak": 70, "other": 0.5, "sync": 1.5}
        times.add(config.label, run)
    cost = times.cost(config)
    assert cost.total == pytest.approx(8.0)
    assert cost.seconds["beauty"] == pytest.approx(6.0)
    assert (cost.cpu_seconds, cost.peak_memory) == (15.0, 70)
    quick = times.cost(adaptive(0.1, Denoising.HIGH_FAST))
    assert quick.total == pytest.approx(8.0 - 4.0)  # its denoiser is 4 s quicker
    assert quick.cpu_seconds == pytest.approx(15.0 - 8.0)


def test_a_coarse_sweep_leaves_out_super_resolution_alone() -> None:
    networks = tuple(Network("fast", scale) for scale in (2, 4, 8))
    whole = Sweep(networks)
    every, kept = (set(x.configurations()) for x in (whole, whole.coarser()))
    assert kept < every
    assert len(kept) < len(every) / 2
    assert {c.scale for c in every - kept} == {c.scale for c in kept} - {1}


def test_adaptive_sampling_is_a_rival_of_its_own() -> None:
    found = Sweep((NETWORK,), noise_thresholds=(0.1, 0.3)).configurations()
    rivals = [c for c in found if c.method == "oidn_adaptive"]
    assert {c.noise_threshold for c in rivals} == {0.1, 0.3}
    assert len({c.key for c in rivals}) == len(rivals) == 4
    assert not [c for c in SWEEP.configurations() if c.method == "oidn_adaptive"]
    assert anchors(found) == anchors(SWEEP.configurations())
    groups = pareto.groups([*OIDN, point(7, 24, "oidn_adaptive")])
    assert groups["OIDN, best mode"] == OIDN
    assert len(groups["OIDN, adaptive sampling"]) == 1


def test_names_of_kept_errors_stay_as_they_are() -> None:
    key = Config("oidn", 4, Denoising.HIGH_FAST).key
    assert key == "oidn_4_HIGH-FAST_1_0"
    assert adaptive(0.1, Denoising.HIGH_FAST).key.endswith("_0.1")


def test_runs_are_kept(tmp_path: Path) -> None:
    before = timed(tmp_path)
    assert StageTimes(before.path).runs == before.runs


def test_a_stage_that_failed_is_told_by_its_name(tmp_path: Path) -> None:
    times = timed(tmp_path)
    del times.runs[task_name(anchor("guides", more=True))]
    with pytest.raises(KeyError, match="guides"):
        times.cost(Config("xrds", 8, "HIGH-FAST", 2, "fast", 4))
    times.cost(Config("oidn", 1, "HIGH-ACCURATE"))


# --- what fails -----------------------------------------------------------------------


def test_one_failure_does_not_end_the_run(tmp_path: Path) -> None:
    said: list[str] = []
    journal = Journal(tmp_path / "journal.json", said.append)
    with journal.attempt("one"):
        raise ValueError("no such node")
    assert journal.gives_up("one")
    assert not journal.gives_up("two")
    assert said == ["one failed and is left out: ValueError: no such node"]
    assert not Journal(journal.path, print).gives_up("one")  # the next run tries again


def test_an_interrupt_ends_the_run(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "journal.json", print)
    with pytest.raises(Cancelled), journal.attempt("one"):
        raise Cancelled
    assert not Journal(journal.path, print).kills


def test_what_kills_the_process_again_and_again_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "journal.json"
    for kills in range(MOST_KILLS):
        journal = Journal(path, print)
        assert not journal.gives_up("deadly"), kills
        journal._running = "deadly"  # and the process is gone
        journal._write()
    last = Journal(path, print)
    assert last.gives_up("deadly")
    assert "ended with its process 3 times" in last.failures["deadly"]


@pytest.mark.skipif(processors() < 2, reason="there is one core alone")
@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="not Linux")
def test_threads_are_held_to_cores_and_let_go_again() -> None:
    before = os.sched_getaffinity(0)
    with machine.only_cores(1):
        assert processors() == 1
    assert os.sched_getaffinity(0) == before
    with pytest.raises(OSError, match="cores, not 4096"), machine.only_cores(4096):
        pass


@pytest.mark.skipif(not machine.forget_peak(), reason="the system tells no peak")
def test_peak_memory_is_of_the_task_alone() -> None:
    megabytes = 64
    machine.forget_peak()
    before = machine.peak()
    del bytearray(b"x" * (megabytes << 20))[:]
    assert machine.peak() - before > megabytes << 19
    machine.forget_peak()
    assert machine.peak() - before < megabytes << 19
