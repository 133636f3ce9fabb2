"""What made a frame: in the log, and in the files."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import pytest

from xrds_core.exr import openexr_io

bpy = pytest.importorskip("bpy")

from xrds_blender.planning.plan import Decision
from xrds_blender.planning.request import render_request
from xrds_blender.rendering.picture import Picture, log_line, metadata_of, record_of

NAMES = ("version", "mode", "scale", "preset", "samples", "device", "seconds")


@pytest.fixture
def metadata(life: Any, tmp_path: Path) -> Any:
    """Text and float fields that Blender writes into a PNG."""

    def render(mode: str) -> dict[str, str]:
        life.render.engine, life.xrds.mode = "XRDS", mode
        life.render.image_settings.file_format = "PNG"
        life.render.filepath = str(tmp_path / "frame.png")
        bpy.ops.render.render(write_still=True)
        return texts(Path(life.render.filepath).read_bytes())

    return render


def texts(png: bytes) -> dict[str, str]:
    found, at = {}, 8
    while at < len(png):
        size, kind = struct.unpack_from(">I4s", png, at)
        if kind == b"tEXt":
            name, _, text = png[at + 8 : at + 8 + size].partition(b"\0")
            found[name.decode()] = text.decode()
        at += size + 12
    return found


@pytest.mark.parametrize(
    ("way", "told"),
    [
        ("x2", {"mode": "super-resolution", "scale": "2", "preset": "fast"}),
        ("full_size", {"mode": "full size", "scale": "1", "preset": "high"}),
    ],
)
def test_blenders_files_tell_what_made_them(
    metadata: Any, network: Any, way: str, told: dict[str, str]
) -> None:
    found = metadata(way)
    fields = {
        name.rpartition(".")[2]: text
        for name, text in found.items()
        if name.startswith("xrds.ViewLayer.")
    }
    assert set(NAMES) | {"left_out"} <= set(fields)
    assert fields["samples"] == "2"
    assert float(fields["seconds"]) >= 0.0
    assert {name: fields[name] for name in told} == told


def test_the_log_has_one_line_a_frame_and_few_others(
    life: Any, network: Any, capfd: pytest.CaptureFixture[str], written: Any
) -> None:
    life.view_layers[0].use_pass_diffuse_direct = True
    written(life)
    lines = [
        line
        for line in "".join(capfd.readouterr()).splitlines()
        if "XRDS" in line and "Saved" not in line
    ]
    (line,) = [line for line in lines if "XRDS " in line and ", frame 1," in line]
    for word in ("super-resolution", "samples 2", "scale 2"):
        assert word in line
    assert len(lines) <= 6
    assert any("Light passes are those of the low-resolution" in each for each in lines)


def test_what_was_left_out_is_named() -> None:
    plan = (
        Decision("guide samples", "2", ""),
        Decision("motion blur", "skipped", ""),
        Decision("guide lights", "all", ""),
        Decision("guide cache", "used 4 samples", ""),
    )
    picture = Picture(None, None, plan=plan, device="cpu", seconds={"total": 1.26})
    told = record_of(picture, render_request(scale=4).settings, 16)
    assert told["left_out"] == "motion blur, guides, from the cache"
    assert told["guide_samples"] == "2"
    assert told["seconds"] == "1.3"
    line = log_line(told, 7, "Main")
    assert line.startswith(f"XRDS {told['version']}, frame 7, Main: super-resolution, ")
    assert metadata_of(told, "Main")["xrds.Main.scale"] == "4"


@pytest.mark.parametrize("suffix", [".png", ".exr"])
def test_the_commands_files_tell_what_made_them(
    life: Any, tmp_path: Path, suffix: str
) -> None:
    from xrds_blender.command.picture_file import is_whole
    from xrds_blender.command.render_file import render_file

    path, output = tmp_path / "life.blend", tmp_path / f"frame{suffix}"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    render_file(path, str(output), render_request(scale=1, samples=3))
    assert is_whole(output, (45, 33))
    if suffix == ".png":
        found = texts(output.read_bytes())
    else:
        found = openexr_io.read(output)[0].attributes
    told = {name: found[f"xrds.{name}"] for name in (*NAMES, "left_out")}
    assert (told["mode"], told["scale"], told["samples"]) == ("full size", "1", "3")


def test_text_beyond_latin_is_kept(tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    from xrds_blender.command import picture_file

    path = tmp_path / "one.png"
    image.new("RGB", (3, 2)).save(path)
    picture_file.add(path, {"xrds.mode": "フルサイズ", "xrds.scale": "1"})
    with image.open(path) as opened:
        opened.load()
        assert opened.text == {"xrds.mode": "フルサイズ", "xrds.scale": "1"}
