from __future__ import annotations

import os
import struct
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import hostile
import numpy as np
import OpenEXR
import pytest
from channels import read_channels

from xrds_core import exr
from xrds_core.arrays import Array
from xrds_core.errors import PictureError
from xrds_core.exr import (
    Names,
    openexr_io,
    raw_header,
    read_beauty,
    read_guides,
    write_picture,
)
from xrds_core.exr.openexr_io import CODECS, LARGEST_HALF, Encoding

LAYOUTS = ("flat", "layered", "parts", "named parts")


def planes(seed: int, letters: str = "RGB", size: tuple[int, int] = (4, 6)) -> Any:
    generator = np.random.default_rng(seed)
    return {x: generator.random(size, dtype=np.float32) for x in letters}


PASSES = {
    "Combined": planes(0, "RGBA"),
    "Noisy Image": planes(1, "RGBA"),
    "Denoising Albedo": planes(2),
    "Denoising Normal": planes(3, "XYZ"),
    "Denoising Depth": planes(4, "Z"),
}


def stacked(name: str, letters: str = "RGB") -> Array:
    return np.stack([PASSES[name][x] for x in letters], axis=-1)


def header(**more: Any) -> dict[str, Any]:
    return {"type": OpenEXR.scanlineimage, **more}


def write(path: Path, channels: dict[str, Any], **more: Any) -> None:
    # OpenEXR puts its own objects into the table it is given
    OpenEXR.File(header(**more), dict(channels)).write(str(path))


def write_passes(path: Path, passes: Any, layout: str) -> None:
    """Write passes as Cycles has done in one version of Blender or another."""
    prefix = "" if layout == "flat" else "View Layer."
    full = {
        f"{prefix}{name}": {f"{prefix}{name}.{k}": v for k, v in channels.items()}
        for name, channels in passes.items()
    }
    if layout == "named parts":  # the letter alone in channels
        full = {f"{prefix}{name}": dict(channels) for name, channels in passes.items()}
    if "parts" in layout:
        parts = [OpenEXR.Part(header(), x, name) for name, x in full.items()]
        OpenEXR.File(parts).write(str(path))
    else:
        together = {k: v for channels in full.values() for k, v in channels.items()}
        write(path, together)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "render.exr"


@pytest.fixture
def apart(monkeypatch: pytest.MonkeyPatch) -> None:
    """As in a program that has an OpenEXR of its own."""
    monkeypatch.setattr(openexr_io, "_is_shadowed", lambda: True)


# --- in a process of its own ----------------------------------------------------------


@pytest.mark.usefixtures("apart")
def test_a_process_of_its_own_reads_what_this_one_would(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_passes(path, PASSES, "parts")
    parts = openexr_io.read(path)
    monkeypatch.setattr(openexr_io, "_is_shadowed", lambda: False)
    for part, expected in zip(parts, openexr_io.read(path), strict=True):
        assert replace(part, channels={}) == replace(expected, channels={})
        assert part.channels.keys() == expected.channels.keys()
        for name, pixels in part.channels.items():
            np.testing.assert_array_equal(pixels, expected.channels[name])
            assert pixels.dtype == expected.channels[name].dtype


@pytest.mark.usefixtures("apart")
def test_a_process_of_its_own_writes(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    channels = planes(8, "RGBA")
    write_picture(path, channels)
    monkeypatch.setattr(openexr_io, "_is_shadowed", lambda: False)
    written = read_channels(path)
    assert written.keys() == channels.keys()
    for name, plane in channels.items():
        np.testing.assert_array_equal(written[name], plane)


@pytest.mark.usefixtures("apart")
@pytest.mark.parametrize("module", ["numpy", "json", "OpenEXR", "xrds_core"])
def test_a_process_of_its_own_runs_nothing_of_the_working_folder(
    path: Path, monkeypatch: pytest.MonkeyPatch, module: str
) -> None:
    folder = path.parent / "working"
    folder.mkdir()
    mark = path.parent / "it ran"
    (folder / f"{module}.py").write_text(f"open({str(mark)!r}, 'w')")
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "path", ["", *sys.path])  # as under `python -c`
    write_picture(path, planes(0))
    read_beauty(path)
    assert not mark.exists()


@pytest.mark.usefixtures("apart")
def test_what_goes_wrong_apart_is_told(path: Path) -> None:
    path.write_bytes(b"no picture")
    with pytest.raises(PictureError, match="is not a complete OpenEXR file"):
        read_beauty(path)
    with pytest.raises(PictureError, match="cannot write"):
        write_picture(path / "below_a_file.exr", planes(1))


# --- how a file holds its pixels ------------------------------------------------------


def encoding(path: Path) -> tuple[str, str]:
    """Compression, and number format of R."""
    (part,) = OpenEXR.File(str(path), separate_channels=True).parts
    kinds = {np.dtype(np.float16): "half", np.dtype(np.float32): "float"}
    return part.header["compression"].name, kinds[part.channels["R"].pixels.dtype]


@pytest.mark.parametrize("half", [False, True])
@pytest.mark.parametrize("codec", CODECS)
def test_every_encoding_is_read_back(path: Path, half: bool, codec: str) -> None:
    rows = np.linspace(0.1, 1.0, 32, dtype=np.float32)[:, None]
    picture = rows * np.linspace(0.5, 1.0, 48, dtype=np.float32)
    write_picture(path, dict.fromkeys("RGB", picture), Encoding(half, codec))
    expected = "NO" if codec == "none" else codec.upper()
    assert encoding(path) == (f"{expected}_COMPRESSION", "half" if half else "float")
    np.testing.assert_allclose(read_beauty(path).radiance[..., 1], picture, rtol=0.05)
    if codec in CODECS[:5] and not half:
        np.testing.assert_array_equal(read_beauty(path).radiance[..., 1], picture)


def test_half_floats_are_bounded(path: Path) -> None:
    values = np.array([[1e30, -1e30, np.inf, np.nan, 1.0]], np.float32)
    write_picture(path, dict.fromkeys("RGB", values), Encoding(half=True))
    written = read_beauty(path).radiance[0, :, 0]
    np.testing.assert_array_equal(written, [65504, -65504, np.inf, np.nan, 1.0])


@pytest.mark.usefixtures("apart")
def test_a_process_of_its_own_encodes_alike(path: Path) -> None:
    write_picture(path, planes(0), Encoding(half=True, codec="piz"))
    assert encoding(path) == ("PIZ_COMPRESSION", "half")


# --- what Cycles writes ---------------------------------------------------------------


@pytest.mark.parametrize("layout", LAYOUTS)
def test_passes_are_found_under_any_prefix(path: Path, layout: str) -> None:
    write_passes(path, PASSES, layout)
    beauty = read_beauty(path)
    np.testing.assert_array_equal(beauty.radiance, stacked("Combined"))
    np.testing.assert_array_equal(beauty.alpha, PASSES["Combined"]["A"])
    np.testing.assert_array_equal(beauty.picture, stacked("Combined", "RGBA"))
    np.testing.assert_array_equal(beauty.noisy, stacked("Noisy Image"))
    guides = read_guides(path)
    np.testing.assert_array_equal(guides.albedo, stacked("Denoising Albedo"))
    np.testing.assert_array_equal(guides.normal, stacked("Denoising Normal", "XYZ"))
    np.testing.assert_array_equal(guides.alpha, PASSES["Combined"]["A"])


def test_a_plain_picture_with_and_without_alpha(path: Path) -> None:
    for letters in ("RGBA", "RGB"):
        channels = planes(5, letters)
        write(path, channels)
        beauty = read_beauty(path)
        np.testing.assert_array_equal(beauty.radiance[..., 1], channels["G"])
        assert beauty.picture.shape == (4, 6, len(letters))
        assert (beauty.alpha is None) == (letters == "RGB")
        assert beauty.noisy is None


def test_normals_may_be_called_red_green_and_blue(path: Path) -> None:
    passes = {**PASSES, "Denoising Normal": planes(3, "RGB")}
    write_passes(path, passes, "layered")
    expected = np.stack([*planes(3, "RGB").values()], axis=-1)
    np.testing.assert_array_equal(read_guides(path).normal, expected)


def test_half_floats_become_floats(path: Path) -> None:
    half = {k: v.astype(np.float16) for k, v in planes(6).items()}
    write(path, half)
    radiance = read_beauty(path).radiance
    assert radiance.dtype == np.float32
    np.testing.assert_array_equal(radiance[..., 0], half["R"].astype(np.float32))


def test_nan_is_left_to_those_who_count_it(path: Path) -> None:
    channels = planes(7)
    channels["G"][1, 2] = np.nan
    write(path, channels)
    assert np.isnan(read_beauty(path).radiance[1, 2, 1])


def test_tiled_files_are_read(path: Path) -> None:
    tiles = OpenEXR.TileDescription()
    write(path, planes(8), type=OpenEXR.tiledimage, tiles=tiles)
    np.testing.assert_array_equal(read_beauty(path).radiance[..., 2], planes(8)["B"])


@pytest.mark.parametrize(
    ("data", "display"),
    [
        ((2, 3), (0, 0, 9, 9)),  # a border render inside its frame
        ((-2, -1), (0, 0, 9, 9)),  # overscan, cut off
        ((5, 5), (3, 4, 7, 6)),  # both
        ((40, 40), (0, 0, 3, 3)),  # nothing in sight
    ],
)
def test_data_lie_where_the_display_window_has_them(
    path: Path, data: tuple[int, int], display: tuple[int, int, int, int]
) -> None:
    channels = planes(9)
    window = (data, (data[0] + 5, data[1] + 3))
    windows = {"dataWindow": window, "displayWindow": (display[:2], display[2:])}
    write(path, channels, **windows)
    radiance = read_beauty(path).radiance
    left, top, right, bottom = display
    assert radiance.shape == (bottom - top + 1, right - left + 1, 3)
    for y in range(top, bottom + 1):
        for x in range(left, right + 1):
            row, column = y - data[1], x - data[0]
            inside = 0 <= row < 4 and 0 <= column < 6
            expected = channels["R"][row, column] if inside else 0.0
            assert radiance[y - top, x - left, 0] == expected


# --- names ----------------------------------------------------------------------------


def test_passes_of_other_renderers_by_their_names(path: Path) -> None:
    passes = {"beauty": planes(0), "diffuse_albedo": planes(2), "N": planes(3, "XYZ")}
    write_passes(path, passes, "flat")
    names = Names(beauty="beauty", albedo="diffuse_albedo", normal="N")
    np.testing.assert_array_equal(
        read_beauty(path, names).radiance[..., 0], passes["beauty"]["R"]
    )
    guides = read_guides(path, names=names)
    np.testing.assert_array_equal(guides.albedo[..., 0], passes["diffuse_albedo"]["R"])
    assert guides.alpha is None


def test_a_missing_pass_is_named_beside_what_is_there(path: Path) -> None:
    write_passes(path, {"Combined": PASSES["Combined"]}, "layered")
    message = r"no pass 'Denoising Albedo'; it holds View Layer\.Combined$"
    with pytest.raises(PictureError, match=message):
        read_guides(path)


def test_a_depth_is_no_picture(path: Path) -> None:
    write_passes(path, {"Combined": planes(0, "Z")}, "layered")
    with pytest.raises(PictureError, match="no pass 'Combined'"):
        read_beauty(path)


def test_two_layers_are_told_apart_by_name(path: Path) -> None:
    channels = {f"A.Combined.{k}": v for k, v in planes(0).items()}
    channels |= {f"B.Combined.{k}": v for k, v in planes(1).items()}
    write(path, channels)
    with pytest.raises(PictureError, match=r"layers: A\.Combined, B\.Combined"):
        read_beauty(path)
    named = read_beauty(path, Names(beauty="B.Combined")).radiance
    np.testing.assert_array_equal(named[..., 0], planes(1)["R"])


def test_what_the_compositor_made_is_not_the_render(path: Path) -> None:
    channels = {f"Composite.Combined.{k}": v for k, v in planes(0).items()}
    channels |= {f"ViewLayer.Combined.{k}": v for k, v in planes(1).items()}
    write(path, channels)
    np.testing.assert_array_equal(read_beauty(path).radiance[..., 0], planes(1)["R"])


# --- files that cannot be used --------------------------------------------------------


@pytest.mark.parametrize("layout", ["layered", "parts"])
def test_every_truncation_is_a_picture_error(
    path: Path, layout: str, capsys: pytest.CaptureFixture[str]
) -> None:
    write_passes(path, PASSES, layout)
    whole = path.read_bytes()
    for percent in range(100):
        path.write_bytes(whole[: len(whole) * percent // 100])
        with pytest.raises(PictureError, match="not a complete OpenEXR file"):
            read_beauty(path)
    assert not capsys.readouterr().out, "stdout belongs to JSON"


@pytest.mark.parametrize("seed", range(10))
def test_random_bytes_are_a_picture_error(path: Path, seed: int) -> None:
    path.write_bytes(np.random.default_rng(seed).bytes(900))
    with pytest.raises(PictureError, match="not a complete OpenEXR file"):
        read_beauty(path)


def test_no_file_and_a_folder(path: Path) -> None:
    for missing, reason in ((path, "no file"), (path.parent, "no regular file")):
        with pytest.raises(PictureError, match=reason):
            read_beauty(missing)


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX only")
def test_a_pipe_is_not_waited_for(path: Path) -> None:
    os.mkfifo(path)
    with pytest.raises(PictureError, match="no regular file"):
        read_beauty(path)


def test_the_library_prints_nothing_itself(
    path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    for layout in ("layered", "parts"):
        write_passes(path, PASSES, layout)
        whole = path.read_bytes()
        for percent in (10, 50, 90):
            path.write_bytes(whole[: len(whole) * percent // 100])
            with pytest.raises(PictureError):
                read_beauty(path)
    with pytest.raises(PictureError):
        write_picture(path.parent / "none" / "out.exr", planes(0))
    os.write(2, b"stderr is where it was\n")
    assert capfd.readouterr() == ("", "stderr is where it was\n")


def test_names_of_channels_and_files_are_escaped(path: Path) -> None:
    steering = path.with_name("a\x1b[2J\n\u202e.exr")
    write(steering, {"b\x1b]0;owned\x07.Z": planes(0)["R"]})
    with pytest.raises(PictureError, match="has no pass") as error:
        read_beauty(steering)
    assert str(error.value).isprintable()


def claiming(path: Path, right: int, bottom: int) -> None:
    """Write a picture whose windows claim to be larger than they are."""
    write(path, planes(0))
    windows = np.asarray([[0, 0, 5, 3], [0, 0, right, bottom]], "<i4")
    true, claimed = (window.tobytes() for window in windows)
    kind = b"Window\0box2i\0" + (16).to_bytes(4, "little")
    whole = path.read_bytes()
    assert whole.count(kind + true) == 2
    path.write_bytes(whole.replace(kind + true, kind + claimed))


CLAIM = """
import resource, sys
from xrds_core.errors import PictureError
from xrds_core.exr import read_beauty
resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))
try:
    read_beauty(sys.argv[1])
except PictureError as error:
    print(error)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="limits of memory are POSIX'")
def test_windows_that_claim_more_than_the_file_holds_take_no_memory(path: Path) -> None:
    claiming(path, 65535, 65535)
    done = subprocess.run(
        [sys.executable, "-c", CLAIM, str(path)],
        capture_output=True,
        text=True,
        check=True,
    )
    assert "claims 51.5 GB of pixels" in done.stdout
    assert "--read-limit" in done.stdout


@pytest.mark.parametrize("shadowed", [False, True])
def test_the_limit_can_be_raised_and_lowered(
    path: Path, monkeypatch: pytest.MonkeyPatch, shadowed: bool
) -> None:
    write(path, planes(0))
    monkeypatch.setattr(openexr_io, "_is_shadowed", lambda: shadowed)
    monkeypatch.setattr(raw_header, "_allowed", 0)
    raw_header.allow(4 * 6 * 3 * 4)
    assert read_beauty(path).radiance.shape == (4, 6, 3)
    raw_header.allow(4 * 6 * 3 * 4 - 1)
    with pytest.raises(PictureError, match="claims"):
        read_beauty(path)


def test_black_of_any_size_is_no_claim() -> None:
    """A packed picture holds no more bytes than the limit for its size allows."""
    assert raw_header.limit_of(0) >= 8192 * 8192 * 4 * 4
    assert raw_header.limit_of(10**8) == 10**11


def test_a_header_that_claims_too_much(path: Path) -> None:
    write(path, planes(0))
    name, kind = b"displayWindow\0", b"box2i\0" + (16).to_bytes(4, "little")
    window = np.asarray([0, 0, 5, 3], "<i4").tobytes()
    huge = np.asarray([0, 0, 10**6, 3], "<i4").tobytes()
    whole = path.read_bytes()
    assert name + kind + window in whole
    path.write_bytes(whole.replace(name + kind + window, name + kind + huge))
    with pytest.raises(PictureError, match="displayWindow is 1000001x4"):
        read_beauty(path)


# --- writing --------------------------------------------------------------------------


def test_what_is_written_is_read_again(path: Path) -> None:
    channels = planes(10, "RGBA", (7, 5))
    channels["R"][0, 0] = 1e6  # above half floats
    write_picture(path, {k: v[::-1] for k, v in channels.items()})
    beauty = read_beauty(path)
    np.testing.assert_array_equal(beauty.radiance[..., 0], channels["R"][::-1])
    np.testing.assert_array_equal(beauty.alpha, channels["A"][::-1])
    assert list(path.parent.iterdir()) == [path]


def test_a_file_that_cannot_be_written_leaves_nothing(path: Path) -> None:
    with pytest.raises(PictureError, match="cannot write"):
        write_picture(path / "nowhere.exr", planes(0))
    (path.parent / "folder.exr").mkdir()
    with pytest.raises(PictureError, match=r"folder\.exr"):
        write_picture(path.parent / "folder.exr", planes(0))
    write_picture(path, planes(0))
    with pytest.raises(PictureError, match=r"render\.exr"):
        write_picture(path, {**planes(0), "A": np.zeros((9, 9), np.float32)})
    np.testing.assert_array_equal(read_beauty(path).radiance[..., 0], planes(0)["R"])
    assert {x.name for x in path.parent.iterdir()} == {"render.exr", "folder.exr"}


def test_one_name_in_two_parts_is_refused(tmp_path: Path) -> None:
    """Which of them would be the picture depends on their order alone."""
    path = tmp_path / "two.exr"
    parts = [
        OpenEXR.Part(
            header(), {f"View.Combined.{k}": v for k, v in planes(seed).items()}, name
        )
        for seed, name in enumerate(("first", "second"))
    ]
    OpenEXR.File(parts).write(str(path))
    named = "'View.Combined.[RGB]' twice, in its parts 'first' and 'second'"
    with pytest.raises(PictureError, match=named):
        read_beauty(path)


@pytest.mark.parametrize("codec", ["dwaa", "dwab"])
@pytest.mark.parametrize(
    ("half", "light"),
    [(True, 65504.0), (True, 1e6), (True, np.inf), (False, 65504.0), (False, 1e6)],
)
def test_dwa_holds_no_more_than_it_decodes(
    path: Path, half: bool, codec: str, light: float
) -> None:
    """It rings around light near the largest half, and stores infinity as black."""
    picture = np.random.default_rng(0).random((36, 64), np.float32)
    sun = np.hypot(*np.mgrid[-10:26, -30:34]) < 6.0
    picture[sun] = light
    depth = np.where(sun, np.float32(1e10), picture)
    planes = {"R": picture, "G": picture * np.float32(0.9), "B": picture, "Z": depth}
    write_picture(path, planes, Encoding(half, codec))
    read = exr.File(path)
    for name in "RGB":
        assert np.isfinite(read.pixels(name)).all()
        assert read.pixels(name)[sun].min() > 40_000.0
    assert half or (read.pixels("Z") == depth).all()


@pytest.mark.parametrize("alone", [True, False])
def test_what_dwa_overflowed_is_read_as_light_and_lost_no_further(
    path: Path, tmp_path: Path, alone: bool
) -> None:
    pixels = np.random.default_rng(0).random((36, 64)).astype(np.float16)
    pixels[4:12, 20:32] = LARGEST_HALF
    header = {"compression": OpenEXR.DWAA_COMPRESSION, "type": OpenEXR.scanlineimage}
    planes = {name: pixels.copy() for name in ("R", "G", "B", "x.R", "x.G", "x.B")}
    OpenEXR.File(header, planes).write(str(path))
    before = exr.File(path).pixels("x.R")
    assert np.isfinite(before).all()
    copied = tmp_path / "copy.exr"
    exr.copy_picture(path, copied, {0: dict.fromkeys("RGB", pixels)}, alone=alone)
    after = exr.File(copied)
    np.testing.assert_array_equal(after.pixels("R"), pixels)
    assert alone or (after.pixels("x.R") == before).all()


LATIN_1 = "D:\\projets\\été.ma".encode("latin-1")


@pytest.mark.parametrize(
    "attribute",
    [
        hostile.attribute("scene", "string", LATIN_1),
        hostile.attribute("a", "string", bytes([255] * 8)),
        hostile.attribute("names", "stringvector", b"\2\0\0\0\xff\xfe"),
        hostile.attribute("deepImageState", "deepImageState", b"\0"),
        hostile.attribute("ours", "ofMyOwn", LATIN_1),
        hostile.attribute("owner", "string", "été".encode()),
        hostile.attribute("framesPerSecond", "rational", struct.pack("<iI", 48, 2)),
        hostile.attribute("framesPerSecond", "rational", bytes(8)),
        hostile.attribute("keyCode", "keycode", b"\xff" * 28),
        hostile.attribute("envmap", "envmap", b"\x09"),
        hostile.attribute("multiView", "stringvector", b""),
        hostile.attribute("a", "stringvector", b"\4\0\0\0ab"),
        hostile.attribute("a", "floatvector", b""),
        hostile.attribute("a", "int", b"\1\2\3"),
        hostile.attribute("a", "m33f", b"\1\0\xa0\x7f" * 9),  # a signalling NaN
        hostile.attribute("a", "preview", b"\2\0\0\0\2\0\0\0ab"),
        hostile.attribute("a", "tiledesc", b"\0" * 9),
        hostile.attribute("a", "chlist", b"ab"),
        hostile.attribute("a", "bytes", b"ab"),
        b"a\0k\xe9\0\2\0\0\0ab",
    ],
)
@pytest.mark.parametrize("alone", [True, False])
def test_any_attribute_is_carried_on_byte_for_byte(
    path: Path, tmp_path: Path, attribute: bytes, alone: bool
) -> None:
    plane = np.ones((4, 5), np.float32)
    name, rest = attribute.split(b"\0", 1)
    for told in (attribute, b"\xe9" + name + b"\0" + rest):  # names are bytes, too
        hostile.write_odd_exr(path, dict.fromkeys("RGB", plane), attributes=told)
        given = path.read_bytes()
        copied = tmp_path / "copy.exr"
        exr.copy_picture(path, copied, {0: dict.fromkeys("RGB", plane)}, alone=alone)
        assert told in copied.read_bytes()
        assert path.read_bytes() == given
        np.testing.assert_array_equal(exr.File(copied).pixels("R"), plane)


def test_attributes_of_one_name_leave_each_other_and_the_next_alone(
    path: Path, tmp_path: Path
) -> None:
    told = [
        hostile.attribute("a", "v3d", bytes(24)),
        hostile.attribute("a", "string", b"abc"),
        hostile.attribute("b", "int", b"abcd"),
    ]
    plane = np.ones((4, 5), np.float32)
    hostile.write_odd_exr(path, dict.fromkeys("RGB", plane), attributes=b"".join(told))
    copied = tmp_path / "copy.exr"
    exr.copy_picture(path, copied, {0: dict.fromkeys("RGB", plane)})
    assert all(attribute in copied.read_bytes() for attribute in told)
