"""`xrds render` as a shell sees it: files, JSON, streams and exit status."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from PIL import Image

from xrds_blender.command import main
from xrds_blender.command.render_file import render_file
from xrds_blender.planning.request import render_request
from xrds_core import exr
from xrds_core.superres import weights
from xrds_core.superres.network import XRDS, preset_config
from xrds_lab.weights import save_network

STAGES = {"total", "sync", "beauty", "denoise", "guides", "network", "write"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scene file, one without a camera, a broken one, and untrained weights."""
    folder = tmp_path_factory.mktemp("render_file")
    bpy.ops.wm.read_factory_settings()
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = 62, 40
    scene.cycles.samples = 4
    scene.view_settings.view_transform = "Standard"
    cube = bpy.data.objects["Cube"]
    for frame in (1, 3):
        cube.location.x = frame
        cube.keyframe_insert("location", frame=frame)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "scene.blend"))
    scene.camera = None
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "blind.blend"))
    scene.camera = cube
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "cube.blend"))
    scene.camera, marker = None, scene.timeline_markers.new("a", frame=1)
    marker.camera = bpy.data.objects["Camera"]
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "marker.blend"))
    (folder / "broken.blend").write_bytes(b"BLENDER-v405" + bytes(100))
    network = XRDS(preset_config("fast", 2))
    save_network(network, folder / weights.file_name("fast", 2), {})
    return folder


def xrds(folder: Path, line: str) -> subprocess.CompletedProcess[str]:
    """Run the command in `folder` as a process of its own, which leaves nothing."""
    temporary = folder / "temporary"
    temporary.mkdir(exist_ok=True)
    done = subprocess.run(
        [sys.executable, "-m", "xrds_blender.command.main", *line.split()],
        capture_output=True,
        text=True,
        check=False,
        cwd=folder,
        env={**os.environ, "TMPDIR": str(temporary)},
    )
    left = [path.name for path in temporary.iterdir()]
    assert [name for name in left if not name.startswith("torchinductor")] == []
    return done


def test_json_files_and_streams(folder: Path) -> None:
    done = xrds(
        folder,
        "render scene.blend --scale 2 -o f/##.exr --frames 1-2 --weights . --json",
    )
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["resolution"] == [62, 40]
    assert (told["scale"], told["preset"]) == (2, "fast")
    assert [frame["frame"] for frame in told["frames"]] == [1, 2]
    for frame in told["frames"]:
        assert set(frame["seconds"]) >= STAGES
        assert frame["seconds"]["total"] >= frame["seconds"]["beauty"] > 0
        assert frame["peak_memory"] > 0
        picture = exr.read_beauty(folder / frame["output"]).radiance
        assert picture.shape == (40, 62, 3)
        assert np.isfinite(picture).all()
        assert picture.max() > 0.05
    assert {path.name for path in (folder / "f").iterdir()} == {"01.exr", "02.exr"}
    first, second = (exr.read_beauty(folder / "f" / f"0{i}.exr") for i in (1, 2))
    assert np.abs(first.radiance - second.radiance).max() > 0.01  # the cube moved
    for decision in told["plan"]:
        assert set(decision) == {"decision", "value", "reason", "saving_seconds"}
    if bpy.app.version < (5, 0):  # later ones tell of progress by their own log
        assert "Fra:" in done.stderr
    for word in ("Warning", "Error:", "Exception:"):
        assert word not in done.stderr


def test_progress_lines_stay_on_stdout_without_json(folder: Path) -> None:
    done = xrds(folder, "render scene.blend -o p.png --plain --samples 1")
    assert done.returncode == 0, done.stderr
    if bpy.app.version < (5, 0):
        assert "Fra:1" in done.stdout
    assert "p.png" in done.stdout
    assert Image.open(folder / "p.png").size == (62, 40)


def test_resolution_is_the_one_asked_for(folder: Path) -> None:
    line = "render scene.blend -o r.png --scale 2 --resolution 50x34 --weights . "
    line += "--samples 1"
    done = xrds(folder, line)
    assert done.returncode == 0, done.stderr
    assert Image.open(folder / "r.png").size == (50, 34)
    assert "guide cache: cached 2 samples: no cached guides match" in done.stdout
    assert "a probe of 50x34 pixels took" in done.stdout


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT to send")
def test_interrupt_ends_a_render_at_once(folder: Path) -> None:
    line = "render scene.blend -o i.exr --plain --samples 1000000"
    with subprocess.Popen(
        [sys.executable, "-m", "xrds_blender.command.main", *line.split()],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=folder,
    ) as child:
        assert child.stdout is not None
        while "Read blend" not in child.stdout.readline():
            assert child.poll() is None
        time.sleep(3.0)  # into the render, of which not every Blender tells
        child.send_signal(signal.SIGINT)
        _, err = child.communicate()
    assert child.returncode == 130
    assert err.endswith("xrds: interrupted\n")
    assert not (folder / "i.exr").exists()


@pytest.mark.parametrize(
    ("line", "status", "told"),
    [
        ("render none.blend -o a.exr --weights .", 1, "no file none.blend"),
        ("render broken.blend -o a.exr --weights .", 1, "cannot open broken.blend"),
        ("render blind.blend -o a.exr --weights .", 1, "no camera"),
        ("render cube.blend -o a.exr --weights .", 1, "'Cube', which is no camera"),
        ("render scene.blend -o a.exr --guide-cache broken.blend/x", 1, "cannot write"),
        ("render scene.blend -o a.exr --scale 8 --weights .", 1, "fast_x2"),
        ("render scene.blend -o scene.blend/a.exr --weights .", 1, "scene.blend"),
        ("render scene.blend -o a.jpg --weights .", 2, "a.jpg"),
        ("render scene.blend -o a.exr --frames 1-2 --weights .", 2, "####"),
        ("render scene.blend -o a.exr --device abacus --weights .", 2, "abacus"),
        ("render scene.blend -o a.exr --device mps", 2, "metal"),
        (
            "render scene.blend -o a.exr --resolution 3x3",
            2,
            "3x3 is not a size that Blender takes",
        ),
        ("render scene.blend -o a.exr --resolution 4x99999", 2, "4 to 65536 pixels"),
        ("plan scene.blend --resolution 1x40", 2, "1x40 is not a size"),
    ],
)
def test_refusals_come_before_rendering(
    folder: Path,
    line: str,
    status: int,
    told: str,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(folder)
    assert main.main(line.split()) == status
    out, err = capfd.readouterr()
    last = err.strip().splitlines()[-1]
    assert last.startswith("xrds: ")
    assert told in last
    assert "Traceback" not in err
    assert "Fra:" not in out
    assert not (folder / "a.exr").exists()


@pytest.mark.parametrize(("more", "seconds"), [("", None), (" --deadline 30s", 10.0)])
def test_a_plan_tells_frames_memory_and_seconds(
    folder: Path, more: str, seconds: float | None, capfd: pytest.CaptureFixture[str]
) -> None:
    words = f"plan {folder}/scene.blend --frames 1-3{more}"
    assert main.main([*words.split(), "--json"]) == 0
    told = json.loads(capfd.readouterr().out)
    assert (told["frames"], told["seconds"]) == (3, seconds)
    assert told["memory"] > 9 * 62 * 40 * 30
    assert main.main(words.split()) == 0
    assert "3 frames, 2 MB for neighbours" in capfd.readouterr().out


def test_a_marker_may_bind_the_only_camera(
    folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert main.main(["plan", str(folder / "marker.blend")]) == 0


def test_a_plan_is_told_and_nothing_is_rendered(folder: Path) -> None:
    done = xrds(folder, "plan scene.blend --scale 2 --json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["facts"]["width"] == 62
    assert told["facts"]["scene"]["lamps"] == 1
    assert {"guide lights", "guide bounces"} <= {
        each["decision"] for each in told["decisions"]
    }
    for each in told["decisions"]:
        assert set(each) == {"decision", "value", "reason", "saving_seconds"}
    assert "Sample" not in done.stderr
    files = set(folder.iterdir())
    explained = xrds(folder, "render scene.blend --scale 2 --explain --skip-nothing")
    assert explained.returncode == 0, explained.stderr
    assert "guide lights: all" in explained.stdout
    assert set(folder.iterdir()) == files


def test_a_render_without_output_is_wrong_usage(folder: Path) -> None:
    done = xrds(folder, "render scene.blend")
    assert done.returncode == 2
    assert "name the output with -o" in done.stderr


def test_every_view_of_stereo_is_written(life: Any, tmp_path: Path) -> None:
    """The first under the name that is given, others with the file's suffix."""
    life.render.use_multiview = True
    blend = tmp_path / "stereo.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    for name, radius in (("still", 0), ("shot", 1)):
        wanted = render_request(1, samples=1, temporal_radius=radius)
        render_file(blend, f"{tmp_path}/{name}/#.exr", wanted, frames=[1, 2])
        written = sorted(path.name for path in (tmp_path / name).iterdir())
        assert written == ["1.exr", "1_R.exr", "2.exr", "2_R.exr"]
        left, right = (exr.read_beauty(tmp_path / name / f) for f in written[:2])
        assert np.abs(left.radiance - right.radiance).max() > 0.01
