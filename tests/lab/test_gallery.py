"""The gallery: its rule by numbers, and three of its shots over a few pixels."""

from __future__ import annotations

import csv
import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from PIL import Image

from xrds_blender.interface.registration import ensure_registered
from xrds_core.accumulation.accumulate import accumulate
from xrds_core.accumulation.camera import Camera, Sphere
from xrds_core.accumulation.frame import Frame, Stored, store
from xrds_core.errors import UsageError
from xrds_lab import packing
from xrds_lab.gallery import bench, crops, frames, report
from xrds_lab.gallery.bench import bench_gallery
from xrds_lab.gallery.crops import averaged
from xrds_lab.gallery.frames import Measure, Store
from xrds_lab.gallery.judge import (
    block_gains,
    block_means,
    compare,
    judge,
    unsteadiness,
)
from xrds_lab.gallery.table import CHOOSING, HALVES, JUDGING, SHOTS, TABLE, chosen

TINY = Measure(samples=(2,), reference_samples=64, size=(96, 64), middle_only=True)
FEW = ("plane_mirror", "leaf_cards_film", "stereo")
FLAT = np.full((64, 96, 3), 0.5, np.float32)
TRUTH = [FLAT, FLAT]


def off(by: float, rows: slice = slice(None), columns: slice = slice(None)) -> Any:
    """A picture that is wrong by so much in a part of it."""
    picture = FLAT.copy()
    picture[rows, columns] += by
    return picture


def test_blocks_at_the_edges_are_smaller() -> None:
    plane = np.zeros((40, 33))
    plane[32:, 32:] = 2.0
    assert block_means(plane).tolist() == [[0.0, 0.0], [0.0, 2.0]]


def test_ten_times_the_error_is_a_loss_of_ten_decibels() -> None:
    theirs, ours = np.full((32, 64), 1e-3), np.full((32, 64), 1e-3)
    ours[:, 32:] = 1e-2
    assert np.allclose(block_gains(ours, theirs, 0.0), [[0.0, -10.0]])


def test_what_nobody_sees_is_no_loss() -> None:
    verdict = compare(off(0.001), off(0.0005), TRUTH)
    assert verdict.worst > -1.0 > verdict.bare_worst
    assert verdict.bare_worst == pytest.approx(-4.973, abs=1e-3)


def test_one_bad_block_breaks_the_rule_though_the_frame_gains() -> None:
    alone = off(0.1)
    ours = off(0.02)
    ours[32:, 64:] = 0.5 + 0.15
    verdict = compare(ours, alone, TRUTH)
    assert verdict.gain > 0.0
    assert verdict.worst == pytest.approx(-3.52, abs=0.01)
    assert verdict.place == (32, 64)
    assert verdict.share == pytest.approx(1 / 6)
    assert not verdict.passed
    assert compare(off(0.02), alone, TRUTH).passed


def test_a_picture_that_is_the_same_passes() -> None:
    verdict = compare(off(0.1), off(0.1), TRUTH)
    assert (verdict.gain, verdict.worst, verdict.share) == (0.0, 0.0, 0.0)
    assert verdict.passed


def test_noise_of_the_references_does_not_count() -> None:
    dice = np.random.default_rng(1)
    noisy = [FLAT + dice.normal(0, 0.03, FLAT.shape) for _ in range(2)]
    assert compare(off(0.1), off(0.1), noisy).psnr == pytest.approx(20.0, abs=0.1)


def test_alpha_is_judged_where_the_film_is_transparent() -> None:
    opaque = np.full((64, 96, 4), 0.2, np.float32)
    opaque[..., 3] = 1.0
    assert set(judge(opaque, opaque, [opaque, opaque])) == {"colour"}
    holes = opaque.copy()
    holes[:32, :32, 3] = 0.0
    haze = holes.copy()
    haze[:32, :32, 3] = 0.1
    verdict = judge(haze, holes, [holes, holes])["alpha"]
    assert verdict.place == (0, 0)
    assert not verdict.passed


def test_what_runs_on_evenly_is_steady() -> None:
    first, second, third = (off(by) for by in (-0.5, -0.495, -0.49))
    assert unsteadiness(first, first, first) == 0.0
    assert unsteadiness(first, third, first) > 8 * unsteadiness(first, second, third)


@dataclass(frozen=True)
class Halves:
    """Stands for fields that frames may get: arrays in a dataclass of their own."""

    radiance: Any
    counts: Any


def test_frames_come_back_as_they_were_whatever_fields_they_have(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    @dataclass(frozen=True, kw_only=True)
    class More(Frame):
        halves: Halves | None = None

    monkeypatch.setattr(packing, "Frame", More)
    # half floats hold these exactly
    light = np.random.default_rng(2).integers(0, 99, (4, 5, 3)).astype(np.float32)
    camera = Camera(np.eye(4), np.eye(4), (5, 4), (1, 2), "eye", Sphere((-1, 1)))
    made = More(
        number=3,
        camera=camera,
        radiance=light,
        albedo=light,
        normal=light,
        depth=light[..., 0] + 0.1,
        samples=4,
    )
    made = replace(made, halves=Halves(light, light[..., 0].astype(np.int32)))
    back = packing.unpack(packing.pack({"left": made, "right": made}))
    assert list(back) == ["left", "right"]
    frame = back["right"]
    assert isinstance(frame, More)
    assert frame.camera.same(camera)
    assert (frame.number, frame.samples, frame.still) == (3, 4, False)
    assert frame.alpha is None
    assert np.array_equal(frame.depth, made.depth)
    assert frame.halves is not None
    assert np.array_equal(frame.halves.radiance, light)
    assert frame.halves.counts.dtype == np.int32


def grey(number: int, light: float, at: float = 0.0) -> Stored:
    """A wall of one light, three units before a camera `at` so far to the right."""
    view = np.eye(4)
    view[:3, 3] = -at, 0.0, 0.0
    project = np.diag([2.0, 2.0, -1.0, 0.0])
    project[2, 3], project[3, 2] = -0.2, -1.0
    plane = np.full((48, 64, 3), light, np.float32)
    normal = np.zeros_like(plane)
    normal[..., 2] = 1.0
    depth = np.full((48, 64), 3.0, np.float32)
    camera = Camera(view, project, (64, 48))
    return store(
        Frame(
            number=number,
            camera=camera,
            radiance=plane,
            albedo=plane,
            normal=normal,
            depth=depth,
            samples=4,
        )
    )


def test_averaged_neighbours_are_judged_by_nothing() -> None:
    own, bright = grey(1, 0.2), grey(2, 0.8)
    mean = averaged(own, [bright])
    assert mean.radiance is not None
    assert np.allclose(mean.radiance, 0.5, atol=1e-3)
    assert np.all(mean.samples == 8.0)
    judged = accumulate(own, [bright]).radiance
    assert judged is not None
    assert np.allclose(judged, 0.2, atol=0.02)


def test_averaged_neighbours_count_where_the_camera_saw_them() -> None:
    aside = averaged(grey(1, 0.2), [grey(2, 0.2, at=1.0)]).samples
    seen = (aside == 8.0).mean(axis=0)
    assert set(seen) == {0.0, 1.0}  # whole columns are out of sight
    assert 0.5 < seen.mean() < 0.9


def test_the_gallery_is_large_and_its_halves_are_alike() -> None:
    assert len(SHOTS) == len(TABLE) >= 44
    halves = [sum(shot.half == half for shot in TABLE) for half in HALVES]
    assert abs(halves[0] - halves[1]) <= 3
    assert all(shot.what.endswith(".") for shot in TABLE)
    assert len(chosen(FEW, JUDGING)) + len(chosen(FEW, CHOOSING)) == len(FEW)
    with pytest.raises(UsageError, match="no shot chair in the gallery"):
        chosen(("chair",))


@pytest.mark.nightly
def test_every_shot_can_be_built(tmp_path: Path) -> None:
    ensure_registered()
    for shot in (x for x in TABLE if not x.blur and x.name not in {"cloth"}):
        scene = shot.build(tmp_path, (48, 32))
        assert scene.camera is not None, shot.name
        assert any(thing.type == "MESH" for thing in scene.objects), shot.name
    bpy.ops.wm.read_factory_settings(use_empty=True)  # takes handlers away as well


@pytest.mark.nightly
def test_three_shots_are_rendered_judged_and_resumed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, cache = tmp_path / "out", tmp_path / "cache"
    first = bench_gallery(FEW, out, TINY, cache=cache, crops=True)
    assert first["failures"] == {}
    assert {p["shot"] for p in first["shots"]} == set(FEW)
    assert all(np.isfinite(p["worst_block"]) for p in first["shots"])
    told = json.loads((out / "results.json").read_text())
    assert "crops" not in told["shots"][0]["frames"][0]
    rows = list(csv.DictReader((out / "results.csv").open()))
    assert {row["half"] for row in rows} == set(HALVES)
    assert (out / "report.html").read_text().count("<tr") > len(FEW)
    sheet = np.asarray(Image.open(out / "crops.webp"))
    assert sheet.shape[0] > len(FEW) * crops.HEIGHT
    columns = np.array_split(sheet.astype(float), len(crops.LABELS), axis=1)
    assert np.abs(columns[1] - columns[2]).mean() > 0.5  # of 255

    def never(*_: Any) -> None:
        raise AssertionError("rendered again")

    monkeypatch.setattr(bench, "render_apart", never)
    assert bench_gallery(FEW, out, TINY, cache=cache) == first


def test_a_shot_that_fails_stops_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def broken(requests: Any, *_: Any) -> None:
        asked.append(requests[0].shot)
        raise RuntimeError("broken")

    monkeypatch.setattr(bench, "render_apart", broken)
    result = bench_gallery(FEW[:2], tmp_path, TINY)
    assert asked == list(FEW[:2])
    assert any("broken" in why for why in result["failures"].values())
    assert "Left out" in report.page(result)


def test_references_grow_in_parts(tmp_path: Path) -> None:
    shot = SHOTS["plane_mirror"]
    whole = Measure(reference_samples=2 * frames.PART_SAMPLES)
    half = replace(whole, reference_samples=frames.PART_SAMPLES)
    more, less = (m.references(shot, 5) for m in (whole, half))
    assert [len(parts) for parts in (*more, *less)] == [2, 2, 1, 1]
    assert [parts[0] for parts in more] == [parts[0] for parts in less]
    assert len({r.seed for parts in more for r in parts}) == 4
    ranks = [whole.rank(shot, r) for parts in more for r in parts]
    assert ranks == [(0, 0), (1, 0)] * 2
    store = Store(tmp_path)
    for value, part in enumerate(more[0]):
        lit = np.full((2, 2, 4), value, np.float32)
        lit[..., 3] = 1.0
        store.keep_reference(part, lit)
    mean = store.reference(more[0])
    assert mean[0, 0].tolist() == [0.5, 0.5, 0.5, 1.0]
