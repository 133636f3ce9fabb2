"""Shots with headers, cameras, channels and windows that nobody should have written."""

from __future__ import annotations

import json
import os
import re
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import hostile
import numpy as np
import OpenEXR
import pytest
import sequences
from sequences import CYCLES, frame, picture, write

from xrds_core import exr

pytest.importorskip("mitsuba_oidn")

from xrds_core import files
from xrds_core.denoising import Denoiser
from xrds_core.errors import NotReusable, PictureError, Unfit, UsageError
from xrds_core.frames import in_words
from xrds_core.shot import Shot
from xrds_core.shot_files import cameras
from xrds_core.shot_files.frame_file import Reading, read_frame
from xrds_core.shot_files.sequence import Files, denoise_sequence

PLAIN = {"radiance": "RGB", "albedo": "albedo.RGB", "normal": "N.XYZ", "depth": "Z"}
on_posix = pytest.mark.skipif(os.name == "nt", reason="such files are POSIX'")


@pytest.fixture(scope="module")
def denoiser() -> Denoiser:
    return Denoiser("fast", "cpu", threads=1)


@pytest.fixture(autouse=True)
def no_warnings() -> Iterator[None]:
    """NumPy's own lines are no lines for a user."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        yield


def denoise(shot: Path, denoiser: Denoiser, **more: Any) -> tuple[Any, list[str]]:
    """Denoise IN to OUT; returns what is told, and the lines that were said."""
    said: list[str] = []
    source, output = more.pop("source", "in/####.exr"), more.pop("output", "out/#.exr")
    to = Files(str(shot / source), str(shot / output), **more.pop("to", {}))
    return denoise_sequence(to, denoiser, say=said.append, **more), said


def shot(folder: Path, count: int = 3, **header: Any) -> Path:
    """A shot whose second frame has other attributes."""
    for number in range(1, count + 1):
        own = frame(number)
        told = {**cameras.to_header(own.camera), "xrds/samples": 1}
        if number == 2:
            told = {k: v for k, v in (told | header).items() if v is not None}
        write(folder / "in", own, header=told)
    return folder


# --- headers --------------------------------------------------------------------------

SINGULAR = np.zeros((4, 4)).tolist()
FLAT = np.diag([1.0, 1.0, 0.0, 1.0]).tolist()
HUGE = np.diag([1e30, 1e30, 1e30, 1.0]).tolist()
ON_ITS_SIDE = [[1.0, 0, 0, 5], [0, 1.0, 0, 0], [0, 0, 1.0, 2], [0, 0, 0, 1.0]]


@pytest.mark.parametrize(
    ("header", "reason"),
    [
        ({"xrds/sphere": 3}, "3 are not west, east, south and north in radians"),
        ({"xrds/sphere": "-3 3 1"}, "are not west, east, south and north"),
        ({"xrds/sphere": "a b c d"}, "are not west, east, south and north"),
        ({"xrds/sphere": "nan 3 -1 1"}, "are not west, east, south and north"),
        ({"xrds/sphere": "0 0 0 0"}, "is a panorama without an extent"),
        ({"xrds/sphere": "-3 3 1 1"}, "is a panorama without an extent"),
        ({"worldToCamera": SINGULAR}, "a matrix is no placement"),
        ({"worldToCamera": FLAT}, "a matrix has no inverse"),
        ({"worldToCamera": HUGE}, "in a matrix .* is no number from"),
        ({"worldToCamera": ON_ITS_SIDE}, "it may lie on its side"),
        ({"worldToCamera": "west"}, "has not 4 rows of 4 numbers"),
        ({"xrds/project": SINGULAR}, "no projection to OpenGL's clip space"),
        ({"xrds/project": "wide"}, "has not 4 rows of 4 numbers"),
        ({"xrds/project": None, "worldToNDC": SINGULAR}, "matrices are no camera's"),
    ],
)
def test_a_frame_whose_camera_is_none_is_denoised_by_itself(
    tmp_path: Path, denoiser: Denoiser, header: Any, reason: str
) -> None:
    told, said = denoise(shot(tmp_path, **header), denoiser)
    assert [each["frame"] for each in told["frames"]] == [1, 2, 3]
    line = f"^frame 2 is denoised by itself: .*camera cannot be used .*{reason}"
    assert sum(bool(re.search(line, x)) for x in said) == 1
    assert told["frames"][0]["temporal"]["frames"] == (1, 3)
    path = tmp_path / "in" / "0002.exr"
    assert not read_frame(path, 2, Reading(), reusable=False).reusable  # radius 0 helps


@pytest.mark.parametrize(
    ("value", "count"),
    [(3, 3), ("64", 64), (4.0, 4), ("²", 16), ("9" * 400, 16), ("9" * 5000, 16)]
    + [(2.5, 2.5)]  # the mean of pixels that took as many as they needed
    + [(x, 16) for x in ("", "-3", "1e9", -1, 0, 0.5, np.inf, np.eye(4).tolist())],
)
def test_samples_are_told_by_counts_and_means(
    tmp_path: Path, value: Any, count: int
) -> None:
    path = write(tmp_path, frame(1), header={"xrds/samples": value})
    assert read_frame(path, 1, Reading(), reusable=False).stored.samples == count


@pytest.mark.parametrize(
    ("value", "radius"),
    [(2, 2), ("7", 7), (0, 0), (32, 32)]
    + [(x, None) for x in (33, 2**31 - 1, -1, 1.5, "far", float("nan"), SINGULAR)],
)
def test_a_radius_is_recommended_by_small_numbers_alone(
    tmp_path: Path, value: Any, radius: int | None
) -> None:
    path = write(tmp_path, frame(1), header={"xrds/radius": value, "xrds/still": "no"})
    told = read_frame(path, 1, Reading(), reusable=False)
    assert told.radius == radius
    assert not told.stored.still


def test_one_bad_frame_at_the_start_does_not_end_the_work(
    tmp_path: Path, denoiser: Denoiser
) -> None:
    shot(tmp_path)
    write(tmp_path / "in", frame(1), {"radiance": CYCLES["radiance"]})
    told, said = denoise(tmp_path, denoiser)
    assert [each["frame"] for each in told["frames"]] == [2, 3]
    assert [each["frame"] for each in told["left_out"]] == [1]
    assert "frame 1 is left out" in said[0]
    write(tmp_path / "in", frame(2), {"radiance": CYCLES["radiance"]})
    with pytest.raises(Unfit, match=r"0001\.exr has no albedo"):
        denoise(tmp_path, denoiser)


def test_a_shot_in_which_nothing_is_lent_says_so(
    tmp_path: Path, denoiser: Denoiser
) -> None:
    for number in (1, 2, 3):
        own = frame(number)
        away = replace(own, depth=own.depth * np.float32(10.0**number))
        write(tmp_path / "in", away)
    _, said = denoise(tmp_path, denoiser)
    assert sum("no frame reused samples of another" in line for line in said) == 1
    _, said = denoise(shot(tmp_path), denoiser)
    assert not any("no frame reused" in line for line in said)


def test_a_position_pass_beside_its_camera_is_no_matter_alone(
    tmp_path: Path, denoiser: Denoiser
) -> None:
    moved = sequences.shots.view(1, sequences.shots.camera(x=3.0)).point
    names = CYCLES | {"position": "Position.XYZ"}
    names.pop("depth")
    write(tmp_path / "in", frame(1), names, position=moved)
    with pytest.raises(NotReusable, match=r"pixels beside .* or --temporal-radius 0"):
        denoise(tmp_path, denoiser)
    assert len(denoise(tmp_path, denoiser, radius=0)[0]["frames"]) == 1


# --- files of cameras -----------------------------------------------------------------

PLACE = np.eye(4).tolist()


@pytest.mark.parametrize(
    "told",
    [
        "[" * 2000 + "]" * 2000,
        {"to_world": [[10**400] * 4] * 4, "focal_length": 35},
        {"to_world": PLACE, "project": [[10**400] * 4] * 4},
        {"to_world": PLACE, "project": np.eye(4)[::-1].tolist()},
        {"to_world": PLACE, "focal_length": 10**400},
        {"to_world": PLACE, "focal_length": 35, "shift": [10**400, 0]},
        {"to_world": PLACE, "focal_length": 35, "shift": 1},
        {"to_world": PLACE, "focal_length": 35, "sensor_width": 0},
        {"to_world": PLACE, "focal_length": 0},
        {"to_world": PLACE, "focal_length": "35"},
        {"to_world": PLACE, "ortho_width": 0},
        {"to_world": PLACE, "ortho_width": float("nan")},
        {"to_world": SINGULAR, "focal_length": 35},
        {"to_world": ON_ITS_SIDE[::-1], "focal_length": 35},
        [],
        None,
    ],
    ids=lambda told: str(told)[-40:],
)
def test_cameras_that_are_none_are_told_in_one_line(tmp_path: Path, told: Any) -> None:
    path = tmp_path / "cameras.json"
    text = told if isinstance(told, str) else json.dumps({"1": told})
    path.write_text(text)
    with pytest.raises(
        UsageError, match=r"cameras\.json is no file of cameras"
    ) as error:
        cameras.read_cameras(path)
    assert len(str(error.value)) < 300


@on_posix
def test_a_pipe_of_cameras_is_read_and_not_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pipe, text = tmp_path / "pipe", json.dumps({"all": {"to_world": PLACE}}).encode()
    os.mkfifo(pipe)

    def write_late() -> None:
        with pipe.open("wb", buffering=0) as stream:
            for half in (text[:20], text[20:]):
                time.sleep(0.2)
                stream.write(half)

    writer = threading.Thread(target=write_late)
    writer.start()
    assert files.read_stream(pipe, 1 << 20) == text
    writer.join()
    monkeypatch.setattr(files, "_WAIT", 0.2)
    with pytest.raises(UsageError, match="nobody writes into this pipe"):
        cameras.read_cameras(pipe)


@on_posix
def test_an_endless_file_of_cameras_takes_no_memory() -> None:
    with pytest.raises(UsageError, match="/dev/zero: it holds more than 1 MB"):
        files.read_stream(Path("/dev/zero"), 1 << 20)


# --- channels, levels and windows -----------------------------------------------------


def planes(**more: Any) -> dict[str, Any]:
    return {**sequences.planes(vars(frame(1)), PLAIN), **more}


@pytest.mark.parametrize("levels", [1, 2])
def test_what_has_levels_is_written_with_one(
    tmp_path: Path, denoiser: Denoiser, levels: int
) -> None:
    hostile.write_odd_exr(tmp_path / "1.exr", planes(), levels=levels)
    denoise(tmp_path, denoiser, source="1.exr", output="o.exr")
    assert not np.array_equal(picture(tmp_path / "o.exr"), picture(tmp_path / "1.exr"))
    other = exr.File(tmp_path / "o.exr").pixels("albedo.G")
    np.testing.assert_array_equal(other, planes()["albedo.G"])


def test_a_subsampled_channel_is_carried_on(tmp_path: Path, denoiser: Denoiser) -> None:
    small = np.arange(24 * 32, dtype=np.float32).reshape(24, 32)
    hostile.write_odd_exr(tmp_path / "1.exr", planes(chroma=small))
    denoise(tmp_path, denoiser, source="1.exr", output="o.exr")
    carried = exr.File(tmp_path / "o.exr").pixels("chroma")
    np.testing.assert_array_equal(carried, small.repeat(2, 0).repeat(2, 1))


def test_a_picture_of_integers_becomes_one_of_floats(
    tmp_path: Path, denoiser: Denoiser
) -> None:
    counts = {f"Combined.{x}": np.zeros((48, 64), np.uint32) for x in "RGB"}
    noisy = {f"Noisy Image.{x}": planes()[x] for x in "RGB"}
    rest = {k: v for k, v in planes().items() if k not in "RGB"}
    OpenEXR.File({"type": OpenEXR.scanlineimage}, {**counts, **noisy, **rest}).write(
        str(tmp_path / "1.exr")
    )
    denoise(tmp_path, denoiser, source="1.exr", output="o.exr")
    result = picture(tmp_path / "o.exr", "Combined")
    assert result.dtype == np.float32
    assert 0.1 < result.mean() < 1.0


def test_a_lone_channel_beside_a_noisy_picture(
    tmp_path: Path, denoiser: Denoiser
) -> None:
    own = planes()
    noisy = {f"Noisy Image.{x}": own.pop(x) for x in "RGB"}
    exr.write_picture(tmp_path / "1.exr", {**own, **noisy, "R": own["Z"]})
    denoise(tmp_path, denoiser, source="1.exr", output="o.exr")
    assert 0.1 < picture(tmp_path / "o.exr").mean() < 1.0


def test_a_picture_in_several_parts_is_refused(
    tmp_path: Path, denoiser: Denoiser
) -> None:
    own = planes()
    places = [{f"V.Combined.{x}": own.pop(x)} for x in "RGB"] + [own]
    about = {"type": OpenEXR.scanlineimage}
    parts = [OpenEXR.Part(dict(about), x, f"p{i}") for i, x in enumerate(places)]
    OpenEXR.File(parts).write(str(tmp_path / "1.exr"))
    with pytest.raises(Unfit, match=r"V\.Combined\.B in several parts; save them in"):
        denoise(tmp_path, denoiser, source="1.exr", output="o.exr")


@pytest.mark.parametrize(
    ("data", "display", "message"),
    [
        ((30000, 30000), (0, 0, 63, 47), "claims .* GB of pixels"),
        ((0, 0), (-30000, -30000, 63, 47), "claims .* GB of pixels"),
        ((2**30, 0), (-(2**30), 0, -(2**30) + 9, 9), "not a complete OpenEXR file"),
    ],
)
def test_windows_far_apart_are_refused_before_memory_is_taken(
    tmp_path: Path, data: Any, display: Any, message: str
) -> None:
    path = tmp_path / "1.exr"
    hostile.write_odd_exr(path, planes(), data=data, display=display)
    with pytest.raises(PictureError, match=message):
        read_frame(path, 1, Reading(), reusable=False)


def test_a_crop_of_a_huge_picture_lends_where_it_is_asked_to(tmp_path: Path) -> None:
    path = tmp_path / "1.exr"
    hostile.write_odd_exr(path, planes(), display=(0, 0, 3999, 3999))
    with pytest.raises(NotReusable, match=r"few of the 4000x4000 .* --read-limit"):
        read_frame(path, 1, Reading())
    assert read_frame(path, 1, Reading(), reusable=False).stored.shape == (48, 64)
    hostile.write_odd_exr(path, planes(), display=(0, 0, 2999, 2999))
    with pytest.raises(NotReusable, match="has no camera"):
        read_frame(path, 1, Reading())


def test_deep_files_are_refused_before_they_are_read(tmp_path: Path) -> None:
    path = tmp_path / "1.exr"
    deep = np.empty((4, 4), object)
    for place in np.ndindex(4, 4):
        deep[place] = np.ones(3, np.float32)
    header = {
        "type": OpenEXR.deepscanline,
        "compression": OpenEXR.ZIPS_COMPRESSION,
    }
    OpenEXR.File(header, dict.fromkeys("RGB", deep)).write(str(path))
    with pytest.raises(PictureError, match="is deep; save it with flat channels"):
        read_frame(path, 1, Reading(), reusable=False)


def test_guides_that_are_no_numbers_cost_no_light(tmp_path: Path) -> None:
    own = frame(1)
    normal, albedo = own.normal.copy(), own.albedo.copy()
    normal[:20], albedo[20:30] = np.nan, np.inf
    path = write(tmp_path, replace(own, normal=normal, albedo=albedo))
    told = read_frame(path, 1, Reading())
    assert told.stored.invalid is None
    shown = told.stored.picture.reshape(*own.shape, -1)
    assert not shown[:20, :, 6:].any()
    assert not shown[20:30, :, 3:6].any()
    np.testing.assert_allclose(shown[..., :3], own.radiance, atol=2e-3)


# --- which frames there are, and what is written over ---------------------------------


def test_frames_between_those_asked_for_lend(
    tmp_path: Path, denoiser: Denoiser
) -> None:
    told, _ = denoise(shot(tmp_path, 5), denoiser, frames=[1, 3, 5], radius=1)
    lent = {e["frame"]: e["temporal"]["frames"] for e in told["frames"]}
    assert lent == {1: (1, 2), 3: (2, 3, 4), 5: (4, 5)}


@on_posix
@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir])
def test_what_is_no_file_among_the_frames_is_told(
    tmp_path: Path, denoiser: Denoiser, make: Callable[[Path], None]
) -> None:
    path = shot(tmp_path) / "in" / "0002.exr"
    path.unlink()
    make(path)
    told, said = denoise(tmp_path, denoiser)
    assert [each["frame"] for each in told["left_out"]] == [2]
    assert "it is no regular file" in said[0]


@pytest.mark.parametrize("how", ["a number", "a link", "a hard link", "two links"])
def test_no_frame_is_written_over_another_frame_s_input(
    tmp_path: Path, denoiser: Denoiser, how: str
) -> None:
    for number in (1, 11, 12):
        write(tmp_path / "in", frame(number)).rename(tmp_path / "in" / f"{number}.exr")
    before = {x: x.read_bytes() for x in (tmp_path / "in").iterdir()}
    output, message = "out/#.exr", "it is an input"
    (tmp_path / "out").mkdir()
    if how == "a number":
        output = "in/1#.exr"
    elif how == "two links":
        (tmp_path / "out" / "11.exr").touch()
        (tmp_path / "out" / "12.exr").symlink_to(tmp_path / "out" / "11.exr")
        message = "leads to the same file"
    else:
        link = os.symlink if how == "a link" else os.link
        link(tmp_path / "in" / "11.exr", tmp_path / "out" / "1.exr")
    with pytest.raises(PictureError, match=message):
        denoise(tmp_path, denoiser, source="in/#.exr", output=output)
    assert {x: x.read_bytes() for x in (tmp_path / "in").iterdir()} == before


def test_the_file_of_cameras_is_not_written_over(
    tmp_path: Path, denoiser: Denoiser
) -> None:
    shot(tmp_path)
    told = tmp_path / "c.exr"
    told.write_text("{}")
    with pytest.raises(PictureError, match="it is an input"):
        denoise(tmp_path, denoiser, frames=[1], output="c.exr", to={"others": (told,)})
    assert told.read_text() == "{}"


def test_a_frame_that_cannot_be_written_is_left_out(
    tmp_path: Path, denoiser: Denoiser, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_one = Files.write

    def fail(self: Files, number: int, *rest: Any) -> Path:
        if number in bad:
            raise PictureError("cannot write it")
        return write_one(self, number, *rest)

    monkeypatch.setattr(Files, "write", fail)
    bad = [1, 3]
    told, said = denoise(shot(tmp_path), denoiser)
    assert [each["frame"] for each in told["left_out"]] == [1, 3]
    assert "frame 1 is left out: cannot write it" in said
    bad = [1, 2]
    with pytest.raises(PictureError, match="cannot write it"):
        denoise(tmp_path, denoiser)


def test_many_frames_of_which_few_are_there_take_no_time(
    tmp_path: Path, denoiser: Denoiser
) -> None:
    started = time.process_time()
    told, said = denoise(
        shot(tmp_path), denoiser, frames=range(1, 200_000), resume=True
    )
    assert len(told["frames"]) == 3
    assert len(said[0]) < 500
    assert time.process_time() - started < 20
    order = Shot(tuple(range(200_000)), 4)
    started = time.process_time()
    assert all(len(order.neighbours(x)) == 8 for x in range(190_000, 190_500))
    assert time.process_time() - started < 2


def test_frames_in_words_fit_a_line() -> None:
    assert in_words(range(1, 20001, 2)).endswith("97, 99 and 9950 more")


@pytest.mark.parametrize("value", [True, None, "1e3", [1], 1e16, float("inf"), 10**400])
def test_what_is_no_number(value: Any) -> None:
    with pytest.raises(ValueError, match="is no"):
        cameras.number(value)
    assert cameras.whole_or_none(value, 2) is None
