"""What of a .blend file is rendered, and what of it is never run unasked."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import OpenEXR
import pytest

from xrds_blender.command import main
from xrds_blender.command.scene_file import SceneChoice, frames_of, open_scene
from xrds_blender.interface.registration import ensure_registered
from xrds_core.children import run_python
from xrds_core.errors import SceneError, UsageError


@pytest.fixture(autouse=True)
def registered() -> None:
    ensure_registered()


@pytest.fixture
def blend(tmp_path: Path) -> Path:
    """Two scenes; the second has two view layers, two cameras, and a marker each."""
    bpy.ops.wm.read_factory_settings()
    first = bpy.context.scene
    second = first.copy()
    second.name, second.use_fake_user = "Second", True
    second.view_layers.new("Foreground")
    for index, name in enumerate(("Left", "Right"), 1):
        camera = bpy.data.objects.new(name, bpy.data.cameras.new(name))
        second.collection.objects.link(camera)
        second.timeline_markers.new(name, frame=index).camera = camera
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    return tmp_path / "scene.blend"


def test_a_file_is_rendered_as_it_was_saved(blend: Path) -> None:
    scene = open_scene(blend)
    assert (scene.name, scene.camera.name) == ("Scene", "Camera")


def test_scene_layer_and_camera_are_chosen_by_name(blend: Path) -> None:
    scene = open_scene(blend, SceneChoice("Second", "Foreground", "Right", (50, 34), 3))
    assert scene.name == "Second"
    assert [layer.name for layer in scene.view_layers if layer.use] == ["Foreground"]
    assert (scene.render.resolution_x, scene.render.resolution_y) == (50, 34)
    assert (scene.render.threads_mode, scene.render.threads) == ("FIXED", 3)
    for frame in (1, 2, 3):
        scene.frame_set(frame)
        assert scene.camera.name == "Right", "markers must not switch it"


@pytest.mark.parametrize(
    ("choice", "told"),
    [
        (SceneChoice(scene="Third"), "no scene 'Third'; there are: Scene, Second"),
        (SceneChoice(view_layer="Sky"), "no view layer 'Sky'; there are: ViewLayer"),
        (SceneChoice(camera="Cube"), "no camera 'Cube'; there are: Camera"),
        (SceneChoice(camera="Left"), "no camera 'Left'"),  # of the other scene
    ],
)
def test_unknown_names_are_told(blend: Path, choice: SceneChoice, told: str) -> None:
    with pytest.raises(SceneError, match=told):
        open_scene(blend, choice)


def with_script(path: Path, mark: Path) -> None:
    """Save a file whose text block is run when the file is opened, if it may."""
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    text = bpy.data.texts.new("start.py")
    text.write(f"open({str(mark)!r}, 'w').close()")
    text.use_module = True
    bpy.ops.wm.save_as_mainfile(filepath=str(path))


def with_driver(path: Path, mark: Path) -> None:
    """Save a file with a driver that no simple expression is."""
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    cube = bpy.data.objects["Cube"]
    driver = cube.driver_add("location", 0).driver
    driver.expression = f"bool(open({str(mark)!r}, 'w')) and 1.0"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    mark.unlink(missing_ok=True)


@pytest.fixture
def trusting() -> Iterator[None]:
    """A user whose preferences let every file run its Python."""
    bpy.ops.wm.read_factory_settings()
    bpy.context.preferences.filepaths.use_scripts_auto_execute = True
    yield
    bpy.ops.wm.read_factory_settings()


@pytest.mark.usefixtures("trusting")
@pytest.mark.parametrize("save", [with_script, with_driver])
def test_python_of_a_file_runs_only_where_it_is_trusted(
    save: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, mark = tmp_path / "scene.blend", tmp_path / "it ran"
    save(path, mark)
    scene = open_scene(path)
    scene.frame_set(2)
    assert not mark.exists()
    err = capsys.readouterr().err
    assert f"{path} holds Python that was not run" in err
    assert "--enable-autoexec" in err
    scene = open_scene(path, SceneChoice(trusted=True))
    scene.frame_set(3)
    assert mark.exists()
    assert not capsys.readouterr().err


@pytest.mark.usefixtures("trusting")
def test_the_laboratory_trusts_no_file_either(tmp_path: Path) -> None:
    inputs = pytest.importorskip("xrds_lab.bench.inputs")
    windows = pytest.importorskip("xrds_lab.bench.windows")
    path, mark = tmp_path / "scene.blend", tmp_path / "it ran"
    with_script(path, mark)
    assert bpy.context.preferences.filepaths.use_scripts_auto_execute
    inputs.open_scene(path, windows.Window(64, 36, 0, 0, 64, 36))
    assert not mark.exists()


def test_the_options_lead_there(
    blend: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    words = (
        "--scene Second --camera Right --view-layer Foreground --resolution 32x18 "
        "--exr-depth half --exr-codec piz"
    )
    line = f"render {blend} -o {tmp_path}/#.exr --plain --samples 1 --threads 1"
    assert main.main([*line.split(), *words.split(), "--frames", "1-3x2"]) == 0
    assert {path.name for path in tmp_path.glob("*.exr")} == {"1.exr", "3.exr"}
    header = OpenEXR.File(str(tmp_path / "3.exr"), header_only=True).parts[0].header
    assert header["compression"] == OpenEXR.PIZ_COMPRESSION
    assert bpy.data.scenes["Second"].camera.name == "Right"
    assert bpy.data.scenes["Second"].render.threads == 1
    assert main.main([*line.split(), "--scene", "Third"]) == 1
    assert "no scene 'Third'" in capfd.readouterr().err


def test_a_child_process_finds_blender() -> None:
    """Blender's own folders on `sys.path` hold half a module of that name."""
    done = run_python("-c", "import bpy, os; print(bpy.app.version); os._exit(0)")
    assert done.stdout.strip() == str(bpy.app.version), done.stderr


def test_a_noise_threshold_lets_pixels_stop(blend: Path) -> None:
    scene = open_scene(blend, SceneChoice(noise_threshold=0.05, samples=40))
    cycles = scene.cycles
    assert cycles.use_adaptive_sampling
    assert cycles.adaptive_threshold == pytest.approx(0.05)
    assert cycles.samples == 40


@pytest.fixture
def short_range(blend: Path) -> Path:
    """Frames 2 to 6 in steps of 2, a cube that moves in them, few small samples."""
    scene = bpy.data.scenes["Scene"]
    scene.frame_start, scene.frame_end, scene.frame_step = 2, 6, 2
    scene.render.resolution_x, scene.render.resolution_y = 16, 16
    scene.cycles.samples = 1
    cube = scene.objects["Cube"]
    for frame in (2, 6):
        cube.location.x = frame
        cube.keyframe_insert("location", frame=frame)
    scene.frame_set(4)
    bpy.ops.wm.save_mainfile()
    return blend


def test_a_range_that_is_given_twice_must_be_the_same(blend: Path) -> None:
    scene = open_scene(blend)
    whole = list(range(scene.frame_start, scene.frame_end + 1))
    assert frames_of(scene, whole, True) == frames_of(scene, None, True) == whole
    assert frames_of(scene, None, False) is None
    with pytest.raises(UsageError, match="-a are frames"):
        frames_of(scene, whole[:-1], True)


def test_the_range_of_the_file_is_rendered(
    short_range: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("mitsuba_oidn")
    out = short_range.parent / "out"
    words = ["render", str(short_range), "--scale", "1", "-o", f"{out}/#.exr"]
    assert main.main([*words, "-a"]) == 0
    assert sorted(path.name for path in out.iterdir()) == ["2.exr", "4.exr", "6.exr"]
    told = "frame 4 alone: the file has 2, 4, 6; -a renders them"
    assert told not in capsys.readouterr().err
    assert main.main(words) == 0
    assert told in capsys.readouterr().err
    assert main.main([*words[:-1], f"{out}/all.exr", "-a"]) == 2
    assert "all 3 frames would be written" in capsys.readouterr().err


def test_a_still_is_not_told_of_a_range(
    blend: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("mitsuba_oidn")
    words = ["render", str(blend), "--scale", "1", "--samples", "1"]
    words += ["--resolution", "16x16", "-o", str(blend.parent / "out.exr")]
    assert main.main(words) == 0
    assert "alone" not in capsys.readouterr().err
