"""The report over one scene of a few pixels: measured, resumed, written."""

from __future__ import annotations

import csv
import importlib
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from xrds_blender import run_job
from xrds_blender.planning import budget
from xrds_blender.planning.settings import Denoising, Mode, Network, Settings
from xrds_core.errors import UsageError
from xrds_lab import metrics
from xrds_lab.bench import inputs, measure, pictures, sweep, tasks
from xrds_lab.bench.bench import bench
from xrds_lab.bench.crops import SHOWN
from xrds_lab.bench.stages import STAGES
from xrds_lab.bench.sweep import Sweep
from xrds_lab.bench.windows import find_shots

pytestmark = pytest.mark.nightly  # it takes minutes

SWEEP = Sweep(
    (Network("fast", 4),),
    plain_samples=(1, 2),
    low_samples={4: (4,)},
    guide_samples=(1, 2),
    noise_thresholds=(0.3,),
)
SIZE = (72, 52)  # that 4 does not divide: the low picture reaches beyond the frame


@pytest.fixture(autouse=True)
def few_modes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two modes of the denoiser instead of nine."""
    few = (Denoising.HIGH_ACCURATE, Denoising.HIGH_FAST)
    for module in ("sweep", "measure", "analysis"):
        user = importlib.import_module(f"xrds_lab.bench.{module}")
        for name in ("DENOISERS", "LOW_DENOISING"):
            if hasattr(user, name):
                monkeypatch.setattr(user, name, few)


class World:
    def __init__(self, folder: Path) -> None:
        self.folder, self.scene = folder, folder / "cubes.blend"

    def run(self, **options: Any) -> dict[str, Any]:
        settings = {
            "budgets": (1.0, 8.0),
            "resolution": SIZE,
            "reference_samples": 4,
            "rounds": 1,
            "sweep": SWEEP,
            "picker": False,
        }
        return bench([self.scene], self.folder / "out", **(settings | options))


@pytest.fixture
def world(tmp_path: Path, still_life: Callable[..., Any]) -> World:
    still_life()
    made = World(tmp_path)
    bpy.ops.wm.save_as_mainfile(filepath=str(made.scene))
    return made


def test_report_is_whole_and_a_second_run_measures_nothing(
    world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    # on a busy machine one stage may take many times what it takes on an idle one
    monkeypatch.setattr(measure, "MOST_OVER_BUDGET", 1e3)
    monkeypatch.setattr(sweep, "MOST_ADAPTIVE_SAMPLES", 30)
    report = world.run(picker=True, budgets=(3.0,))
    out = world.folder / "out"
    assert report["failures"] == {}
    assert json.loads((out / "results.json").read_text()) == report
    _check_points(report)
    _check_picker(report)
    with (out / "results.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["label"] for row in rows] == [p["label"] for p in report["points"]]
    _check_page((out / "report.html").read_text("utf-8"), report)

    def refuse(*_: Any) -> None:
        raise AssertionError("measured again")

    with monkeypatch.context() as patch:
        patch.setattr(metrics, "all_metrics", refuse)
        patch.setattr(pictures.Pictures, "render", lambda *_: None)
        patch.setattr(tasks, "frame", refuse)
        again = world.run(picker=True, budgets=(3.0,))
    assert again["points"] == report["points"]
    assert again["failures"] == {}
    # Nothing is left to foresee when the picker renders what nobody has rendered.
    more = world.run(picker=True, budgets=(3.0, 6.0))
    assert more["picker"]["runs"] == 2
    assert more["failures"] == {}


def _check_points(report: dict[str, Any]) -> None:
    methods = {point["method"] for point in report["points"]}
    assert methods == {
        "cycles",
        "oidn",
        "oidn_adaptive",
        "bicubic",
        "demodulated_bilinear",
        "xrds",
        "full_size",
    }
    for point in report["points"]:
        assert set(point["seconds"]) == {*STAGES, "total"}
        parts = sum(s for stage, s in point["seconds"].items() if stage != "total")
        assert parts == pytest.approx(point["seconds"]["total"])
        assert point["cpu_seconds"] > 0
        assert 5 < point["psnr"] < 80
        assert 0 < point["relmse_trimmed"] <= point["relmse"]
    (scene,) = report["scenes"]
    assert scene["frame"] == list(SIZE)
    assert scene["rho"] > 0
    assert scene["reference_psnr_floor"] > 10


def test_adaptive_sampling_stops_early_where_it_may(world: World) -> None:
    (shot,) = find_shots([world.scene], None, None, SIZE)
    counted = {}
    for threshold in (1.0, 1e-9):
        scene = inputs.open_scene(shot.path, shot.window)
        inputs.sample_adaptively(scene, 40, threshold)
        request = inputs.Request("plain", 40, 1, inputs.OFF, noise_threshold=threshold)
        arrays, _ = run_job(scene, request.render)
        counted[threshold] = arrays["radiance"]
    scene = inputs.open_scene(shot.path, shot.window)
    fixed = run_job(scene, inputs.Request("plain", 40, 1, inputs.OFF).render)[0]
    assert np.array_equal(counted[1e-9], fixed["radiance"])
    assert not np.array_equal(counted[1.0], fixed["radiance"])


def _check_picker(report: dict[str, Any]) -> None:
    (entry,) = report["budgets"]
    assert entry["picker"]["label"].startswith("XRDS")
    assert "dB expected" in entry["picker"]["reason"]
    assert report["picker"]["runs"] == 1


def _check_page(page: str, report: dict[str, Any]) -> None:
    assert page.count("<svg") >= 3  # over all, same picture, of the scene
    assert not re.search(r'(?:src|href)="(?!data:|#)', page)  # nothing beside it
    crops = re.search(r'class="crops">(.*?)</script>', page, re.DOTALL)
    assert crops is not None
    data = json.loads(crops[1])
    assert data["reference"].startswith("data:image/webp")
    labels = {c["label"] for b in data["budgets"] for c in b["columns"]}
    assert labels == set(data["pictures"])
    best = report["budgets"][0]["best"]
    assert labels == {best[name]["label"] for name in SHOWN if best.get(name)}


def test_one_bad_configuration_is_left_out_and_told(
    world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    good = pictures.Pictures.picture

    def bad(self: Any, config: Any) -> np.ndarray:
        if config.method == "bicubic":
            raise ValueError("no such picture")
        return good(self, config)

    monkeypatch.setattr(pictures.Pictures, "picture", bad)
    report = world.run(timing=False)
    assert list(report["failures"].values()) == ["ValueError: no such picture"]
    assert {p["method"] for p in report["points"]} >= {"oidn", "xrds"}
    assert (world.folder / "out" / "report.html").is_file()


def test_another_denoiser_is_measured_anew(
    world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    world.run(timing=False)
    judged: list[float] = []
    measured = metrics.all_metrics
    monkeypatch.setattr(
        metrics, "all_metrics", lambda *given: judged.append(1) or measured(*given)
    )
    world.run(timing=False)
    assert not judged
    monkeypatch.setattr(pictures, "_denoisers_code", lambda: "another")
    report = world.run(timing=False)
    ours = [p for p in report["points"] if p["method"] == "full_size"]
    assert len(judged) == len(ours) > 0


def test_the_pickers_model_is_written_and_can_be_read(world: World) -> None:
    file = world.folder / "budget.json"
    world.run(timing=False, model=file)
    model = budget.Model.read(file)
    assert model.source.startswith("mean over 1 scenes: cubes; weights: fast x4")
    plain = Settings(Mode.CYCLES_ONLY, None, Denoising.HIGH_FAST).family
    assert model.errors.curves[plain].samples == (1, 2)
    own = Settings(Mode.X4, None, Denoising.HIGH_FAST, "fast", 2)
    assert own in model.errors.curves


def test_contradictions_are_told_before_anything_is_rendered(tmp_path: Path) -> None:
    scene = tmp_path / "a.blend"
    out = tmp_path / "out"
    with pytest.raises(UsageError, match="there is no scene"):
        bench([scene], out, resolution=SIZE)
    scene.write_bytes(b"")
    with pytest.raises(UsageError, match="--windows or --resolution"):
        bench([scene], out, resolution=SIZE, windows=tmp_path / "w.json")
    with pytest.raises(UsageError, match="--windows with --references"):
        bench([scene], out, references=tmp_path)
    with pytest.raises(UsageError, match="two scenes are named a"):
        bench([scene, tmp_path / "b" / "a.blend"], out, resolution=SIZE)
