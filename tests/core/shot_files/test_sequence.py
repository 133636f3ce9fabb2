"""Shots of OpenEXR files: what is read, lent, written, left out and carried on."""

from __future__ import annotations

import os
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
import sequences
import shots
from sequences import CYCLES, frame, picture, write

from xrds_core import exr

pytest.importorskip("mitsuba_oidn")

from xrds_core.accumulation.frame import store
from xrds_core.accumulation.object_motion import Movement
from xrds_core.denoising import Denoiser
from xrds_core.errors import Cancelled, NotReusable, PictureError, Unfit, UsageError
from xrds_core.finish import finish_frame
from xrds_core.shot_files.frame_file import Reading, read_frame
from xrds_core.shot_files.pass_names import PassNames
from xrds_core.shot_files.sequence import Files, denoise_sequence

NUMBERS = range(1, 6)


@pytest.fixture(scope="module")
def denoiser() -> Denoiser:
    return Denoiser("fast", "cpu", threads=1)


@pytest.fixture
def shot(tmp_path: Path) -> Path:
    """Five frames, as Cycles writes them."""
    for number in NUMBERS:
        write(tmp_path / "in", frame(number))
    return tmp_path


def denoise(shot: Path, denoiser: Denoiser, out: str = "out", **more: Any) -> Any:
    source = more.pop("source", "in/####.exr")
    files = Files(
        str(shot / source), str(shot / out / "####.exr"), **more.pop("to", {})
    )
    return denoise_sequence(files, denoiser, **more)


def finished(numbers: Any, own: int, denoiser: Denoiser) -> Any:
    """What the same frames give without files."""
    stored = {n: store(frame(n)) for n in numbers}
    near = sorted((n for n in numbers if n != own), key=lambda n: (abs(n - own), n))
    lenders = [stored[n] for n in near]
    return finish_frame(stored[own], lenders, denoiser, Movement()).picture


def test_files_give_the_picture_that_frames_in_memory_give(
    shot: Path, denoiser: Denoiser
) -> None:
    told = denoise(shot, denoiser)
    assert [entry["frame"] for entry in told["frames"]] == list(NUMBERS)
    assert told["frames"][2]["temporal"]["frames"] == tuple(NUMBERS)
    ours = picture(shot / "out" / "0003.exr")
    np.testing.assert_allclose(ours, finished(NUMBERS, 3, denoiser), atol=2e-3)
    truth = shots.view(3, frame(3).camera).colour
    denoise(shot, denoiser, "alone", radius=0)
    alone = picture(shot / "alone" / "0003.exr")
    assert np.abs(ours - truth).mean() < 0.8 * np.abs(alone - truth).mean()


def test_how_much_neighbours_count(shot: Path, denoiser: Denoiser) -> None:
    """A pass says it for each pixel, an option for all of them."""
    strength = np.ones((shots.HEIGHT, shots.WIDTH), np.float32)
    strength[:20] = 0.0
    names = CYCLES | {"strength": "ViewLayer.XRDS Strength.X"}
    for number in NUMBERS:
        weak = replace(frame(number), strength=strength)
        write(shot / "weak", weak, names)
    denoise(shot, denoiser, "alone", radius=0)
    denoise(shot, denoiser, "shared")
    denoise(shot, denoiser, "mixed", source="weak/####.exr")
    denoise(shot, denoiser, "none", strength=0.0)
    denoise(shot, denoiser, "half", strength=0.5)
    alone, shared, mixed, none, half = (
        picture(shot / name / "0003.exr")
        for name in ("alone", "shared", "mixed", "none", "half")
    )
    np.testing.assert_array_equal(mixed[:20], alone[:20])
    assert np.abs(mixed - shared)[30:].mean() < 0.5 * np.abs(alone - shared)[30:].mean()
    np.testing.assert_array_equal(none, alone)
    truth = shots.view(3, frame(3).camera).colour
    errors = [np.square(x - truth).mean() for x in (alone, half, shared)]
    assert errors == sorted(errors, reverse=True)


@pytest.mark.parametrize("strength", [-0.1, 1.1, float("nan")])
def test_what_is_no_strength(shot: Path, denoiser: Denoiser, strength: float) -> None:
    with pytest.raises(UsageError, match="must be from 0 to 1"):
        denoise(shot, denoiser, strength=strength)
    assert not (shot / "out").exists()


def test_chunks_give_the_frames_that_one_go_gives(
    shot: Path, denoiser: Denoiser
) -> None:
    """Frames beyond a chunk's ends lend, as they are there."""
    denoise(shot, denoiser, radius=2)
    for chunk in ([4, 5], [1, 2], [3]):
        denoise(shot, denoiser, "chunks", radius=2, frames=chunk)
    for number in NUMBERS:
        name = f"{number:04d}.exr"
        whole, part = (picture(shot / x / name) for x in ("out", "chunks"))
        np.testing.assert_array_equal(whole, part)


def test_a_stop_inside_a_frame_leaves_whole_files_and_a_resume_goes_on(
    shot: Path, denoiser: Denoiser
) -> None:
    parts: list[float] = []

    def stop(part: float) -> bool:
        parts.append(part)
        return part < 0.5

    with pytest.raises(Cancelled):
        denoise(shot, denoiser, radius=1, progress=stop)
    assert parts == sorted(parts)
    assert 0.4 < parts[-2] < 0.5 <= parts[-1] < 0.6  # in the third of five
    names = sorted(path.name for path in (shot / "out").iterdir())
    assert names == ["0001.exr", "0002.exr"]
    parts.clear()
    told = denoise(shot, denoiser, radius=1, resume=True, progress=parts.append)
    assert told["kept"] == [1, 2]
    assert [entry["frame"] for entry in told["frames"]] == [3, 4, 5]
    assert 0.99 < parts[-1] <= 1.0


class Counting:
    """A denoiser that tells what it was called for."""

    def __init__(self, denoiser: Denoiser) -> None:
        self.denoiser, self.pictures = denoiser, []

    def __call__(self, *passes: Any, progress: Any = None, **more: Any) -> Any:
        self.pictures.append(passes[0])
        for done in (0.0, 1.0):
            if progress is not None:
                progress(done)
        return self.denoiser(*passes, **more)


def noisy(number: int) -> Any:
    """A still camera's frame of four samples, of noise of its own."""
    made = replace(frame(1), number=number, still=True, samples=4)
    noise = np.random.default_rng(number).uniform(0.9, 1.1, made.radiance.shape)
    return replace(made, radiance=made.radiance * noise.astype(np.float32))


def test_beside_many_samples_the_picture_of_few_is_that_of_the_frame_alone(
    denoiser: Denoiser,
) -> None:
    """There denoisers keep more of the noise."""
    own, *others = (noisy(n) for n in NUMBERS)
    half = own.radiance.shape[1] // 2
    lacking = []
    for other in others:
        radiance = other.radiance.copy()
        radiance[:, half:] = np.nan
        lacking.append(store(replace(other, radiance=radiance)))
    alone = finish_frame(store(own), [], denoiser, Movement()).picture
    counting, told = Counting(denoiser), []
    shot = finish_frame(store(own), lacking, counting, Movement(), told.append)
    assert len(counting.pictures) == 2
    assert told == [0.0, 0.5, 0.5, 1.0]
    lent = shot.accumulated.samples > 4.0
    assert lent[:, : half - 4].mean() > 0.5
    beside = slice(half + 2, half + 12)
    np.testing.assert_array_equal(shot.picture[:, beside], alone[:, beside])
    assert (shot.picture[:, : half - 8] != alone[:, : half - 8]).mean() > 0.1


@pytest.mark.parametrize(
    ("samples", "width", "pictures"), [(4, 2, 2), (64, 2, 1), (64, 24, 2), (256, 6, 1)]
)
def test_thin_lines_of_few_samples_need_no_picture_of_their_own(
    samples: int, width: int, pictures: int, denoiser: Denoiser
) -> None:
    """The more samples, the wider lines a denoiser bears."""
    own, *others = (replace(noisy(n), samples=samples) for n in NUMBERS)
    for other in others:
        other.radiance[:, 20 : 20 + width] = np.nan
    counting = Counting(denoiser)
    lenders = [store(other) for other in others]
    finish_frame(store(own), lenders, counting, Movement())
    assert len(counting.pictures) == pictures


def test_where_little_is_reused_everywhere_all_of_it_counts(
    denoiser: Denoiser,
) -> None:
    own, other = (replace(noisy(n), samples=16 // n**2) for n in (1, 2))
    counting = Counting(denoiser)
    shot = finish_frame(store(own), [store(other)], counting, Movement())
    assert 16.5 < shot.accumulated.samples.mean() < 20.5
    assert len(counting.pictures) == 1
    whole = shot.accumulated
    assert whole.radiance is not None
    expected = denoiser(whole.radiance, whole.albedo, whole.normal).radiance
    np.testing.assert_array_equal(shot.picture[..., :3], expected)


def test_what_is_lent_everywhere_or_nowhere_is_denoised_once(
    denoiser: Denoiser,
) -> None:
    still = [replace(frame(1), number=n, still=True) for n in NUMBERS]
    nothing = replace(frame(2), radiance=np.full_like(frame(2).radiance, np.nan))
    for own, *others in (still, (frame(1), nothing)):
        counting = Counting(denoiser)
        lenders = [store(other) for other in others]
        finish_frame(store(own), lenders, counting, Movement())
        assert len(counting.pictures) == 1


def test_pixels_without_samples_are_no_holes_in_the_frame_alone(
    denoiser: Denoiser,
) -> None:
    own, other = frame(1), replace(frame(1), number=2)
    own.radiance[10:14, 20:24] = np.nan
    other.radiance[:, 50:] = np.nan  # so that both pictures are made
    counting = Counting(denoiser)
    finish_frame(store(own), [store(other)], counting, Movement())
    assert len(counting.pictures) == 2
    assert all(np.isfinite(x[:20, :40]).all() for x in counting.pictures)


def test_frames_of_one_seed_are_denoised_alone(
    tmp_path: Path, denoiser: Denoiser
) -> None:
    """A renderer that repeats its noise gains nothing, loses nothing, and is told."""
    noise = np.random.default_rng(7).gamma(4, 1 / 4, (*frame(1).shape, 1))
    for number in NUMBERS:
        clean = frame(number, noise=0.0)
        light = (clean.radiance * noise).astype(np.float32)
        write(tmp_path / "in", replace(clean, radiance=light))
    said: list[str] = []
    told = denoise(tmp_path, denoiser, say=said.append)
    alone = denoise(tmp_path, denoiser, "alone", radius=0)
    assert [x["temporal"]["mean_samples"] for x in told["frames"]] == [1.0] * 5
    assert [line for line in said if "exr, " not in line] == [
        "frames 1 and 2 hold the same noise, of which nothing can be reused: render "
        "each frame with a seed of its own (in Blender the clock beside the seed)"
    ]
    for one, two in zip(told["frames"], alone["frames"], strict=True):
        pair = (picture(Path(x["output"])) for x in (one, two))
        np.testing.assert_array_equal(*pair)


# --- passes and their names -----------------------------------------------------------

FLAT = {"radiance": "RGB", "albedo": "albedo.RGB", "normal": "N.XYZ", "depth": "Z"}


@pytest.mark.parametrize(
    "names",
    [
        FLAT,
        FLAT | {"depth": "depth.Z"},
        FLAT | {"radiance": "ViewLayer.Combined.RGB", "albedo": "VL.Albedo.RGB"},
        FLAT | {"position": "P.XYZ", "depth": "other.Z"},
        FLAT | {"position": "ViewLayer.Position.XYZ", "depth": "other.Z"},
    ],
    ids=lambda names: "-".join(names.values()),
)
def test_usual_names_are_known(tmp_path: Path, names: dict[str, str]) -> None:
    own = frame(1)
    view = shots.view(1, own.camera)
    point = np.where(view.name[..., None] == 0, 0.0, view.point).astype(np.float32)
    world = own.normal * [1, 1, -1] @ own.camera.view[:3, :3]
    path = write(tmp_path, own, names, normal=world, position=point)
    told = read_frame(path, 1, Reading()).stored
    expected = store(own)
    np.testing.assert_allclose(told.picture, expected.picture, atol=1e-3)
    np.testing.assert_allclose(told.inverse_depth, expected.inverse_depth, rtol=1e-5)


def test_cycles_denoising_depth_is_the_path_through_mirrors(tmp_path: Path) -> None:
    """Beside a depth; alone depth is computed from it."""
    own = replace(frame(1), path_length=np.full((48, 64), 30.0, np.float32))
    name = {"path_length": "ViewLayer.Denoising Depth.Z"}
    both = read_frame(write(tmp_path, own, CYCLES | name), 1, Reading()).stored
    np.testing.assert_array_equal(both.image, store(own).image)
    np.testing.assert_array_equal(both.inverse_depth, store(own).inverse_depth)
    assert np.isfinite(both.image).any()
    alone = {k: v for k, v in CYCLES.items() if k != "depth"}
    alone |= name
    ray = own.depth / own.camera.depth_per_length(own.shape)
    path = write(tmp_path, replace(own, path_length=ray), alone)
    told = read_frame(path, 1, Reading()).stored
    np.testing.assert_allclose(told.inverse_depth, store(own).inverse_depth, rtol=1e-5)
    assert told.image is None


def test_other_names_can_be_told(tmp_path: Path) -> None:
    names = {"radiance": "light.RGB", "albedo": "a.RGB", "normal": "n.RGB"}
    path = write(tmp_path, frame(1), names | {"depth": "far.R"})
    with pytest.raises(Unfit, match=r"no beauty .* a, far, light, n; .*--beauty"):
        read_frame(path, 1, Reading())
    told = PassNames(beauty="light", albedo="a", normal="n", depth="far")
    asked = Reading(told, normal_space="camera")
    np.testing.assert_array_equal(
        read_frame(path, 1, asked).stored.inverse_depth, store(frame(1)).inverse_depth
    )
    with pytest.raises(Unfit, match=r"no vector \(flow\)"):
        read_frame(path, 1, replace(asked, names=replace(told, vector="flow")))


def test_positions_in_camera_space(tmp_path: Path) -> None:
    own = frame(2)
    point = np.zeros((*own.shape, 3), np.float32)
    point[..., 2] = -own.depth
    names = FLAT | {"position": "P.XYZ", "depth": "other.Z"}
    path = write(tmp_path, own, names, position=point)
    told = read_frame(path, 1, Reading(position_space="camera")).stored
    np.testing.assert_allclose(told.inverse_depth, store(own).inverse_depth)


def test_a_camera_that_positions_belie_is_refused(tmp_path: Path) -> None:
    own = frame(1)
    names = FLAT | {"position": "P.XYZ"}
    moved = shots.view(1, shots.camera(x=3.0)).point
    path = write(tmp_path, own, names, position=moved)
    with pytest.raises(Unfit, match="pixels beside"):
        read_frame(path, 1, Reading())


def test_motion_of_two_channels_is_cycles_vector_of_even_motion(tmp_path: Path) -> None:
    motion = np.random.default_rng(0).normal(size=(*frame(1).shape, 2))
    path = write(tmp_path, frame(1), CYCLES | {"motion": "motion.RG"}, motion=motion)
    told = read_frame(path, 1, Reading(motion_scale=(2.0, -1.0))).stored.vector
    ahead = (motion * [2.0, -1.0]).reshape(-1, 2)
    np.testing.assert_allclose(told, -np.tile(ahead, 2), atol=1e-2)


@pytest.mark.parametrize(
    ("header", "count"),
    [({}, 16), ({"cycles.ViewLayer.samples": "64"}, 64), ({"xrds/samples": 3}, 3)],
)
def test_samples_per_pixel(tmp_path: Path, header: Any, count: int) -> None:
    path = write(tmp_path, frame(1), header=header)
    assert read_frame(path, 1, Reading(), reusable=False).stored.samples == count
    asked = read_frame(path, 1, Reading(samples=8), reusable=False)
    assert asked.stored.samples == 8


# --- what is written ------------------------------------------------------------------


def test_other_channels_and_the_header_are_carried_on(
    tmp_path: Path, denoiser: Denoiser
) -> None:
    """Of files of several parts, too; a picture keeps the number format it had."""
    own = frame(1)
    ids = np.arange(own.depth.size, dtype=np.uint32).reshape(own.depth.shape)
    half = {
        k: v.astype(np.float16)
        for k, v in sequences.planes(vars(own), {"radiance": "V.Combined.RGB"}).items()
    }
    guides = sequences.planes(vars(own), {k: CYCLES[k] for k in ("albedo", "normal")})
    about = {"type": OpenEXR.scanlineimage, "owner": "a studio"}
    parts = [
        OpenEXR.Part(dict(about), {"id": ids}, "V.ids"),
        OpenEXR.Part(dict(about), half, "V.Combined"),
        OpenEXR.Part(
            dict(about),
            {k: np.ascontiguousarray(v) for k, v in guides.items()},
            "V.guides",
        ),
    ]
    OpenEXR.File(parts).write(str(tmp_path / "1.exr"))
    files = Files(str(tmp_path / "1.exr"), str(tmp_path / "out.exr"))
    denoise_sequence(files, denoiser)
    old, new = (exr.File(path) for path in (tmp_path / "1.exr", tmp_path / "out.exr"))
    assert [part.name for part in new.parts] == ["V.ids", "V.Combined", "V.guides"]
    assert all(part.attributes["owner"] == "a studio" for part in new.parts)
    assert new.names.names.keys() == old.names.names.keys()
    for name in old.names.names:
        assert new.pixels(name).dtype == old.pixels(name).dtype
        same = np.array_equal(new.pixels(name), old.pixels(name))
        assert same != ("Combined" in name)


def test_the_picture_alone(shot: Path, denoiser: Denoiser) -> None:
    denoise(shot, denoiser, frames=[3])
    denoise(shot, denoiser, "alone", frames=[3], to={"picture_only": True})
    file = exr.File(shot / "alone" / "0003.exr")
    assert set(file.names.names) == set("RGB")
    assert "worldToCamera" in file.parts[0].attributes
    np.testing.assert_array_equal(
        picture(shot / "alone" / "0003.exr"), picture(shot / "out" / "0003.exr")
    )


@pytest.mark.parametrize(
    ("window", "shape"),
    [((-8, -6), (60, 80)), ((10, 4), (30, 40)), ((-8, 10), (30, 60))],
    ids=["overscan", "cropped", "both"],
)
def test_data_windows(
    tmp_path: Path, denoiser: Denoiser, window: tuple[int, int], shape: tuple[int, int]
) -> None:
    """A picture keeps its window; what lies beyond the display window lends, too."""
    for number in NUMBERS:
        write(tmp_path / "in", frame(number, window=window, shape=shape))
    told = denoise(tmp_path, denoiser)
    path = tmp_path / "out" / "0003.exr"
    (part,) = exr.File(path).parts
    (left, top), (right, bottom) = part.data_window
    assert (left, top) == window
    assert (bottom - top + 1, right - left + 1) == shape
    assert part.display_window == sequences.WINDOW
    stored = {n: store(frame(n, window=window, shape=shape)) for n in NUMBERS}
    others = [stored[n] for n in (2, 4, 1, 5)]
    expected = finish_frame(stored[3], others, denoiser, Movement())
    assert told["frames"][2]["temporal"]["mean_samples"] > 1.5
    inside = (slice(8, -8), slice(8, -8))  # the denoiser looks beyond a crop's edges
    difference = np.abs(picture(path) - expected.picture)[inside]
    assert np.median(difference) < 2e-3


CROP = ((24, 8), (55, 39))


def test_a_crop_is_the_picture_of_that_place(shot: Path, denoiser: Denoiser) -> None:
    """All channels of all parts are of it; the window of the whole picture stays."""
    denoise(shot, denoiser, frames=[3])
    denoise(shot, denoiser, "crop", frames=[3], to={"crop": CROP})
    file = exr.File(shot / "crop" / "0003.exr")
    (part,) = file.parts
    assert (part.data_window, part.display_window) == (CROP, sequences.WINDOW)
    place = (slice(8, 40), slice(24, 56))
    whole = exr.File(shot / "out" / "0003.exr")
    for name in set(file.names.names) - set("RGB"):
        np.testing.assert_array_equal(file.pixels(name), whole.pixels(name)[place])
    inside = picture(shot / "out" / "0003.exr")[place]
    # the library judges the exposure by what it is given
    ours = np.stack([file.pixels(x) for x in "RGB"], -1)
    assert np.abs(ours - inside).mean() < 0.01 * inside.mean()


def test_a_crop_of_the_picture_alone(shot: Path, denoiser: Denoiser) -> None:
    to = {"crop": CROP, "picture_only": True}
    denoise(shot, denoiser, "alone", frames=[3], to=to)
    (part,) = exr.File(shot / "alone" / "0003.exr").parts
    assert set(part.channels) == set("RGB")
    assert part.data_window == CROP


def test_another_crop_is_not_resumed_from(shot: Path, denoiser: Denoiser) -> None:
    for crop, kept in ((CROP, []), (CROP, [3]), (None, []), (CROP, [])):
        told = denoise(shot, denoiser, frames=[3], to={"crop": crop}, resume=True)
        assert told["kept"] == kept


def test_a_crop_outside_of_the_picture(shot: Path, denoiser: Denoiser) -> None:
    to = {"crop": ((50, 8), (90, 39))}
    with pytest.raises(PictureError, match="crop lies outside"):
        denoise(shot, denoiser, frames=[2, 3], to=to)
    assert not list((shot / "out").iterdir())


@pytest.mark.parametrize("name", ["a.{:04d}.exr", "a.{:05d}.exr"])
def test_frames_below_zero(tmp_path: Path, denoiser: Denoiser, name: str) -> None:
    """As C names them and as Blender does; above zero both are the same."""
    for number in (-1, 0, 1):
        path = write(tmp_path / "in", frame(number))
        width = name if number < 0 else "a.{:04d}.exr"
        path.rename(path.with_name(width.format(number)))
    told = denoise(tmp_path, denoiser, source="in/a.####.exr")
    lent = {x["frame"]: x["temporal"]["frames"] for x in told["frames"]}
    assert lent == dict.fromkeys((-1, 0, 1), (-1, 0, 1))
    assert not told["left_out"]


def test_files_with_other_digits_are_told(shot: Path, denoiser: Denoiser) -> None:
    (shot / "in" / "0005.exr").rename(shot / "in" / "00005.exr")
    said: list[str] = []
    told = denoise(shot, denoiser, say=said.append)
    assert [x["frame"] for x in told["frames"]] == [1, 2, 3, 4]
    assert "1 files have another number of digits" in said[0]
    assert "00005.exr" in said[0]


@pytest.mark.parametrize(
    "way", ["%04d", "%d", "$F4", "$F", "*", "????", "<frame>", "<f4>", "{frame}", "@@@"]
)
@pytest.mark.parametrize("which", ["source", "output", "halves", "also"])
def test_other_ways_to_write_a_frame_number_are_told(
    shot: Path, denoiser: Denoiser, way: str, which: str
) -> None:
    pattern = str(shot / "in" / f"a.{way}.exr")
    given = {"source": "in/####.exr", "output": "out/####.exr"}
    files = Files(**{k: str(shot / v) for k, v in given.items()})
    files = replace(files, **{which: (pattern,) if which == "also" else pattern})
    with pytest.raises(UsageError, match=r"is written ####, not .*give a\.####\.exr$"):
        denoise_sequence(files, denoiser)


# --- frames that are not as they should be --------------------------------------------


def damage(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-500])


def shrink(path: Path) -> None:
    small = frame(int(path.stem), shape=(24, 32))
    camera = replace(small.camera, size=(32, 24))
    height, width = small.shape
    window = ((0, 0), (width - 1, height - 1))
    channels = sequences.planes(vars(small), CYCLES)
    header = sequences.cameras.to_header(camera)
    exr.write_part(path, exr.Part("", window, window, channels, header))


def without_guides(path: Path) -> None:
    write(path.parent, frame(int(path.stem)), {"radiance": CYCLES["radiance"]})


def without_camera(path: Path) -> None:
    write(path.parent, frame(int(path.stem)), header={})


@pytest.mark.parametrize(
    ("harm", "line", "is_left_out"),
    [
        (Path.unlink, "left out for lack of a file, .*0003.exr: frames 3$", True),
        (damage, "frame 3 is left out: .* is not a complete OpenEXR file", True),
        (without_guides, "frame 3 is left out: .* has no albedo", True),
        (without_camera, "frame 3 is denoised by itself: .* has no camera", False),
        (shrink, "share no samples: their sizes are", False),
    ],
)
def test_a_bad_frame_is_told_and_the_others_go_on(
    shot: Path, denoiser: Denoiser, harm: Any, line: str, is_left_out: bool
) -> None:
    harm(shot / "in" / "0003.exr")
    said: list[str] = []
    told = denoise(shot, denoiser, frames=NUMBERS, say=said.append)
    (about,) = [x for x in said if "exr, " not in x]
    assert re.search(line, about)
    done = [entry["frame"] for entry in told["frames"]]
    assert done == [1, 2, 4, 5] if is_left_out else list(NUMBERS)
    assert [x["frame"] for x in told["left_out"]] == [3] * is_left_out
    lent = {e["frame"]: e["temporal"]["frames"] for e in told["frames"]}
    assert lent[2] == (1, 2, 4, 5)
    ours = picture(shot / "out" / "0002.exr")
    expected = finished([1, 2, 4, 5], 2, denoiser)
    np.testing.assert_allclose(ours, expected, atol=2e-3)


def test_what_the_first_frame_lacks_ends_the_work(
    shot: Path, denoiser: Denoiser
) -> None:
    for path in (shot / "in").iterdir():
        without_camera(path)
    with pytest.raises(NotReusable, match=r"has no camera; give --camera .*-radius 0"):
        denoise(shot, denoiser)
    assert not list((shot / "out").iterdir())
    told = denoise(shot, denoiser, radius=0)
    assert len(told["frames"]) == 5


def test_nothing_to_do(tmp_path: Path, denoiser: Denoiser) -> None:
    with pytest.raises(PictureError, match="no file is called"):
        denoise(tmp_path, denoiser)
    with pytest.raises(PictureError, match=r"no frame can be read: no .*0001\.exr"):
        denoise(tmp_path, denoiser, frames=[1, 2, 3])


def test_nan_in_one_frame_reaches_no_picture(shot: Path, denoiser: Denoiser) -> None:
    bad = frame(3)
    radiance, depth = bad.radiance.copy(), bad.depth.copy()
    radiance[10:14, 10:20], depth[20:24, 30:40] = np.nan, np.nan
    write(shot / "in", replace(bad, radiance=radiance, depth=depth))
    denoise(shot, denoiser)
    for number in NUMBERS:
        ours = picture(shot / "out" / f"{number:04d}.exr")
        assert np.isfinite(ours).all()
        truth = shots.view(number, frame(number).camera).colour
        assert np.abs(ours - truth).mean() < 0.05


def test_frames_of_another_render_lend_nothing(shot: Path, denoiser: Denoiser) -> None:
    for number in (4, 5):
        own = frame(number)
        told = {**sequences.cameras.to_header(own.camera), "xrds/key": "other"}
        write(shot / "in", own, header=told)
    said: list[str] = []
    told = denoise(shot, denoiser, say=said.append)
    lent = [entry["temporal"]["frames"] for entry in told["frames"]]
    assert lent == [(1, 2, 3)] * 3 + [(4, 5)] * 2
    assert sum("other settings" in line for line in said) == 2


# --- resuming -------------------------------------------------------------------------


def test_resume_makes_what_is_missing_the_same(shot: Path, denoiser: Denoiser) -> None:
    denoise(shot, denoiser)
    out = shot / "out"
    whole = {path.name: path.read_bytes() for path in out.iterdir()}
    (out / "0002.exr").unlink()
    damage(out / "0004.exr")
    kept = (out / "0003.exr").stat().st_mtime_ns
    told = denoise(shot, denoiser, resume=True)
    assert told["kept"] == [1, 3, 5]
    assert {path.name: path.read_bytes() for path in out.iterdir()} == whole
    assert (out / "0003.exr").stat().st_mtime_ns == kept
    assert not denoise(shot, denoiser, resume=True)["frames"]


def test_resume_takes_samples_that_came_late(shot: Path, denoiser: Denoiser) -> None:
    denoise(shot, denoiser, radius=1)
    late = (shot / "out" / "0005.exr").stat().st_mtime + 10
    os.utime(shot / "in" / "0004.exr", (late, late))
    told = denoise(shot, denoiser, radius=1, resume=True)
    assert [entry["frame"] for entry in told["frames"]] == [3, 4, 5]
    assert told["kept"] == [1, 2]


def late(shot: Path) -> dict[str, Any]:
    """A neighbour that comes with a time older than the outputs'."""
    (shot / "held.exr").rename(shot / "in" / "0004.exr")
    return {}


def replaced(shot: Path) -> dict[str, Any]:
    """Another file of the same size and time."""
    path = shot / "in" / "0004.exr"
    status = path.stat()
    write(shot / "in", frame(4), header={"xrds/samples": 2})
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))
    return {}


@pytest.mark.parametrize(
    ("change", "anew"),
    [
        (late, [3, 4, 5]),
        (replaced, [3, 4, 5]),
        (lambda shot: {"radius": 0}, [1, 2, 3, 4, 5]),
        (lambda shot: {"strength": 0.5}, [1, 2, 3, 4, 5]),
        (lambda shot: {"reading": Reading(samples=64)}, [1, 2, 3, 4, 5]),
        (lambda shot: {"reading": Reading(normal_space="world")}, [1, 2, 3, 4, 5]),
        (lambda shot: {"to": {"picture_only": True}}, [1, 2, 3, 4, 5]),
        (lambda shot: {"to": {"crop": CROP}}, [1, 2, 3, 4, 5]),
        (lambda shot: {}, []),
    ],
)
def test_resume_makes_anew_what_would_differ(
    shot: Path, denoiser: Denoiser, change: Any, anew: list[int]
) -> None:
    """And no more; at the end all is as a run from nothing makes it."""
    if change is late:
        (shot / "in" / "0004.exr").rename(shot / "held.exr")
    denoise(shot, denoiser, radius=1)
    more = {"radius": 1, **change(shot)}
    said: list[str] = []
    to = more.get("to", {})
    told = denoise(shot, denoiser, resume=True, say=said.append, **more)
    assert [x["frame"] for x in told["frames"]] == anew
    line = "made anew, as they are damaged or were made with other settings"
    assert sum(line in x for x in said) == bool(anew)
    denoise(shot, denoiser, "nothing", **{**more, "to": to})
    for path in (shot / "nothing").iterdir():
        assert path.read_bytes() == (shot / "out" / path.name).read_bytes()


def test_an_input_that_is_replaced_in_work_spoils_no_frame(
    shot: Path, denoiser: Denoiser, monkeypatch: pytest.MonkeyPatch
) -> None:
    def finish(own: Any, *rest: Any, **more: Any) -> Any:
        if own.number == 3:
            write(shot / "in", frame(3, noise=0.7))
        return finish_frame(own, *rest, **more)

    monkeypatch.setattr("xrds_core.shot_files.sequence.finish_frame", finish)
    said: list[str] = []
    told = denoise(shot, denoiser, say=said.append)
    assert [x["frame"] for x in told["left_out"]] == [3]
    assert sum("was replaced while it was in work" in x for x in said) == 1
    assert not (shot / "out" / "0003.exr").exists()
    monkeypatch.undo()
    assert not denoise(shot, denoiser, resume=True)["kept"]  # all had its old samples


def test_what_made_a_frame_stands_in_it(shot: Path, denoiser: Denoiser) -> None:
    denoise(shot, denoiser, radius=1)
    (told,) = exr.attributes(shot / "out" / "0003.exr")
    told = {k: v for k, v in told.items() if k.startswith("xrds.")}
    assert told.pop("xrds.version")
    assert len(told.pop("xrds.made_of")) == 32
    assert told == {
        "xrds.mode": "denoised",
        "xrds.preset": "fast",
        "xrds.samples": "1",
        "xrds.frames": "2 to 4",
    }


@pytest.mark.parametrize("option", ["halves", "also"])
@pytest.mark.parametrize(
    ("pattern", "message"),
    [
        ("in/0001.exr", "is one file for all frames; add ####"),
        ("in/####.exr", "is the frame itself"),
        ("link/####.exr", "is the frame itself"),
    ],
)
def test_halves_are_other_files(
    shot: Path, denoiser: Denoiser, option: str, pattern: str, message: str
) -> None:
    (shot / "link").symlink_to(shot / "in")
    given = str(shot / pattern)
    to = {option: (given,) if option == "also" else given}
    with pytest.raises(UsageError, match=message):
        denoise(shot, denoiser, to=to)


def test_a_frame_says_how_long_the_others_will_take(
    shot: Path, denoiser: Denoiser
) -> None:
    said: list[str] = []
    denoise(shot, denoiser, say=said.append)
    assert "4 left, about " in said[0]
    assert "left" not in said[-1]


@pytest.mark.parametrize(
    ("output", "error"),
    [("out.exr", UsageError), ("o_#.png", UsageError), ("in/####.exr", PictureError)],
)
def test_outputs_that_cannot_be(
    shot: Path, denoiser: Denoiser, output: str, error: type[Exception]
) -> None:
    before = (shot / "in" / "0001.exr").read_bytes()
    files = Files(str(shot / "in" / "####.exr"), str(shot / output))
    with pytest.raises(error):
        denoise_sequence(files, denoiser)
    assert (shot / "in" / "0001.exr").read_bytes() == before
