"""Pictures to files: names, refusals, and what Blender's own save gives."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest
from PIL import Image

from xrds_blender.command import picture_file
from xrds_core.errors import PictureError, UsageError, XRDSError
from xrds_core.frames import frame_path


@pytest.mark.parametrize(
    ("pattern", "frame", "name"),
    [
        ("out.exr", 5, "out.exr"),
        ("f_####.png", 7, "f_0007.png"),
        ("f_##.png", 1234, "f_1234.png"),
        ("f_####.png", -2, "f_-0002.png"),
        ("#_shot_###.exr", 12, "#_shot_012.exr"),
        ("a#b/out.exr", 3, "a#b/out.exr"),
    ],
)
def test_frame_numbers(pattern: str, frame: int, name: str) -> None:
    assert frame_path(pattern, frame) == Path(name)


@pytest.mark.parametrize("name", ["out.jpg", "out", "out.exr.tmp"])
def test_other_formats_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(UsageError, match=r"\.exr or \.png"):
        picture_file.check_output(str(tmp_path / name), [1])


def test_frames_of_one_name_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="####"):
        picture_file.check_output(str(tmp_path / "out.exr"), [1, 2])


@pytest.mark.parametrize("name", ["a.%04d.exr", "a_$F4.png", "*.exr", "a.<frame>.exr"])
def test_other_programs_frame_numbers_are_told(tmp_path: Path, name: str) -> None:
    with pytest.raises(UsageError, match="the frame number is written ####"):
        picture_file.check_output(str(tmp_path / name), [1])
    assert not list(tmp_path.iterdir())


def test_unwritable_places_are_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "folder.exr").mkdir()
    for place in (tmp_path / "file" / "out.exr", tmp_path / "folder.exr"):
        with pytest.raises(PictureError, match=str(place.parent)):
            picture_file.check_output(str(place), [1])


def test_every_frame_is_looked_at(tmp_path: Path) -> None:
    (tmp_path / "f_2.exr").mkdir()
    with pytest.raises(PictureError, match=r"f_2\.exr"):
        picture_file.check_output(str(tmp_path / "f_#.exr"), [1, 2, 3])


def test_checking_makes_the_folder_and_leaves_no_file(tmp_path: Path) -> None:
    picture_file.check_output(str(tmp_path / "new" / "out_#.png"), [1, 2, 3])
    assert [path.name for path in tmp_path.rglob("*")] == ["new"]


@pytest.fixture
def scene() -> bpy.types.Scene:
    bpy.ops.wm.read_factory_settings()
    bpy.context.scene.view_settings.view_transform = "Standard"
    return bpy.context.scene


def shape() -> tuple[np.ndarray, np.ndarray]:
    """Red above, blue below, the right half covered by half; premultiplied."""
    radiance, alpha = np.zeros((4, 6, 3), np.float32), np.ones((4, 6), np.float32)
    radiance[:2, :, 0], radiance[2:, :, 2] = 0.5, 1.0
    alpha[:, 3:] = 0.5
    return radiance * alpha[..., None], alpha


@pytest.mark.parametrize("transparent", [False, True])
def test_png_is_as_blender_saves_it(
    tmp_path: Path, scene: bpy.types.Scene, transparent: bool
) -> None:
    scene.render.film_transparent = transparent
    scene.render.image_settings.file_format = "OPEN_EXR"
    picture_file.save(tmp_path / "out.png", *shape(), scene)
    image = Image.open(tmp_path / "out.png")
    assert image.mode == ("RGBA" if transparent else "RGB")
    pixels = np.asarray(image.convert("RGBA"))
    assert pixels[0, 0].tolist() == [188, 0, 0, 255]  # sRGB of 0.5
    assert pixels[3, 0].tolist() == [0, 0, 255, 255]
    assert pixels[0, 5, :3].tolist() == [188 if transparent else 137, 0, 0]
    assert scene.render.image_settings.file_format == "OPEN_EXR"
    assert not [image for image in bpy.data.images if image.name.startswith("xrds")]


@pytest.mark.parametrize(
    ("form", "colours", "depth", "mode", "bits"),
    [
        ("PNG", "BW", "8", "L", 8),
        ("PNG", "BW", "16", "I;16", 16),
        ("PNG", "RGB", "16", "RGB", 16),
        ("PNG", "RGBA", "8", "RGBA", 8),
        ("JPEG", "BW", "8", "L", 8),
        ("JPEG", "RGB", "8", "RGB", 8),
        ("OPEN_EXR", "RGBA", "16", "RGB", 16),
        ("OPEN_EXR", "RGBA", "32", "RGB", 16),
    ],
)
def test_png_has_the_colours_and_bits_of_the_file(
    tmp_path: Path,
    scene: bpy.types.Scene,
    form: str,
    colours: str,
    depth: str,
    mode: str,
    bits: int,
) -> None:
    settings = scene.render.image_settings
    settings.file_format, settings.color_mode = form, colours
    settings.color_depth = depth
    path = tmp_path / "out.png"
    picture_file.save(path, *shape(), scene)
    assert Image.open(path).mode == mode
    assert path.read_bytes()[24] == bits
    assert (settings.file_format, settings.color_depth) == (form, depth)


def test_exposure_shapes_png_alone(tmp_path: Path, scene: bpy.types.Scene) -> None:
    scene.view_settings.exposure = 1.0
    picture_file.save(tmp_path / "out.png", *shape(), scene)
    assert np.asarray(Image.open(tmp_path / "out.png"))[0, 0, :3].tolist() == [
        255,
        0,
        0,
    ]
    picture_file.save(tmp_path / "out.exr", *shape(), scene)
    image = bpy.data.images.load(str(tmp_path / "out.exr"))
    lowest = np.array(image.pixels[:4])
    np.testing.assert_allclose(lowest[:3], [0, 0, 1], atol=1e-6)


def test_a_failing_save_keeps_the_old_file(
    tmp_path: Path, scene: bpy.types.Scene
) -> None:
    target = tmp_path / "out.png"
    target.write_bytes(b"kept")
    radiance, alpha = shape()
    with pytest.raises((XRDSError, TypeError, RuntimeError, ValueError)):
        picture_file.save(target, radiance[:2], alpha, scene)
    assert target.read_bytes() == b"kept"
    assert [path.name for path in tmp_path.iterdir()] == ["out.png"]
