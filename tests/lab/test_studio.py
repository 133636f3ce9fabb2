"""Random scenes and the windows made of them: repeatable, aligned, taken up again."""

from __future__ import annotations

import json
import random
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

bpy = pytest.importorskip("bpy")

from xrds_blender import run_job
from xrds_core.errors import PictureError, UsageError
from xrds_lab.studio import dataset, datasheet, framing, geometry, scenes
from xrds_lab.studio.assets import Library
from xrds_lab.studio.framing import Window

pytestmark = pytest.mark.nightly  # it takes minutes

KINDS = list(scenes.RECIPES)


def fingerprint(seed: int, kind: str) -> list[object]:
    stage = scenes.build_scene(seed, None, kind)
    things = [
        (thing.name, tuple(thing.location), tuple(thing.rotation_euler), thing.type)
        for thing in stage.scene.objects
    ]
    nodes = [len(material.node_tree.nodes) for material in bpy.data.materials]
    return [things, nodes, stage.views, stage.scene.cycles.max_bounces]


@pytest.mark.parametrize("kind", KINDS)
def test_a_seed_is_a_scene(kind: str) -> None:
    first, again = fingerprint(3, kind), fingerprint(3, kind)
    assert first == again
    assert first != fingerprint(4, kind)
    assert len(first[0]) > 8
    assert first[2]


def test_seeds_give_every_kind_of_scene() -> None:
    weights = [weight for _, weight in scenes.RECIPES.values()]
    drawn = {random.Random(s).choices(KINDS, weights)[0] for s in range(60)}
    assert drawn == set(KINDS)


def test_a_folder_without_assets_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="models"):
        Library.at(tmp_path)


@pytest.mark.parametrize("origin", [(0, 0), (1664, 824), (808, 400), (8, 816)])
def test_the_border_is_the_window(origin: tuple[int, int]) -> None:
    stage = scenes.build_scene(1, None, "still")
    stage.scene.render.resolution_x, stage.scene.render.resolution_y = 1920, 1080
    framing.set_border(stage.scene, Window(*origin, 256))
    region = run_job(stage.scene, lambda passes: passes.region)
    assert (region.x, region.y) == origin
    assert (region.width, region.height) == (256, 256)


def test_windows_are_chosen_where_there_is_detail() -> None:
    detail, luminance = np.zeros((130, 230)), np.ones((130, 230))
    detail[:, :115] = 1.0
    rng = random.Random(0)
    found = framing.choose(rng, (1920, 1080), 256, 4, detail, luminance)
    assert len(found) == 4
    assert all(window.x < 960 for window in found)
    assert all(v % framing.GRID == 0 for w in found for v in (w.x, w.y))
    assert not any(a.overlaps(b) for a in found for b in found if a is not b)
    nothing = framing.choose(rng, (1920, 1080), 256, 4, 0 * detail, luminance)
    assert nothing == []
    assert framing.choose(rng, (1920, 1080), 256, 4, detail, 0 * luminance) == []


def test_black_frames_are_refused() -> None:
    frame = np.zeros((20, 30, 3))
    assert not framing.lit(frame)
    frame[3, 4] = 1000.0  # one lamp in the dark
    assert not framing.lit(frame)
    assert framing.lit(frame + 0.1)


def volume(shape: geometry.Shape) -> float:
    """Signed volume: negative where faces look inward."""
    total = 0.0
    for face in shape.faces:
        corners = shape.vertices[list(face)]
        for b, c in pairwise(corners[1:]):
            total += float(np.dot(corners[0], np.cross(b, c))) / 6
    return total


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        (geometry.box(2.0, 3.0, 4.0), 24.0),
        (geometry.cylinder(1.0, 2.0, 64), 2 * np.pi),
        (geometry.sphere(1.0, 64), 4 / 3 * np.pi),
        (geometry.torus(1.0, 0.2, 80), 2 * np.pi**2 * 0.04),
        (geometry.tube([(0, 0, 0), (0, 0, 2)], 0.5, 32), None),
    ],
)
def test_closed_shapes_look_outward(
    shape: geometry.Shape, expected: float | None
) -> None:
    found = volume(shape)
    assert found > 0
    assert expected is None or found == pytest.approx(expected, rel=0.02)
    assert len(shape.uv) == sum(len(face) for face in shape.faces)


def test_a_wall_has_its_holes() -> None:
    wall = geometry.wall(5.0, 3.0, [(1.0, 1.0, 2.0, 2.0), (3.0, 0.0, 4.0, 2.5)])
    corners = wall.vertices.reshape(-1, 4, 3)
    sides = np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1)
    heights = np.linalg.norm(corners[:, 3] - corners[:, 0], axis=1)
    assert float((sides * heights).sum()) == pytest.approx(15 - 1 - 2.5)


def test_samples_stay_in_their_ranges() -> None:
    rng = random.Random(1)
    drawn = [dataset.Samples.drawn(rng, (2, 4), 24) for _ in range(200)]
    for i, (low, high) in enumerate(dataset.Samples.LOW):
        counts = [samples.low[2, i] for samples in drawn]
        assert min(counts) == low
        assert max(counts) == high
    guides = [count for samples in drawn for count in samples.guides]
    assert (min(guides), max(guides)) == dataset.Samples.GUIDES


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("windows")
    written = make(out)
    assert written == 2
    return out


def make(out: Path) -> int:
    return dataset.generate(
        out, seed=19, count=1, window=64, views=1, windows=2, reference_samples=12
    )


def test_window_files_hold_what_training_reads(made: Path) -> None:
    paths = sorted(made.glob("validation/*.npz"))  # every tenth scene
    assert [path.name for path in paths] == ["000019_00.npz", "000019_01.npz"]
    with np.load(paths[0], allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    meta = json.loads(str(arrays.pop("meta")))
    sizes = {name: array.shape for name, array in arrays.items()}
    expected = {"reference": (64, 64, 3)}
    for letter in "ab":
        expected[f"guides_{letter}"] = (64, 64, 6)
    for scale in (2, 4, 8):
        for name in (f"low{scale}_0", f"low{scale}_1"):
            expected[name] = expected[name + "_noisy"] = (64 // scale, 64 // scale, 3)
    assert sizes == expected
    assert all(array.dtype == np.float16 for array in arrays.values())
    assert all(np.isfinite(array).all() for array in arrays.values())
    assert meta["seed"] == 19
    assert meta["reference_spp"] == 24  # twice that of the training split
    assert max(meta["frame"]) == 1920


def test_a_seed_gives_the_same_windows(made: Path, tmp_path: Path) -> None:
    """But for the last bit of a few values: Cycles' threads add in no fixed order."""
    make(tmp_path)
    for path in made.glob("*/*.npz"):
        again = tmp_path / path.relative_to(made)
        with np.load(path) as first, np.load(again) as second:
            assert set(first.files) == set(second.files)
            for name in set(first.files) - {"meta"}:  # it tells seconds
                a, b = first[name], second[name]
                assert (a == b).mean() > 0.99, name
                np.testing.assert_allclose(a, b, rtol=2e-3, atol=1e-4, err_msg=name)


def test_datasheet_counts_and_shows(made: Path, tmp_path: Path) -> None:
    found = datasheet.files(made)
    sheet = datasheet.datasheet(found)
    assert sheet["windows"] == {"validation": 2}
    assert sum(sheet["kinds"].values()) == 2
    assert sheet["scenes"] == 1
    assert sheet["mean_bytes"] > 10_000
    stages = {"low2", "low4", "low8", "guides", "reference"}
    assert set(sheet["mean_cpu_seconds"]) == stages
    assert "2 validation" in datasheet.lines(sheet)[0]
    datasheet.contact_sheet(found, tmp_path / "contact.jpg")
    with Image.open(tmp_path / "contact.jpg") as sheet:
        assert sheet.size == (datasheet.COLUMNS * datasheet.SIDE, datasheet.SIDE)
        assert np.asarray(sheet)[:, : datasheet.SIDE].std() > 1


def test_a_damaged_window_is_named(made: Path, tmp_path: Path) -> None:
    whole = next(made.glob("*/*.npz"))
    torn = tmp_path / "train" / whole.name
    torn.parent.mkdir()
    torn.write_bytes(whole.read_bytes()[:5000])
    with pytest.raises(PictureError, match=f"{torn.name} is no whole training window"):
        datasheet.files(tmp_path)


def test_a_sheet_of_nothing_is_refused(tmp_path: Path) -> None:
    assert datasheet.lines(datasheet.datasheet([]))
    with pytest.raises(UsageError, match="render some first"):
        datasheet.contact_sheet([], tmp_path / "contact.jpg")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("scale", [2, 4])
def test_low_resolution_is_the_area_mean(made: Path, scale: int) -> None:
    """The reference's means must fit best where they are, not a pixel aside."""
    path = max(made.glob("validation/*.npz"), key=contrast)
    with np.load(path) as file:
        reference = file["reference"].astype(np.float64)
        low = file[f"low{scale}_1"].astype(np.float64)
    size = len(low)
    mean = reference.reshape(size, scale, size, scale, 3).mean((1, 3))
    inner = slice(2, -2)
    shifts = [(y, x) for y in (-1, 0, 1) for x in (-1, 0, 1)]
    error = {
        shift: np.abs(np.roll(mean, shift, (0, 1)) - low)[inner, inner].mean()
        for shift in shifts
    }
    assert min(error, key=lambda shift: error[shift]) == (0, 0)
    assert low.mean() == pytest.approx(mean.mean(), rel=0.05)


def contrast(path: Path) -> float:
    with np.load(path) as file:
        picture = file["reference"].astype(np.float64)
    return float(picture.std() / picture.mean())


def test_a_finished_run_is_not_made_again(made: Path) -> None:
    before = {path: path.stat().st_mtime_ns for path in made.glob("*/*.npz")}
    assert make(made) == 0
    journal = made / dataset.JOURNAL
    journal.unlink()  # as after a crash before the end of the scene
    lost = sorted(before)[1]
    lost.unlink()
    assert make(made) == 1
    assert lost.exists()
    first = sorted(before)[0]
    assert first.stat().st_mtime_ns == before[first]
    assert not list(made.glob("*/.*"))
