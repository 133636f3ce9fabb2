"""Faults while rendering: what was done is kept, and the next render is as any."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from xrds_core import exr

bpy = pytest.importorskip("bpy")

from xrds_blender import render
from xrds_blender.command import main, picture_file
from xrds_blender.command.picture_file import is_whole
from xrds_blender.command.render_file import render_file
from xrds_blender.command.scene_file import SceneChoice
from xrds_blender.cycles import session
from xrds_blender.planning.request import render_request
from xrds_blender.rendering import guide_cache, loading, stages
from xrds_blender.rendering.picture import NetworkFailed
from xrds_core.errors import Cancelled, OutOfMemory, PictureError, XRDSError

SIZE = (45, 33)


@pytest.fixture
def blend(life: Any, tmp_path: Path) -> Path:
    """The still life in a file, moving."""
    cube = bpy.data.objects["Red"]
    for frame in (1, 4):
        cube.location.x = frame
        cube.keyframe_insert("location", frame=frame)
    path = tmp_path / "scene.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The machine's folder for temporary files."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    return folder


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


# --- cancel ---------------------------------------------------------------------------


@pytest.mark.parametrize("stage", [stages.LOW, stages.GUIDES, stages.NETWORK])
def test_cancelling_a_stage_writes_nothing(
    life: Any, network: Any, monkeypatch: pytest.MonkeyPatch, stage: str
) -> None:
    expected = render(life, 2, seed=1).radiance
    guide_cache.CACHE.clear()
    written = []
    with monkeypatch.context() as patch:
        patch.setattr(
            session, "is_stopped", lambda _: stage in (stages.current() or "")
        )
        patch.setattr(session, "write_combined", lambda *_: written.append(1))
        with pytest.raises(Cancelled):
            render(life, 2, seed=1)
    assert not written
    assert stages.current() is None
    np.testing.assert_array_equal(render(life, 2, seed=1).radiance, expected)


# --- files ----------------------------------------------------------------------------


@contextmanager
def full_disk(size: int) -> Iterator[None]:
    """Let files take so many bytes and no more: a write then fails half-way.

    Not a fixture: pytest's own log would meet the limit before a fixture ends.
    """
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("name", ["frame.exr", "frame.png"])
def test_a_full_disk_leaves_the_old_frame(life: Any, tmp_path: Path, name: str) -> None:
    target = tmp_path / name
    target.write_bytes(b"old")
    radiance = np.random.default_rng(0).random((33, 45, 3), np.float32)
    for size in (0, 100, 2000):
        refused = pytest.raises(PictureError, match=f"cannot write .*{name}")
        with refused, full_disk(size):
            picture_file.save(target, radiance, radiance[..., 0], life)
        assert target.read_bytes() == b"old"
        assert names(tmp_path) == [name]
    assert not bpy.data.images


@pytest.mark.parametrize("suffix", ["exr", "png"])
def test_a_frame_whose_folder_vanishes_is_kept_elsewhere(
    blend: Path, network: Any, temporary: Path, tmp_path: Path, suffix: str
) -> None:
    folder = tmp_path / "frames"

    @bpy.app.handlers.persistent
    def vanish(scene: Any, *_: Any) -> None:
        if scene.frame_current == 2:
            folder.rename(tmp_path / "elsewhere")

    bpy.app.handlers.render_complete.append(vanish)
    try:
        with pytest.raises(PictureError, match="the frame was saved as ") as error:
            render_file(
                blend, f"{folder}/#.{suffix}", render_request(), frames=(1, 2, 3)
            )
    finally:
        bpy.app.handlers.render_complete.remove(vanish)
    assert not folder.exists()
    assert names(tmp_path / "elsewhere") == [f"1.{suffix}"]
    kept = Path(str(error.value).rpartition("saved as ")[2])
    assert temporary in kept.parents
    assert kept.name == f"2.{suffix}"
    assert is_whole(kept, SIZE)


# --- the network ----------------------------------------------------------------------


@pytest.fixture
def too_large(monkeypatch: pytest.MonkeyPatch) -> None:
    """A network that the device has no room for."""

    def fail(*_: Any, **__: Any) -> None:
        raise OutOfMemory("cpu has too little memory")

    monkeypatch.setattr(loading, "_load_network", lambda *_: fail)


def test_too_little_memory_keeps_the_low_resolution_picture(
    life: Any, too_large: None
) -> None:
    with pytest.raises(NetworkFailed, match="cpu has too little memory") as error:
        render(life, 2, seed=1)
    low = error.value
    assert (low.radiance.shape, low.alpha.shape) == ((17, 23, 3), (17, 23))
    assert low.radiance.mean() > 0.05


def test_too_little_memory_in_f12_shows_the_low_resolution_picture(
    life: Any, too_large: None, tmp_path: Path, load: Any
) -> None:
    life.render.engine = "XRDS"
    life.render.image_settings.file_format = "OPEN_EXR"
    life.render.filepath = str(tmp_path / "none.exr")
    with pytest.raises(RuntimeError, match="picture is the low-resolution render"):
        bpy.ops.render.render(write_still=True)
    assert not names(tmp_path)
    shown = tmp_path / "shown.exr"
    bpy.data.images["Render Result"].save_render(str(shown), scene=life)
    life.render.engine = "CYCLES"
    with pytest.raises(NetworkFailed) as error:
        render(life, 2)
    low = error.value.radiance
    picture = load(shown)[..., :3]
    assert picture.shape == (33, 45, 3)
    assert picture[:32, :44].mean() == pytest.approx(low[:16, :22].mean(), rel=0.05)


def test_too_little_memory_writes_the_low_resolution_file(
    blend: Path, too_large: None, tmp_path: Path
) -> None:
    with pytest.raises(XRDSError, match=r"frame 1: .*memory.*, saved as .*1_low\.exr"):
        render_file(blend, f"{tmp_path}/f/#.exr", render_request(2), frames=(1, 2))
    assert names(tmp_path / "f") == ["1_low.exr"]
    assert exr.read_beauty(tmp_path / "f" / "1_low.exr").radiance.shape == (17, 23, 3)


class _Broken:
    """An importer whose torch is there and does not load."""

    def find_spec(self, name: str, *_: Any) -> None:
        if name == "torch":
            raise OSError("libtorch_cpu.so: cannot open shared object file")


@pytest.fixture(params=["missing", "broken", "hollow"])
def no_torch(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> Iterator[None]:
    pytest.importorskip("torch")
    for name in [x for x in sys.modules if x.startswith("xrds_core.")]:
        if name not in {"xrds_core.errors", "xrds_core.files"}:
            monkeypatch.delitem(sys.modules, name)
    if request.param == "broken":
        monkeypatch.delitem(sys.modules, "torch")
        monkeypatch.setattr(sys, "meta_path", [_Broken(), *sys.meta_path])
    else:
        module = None if request.param == "missing" else ModuleType("torch")
        monkeypatch.setitem(sys.modules, "torch", module)
    loading._load_network.cache_clear()
    yield
    loading._load_network.cache_clear()


def test_without_a_sound_torch_only_plain_renders(
    life: Any, no_torch: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    life.cycles.samples = 1
    assert render(life, plain=True).radiance.any()
    picked = render(life, time_budget=0.1)
    assert not picked.settings.is_enlarged
    monkeypatch.setattr(session, "run", None)  # and nothing is rendered before
    with pytest.raises(
        XRDSError, match=r"^super-resolution needs PyTorch, .*\[network\]"
    ):
        render(life, 2)


def test_without_a_sound_torch_commands_say_so(
    life: Any, no_torch: None, blend: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    words = ["render", str(blend), "--scale", "2"]
    assert main.main([*words, "-o", str(blend.with_suffix(".exr"))]) == 1
    err = capfd.readouterr().err
    assert err.strip().splitlines()[-1].startswith("xrds: super-resolution needs")
    assert "Traceback" not in err


def test_a_blender_without_denoiser_renders_and_says_so(
    life: Any, network: Any, written: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    life.cycles.use_denoising = True
    monkeypatch.setattr(session, "has_denoiser", lambda: False)
    monkeypatch.setitem(sys.modules, "mitsuba_oidn", None)
    monkeypatch.setattr(loading, "find_spec", lambda _: None)
    loading._open_denoiser.cache_clear()
    picture = render(life, 2, seed=1)
    (decision,) = [each for each in picture.plan if each.decision == "denoise"]
    assert decision.value == "skipped"
    assert "neither this Blender nor its Python" in decision.reason
    assert picture.low_resolution.std() > 0.01
    assert written(life)[..., :3].mean() > 0.05


# --- animations -----------------------------------------------------------------------

KILLED = """
import os, signal, sys
from pathlib import Path
from xrds_blender.command import main

replace = Path.replace

def killed(self, target):
    if target.name == "2.exr":
        os.truncate(self, 700)
        os.kill(os.getpid(), signal.SIGKILL)
    return replace(self, target)

Path.replace = killed
main.main(sys.argv[1:])
"""


def command(blend: Path, output: str, frames: str) -> list[str]:
    plain = ["--plain", "--samples", "1"]
    return ["render", str(blend), "-o", output, "--frames", frames, *plain]


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGKILL to send")
def test_a_killed_animation_resumes_at_the_first_missing_frame(
    blend: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "f"
    output = f"{folder}/#.exr"
    line = [sys.executable, "-c", KILLED, *command(blend, output, "1-4")]
    done = subprocess.run(line, capture_output=True, check=False)
    assert done.returncode == -signal.SIGKILL
    (left,) = set(names(folder)) - {"1.exr"}
    assert left.endswith(".unfinished")
    first = (folder / "1.exr").read_bytes()
    (folder / "3.exr").write_bytes(first[: len(first) // 2])  # as another program would
    job = render_request(plain=True, samples=1)
    result = render_file(blend, output, job, frames=(1, 2, 3, 4), resume=True)
    assert result["kept"] == [1]
    assert [each["frame"] for each in result["frames"]] == [2, 3, 4]
    assert (folder / "1.exr").read_bytes() == first
    assert left not in names(folder)
    pictures = [exr.read_beauty(folder / f"{i}.exr").radiance for i in (1, 2, 3, 4)]
    assert all(np.abs(a - b).max() > 0.01 for a, b in pairwise(pictures))
    again = render_file(blend, output, job, frames=(1, 2, 3, 4), resume=True)
    assert (again["kept"], again["frames"]) == ([1, 2, 3, 4], [])
    assert again["resolution"] == [*SIZE]
    other = render_file(
        blend,
        output,
        job,
        frames=(4,),
        choice=SceneChoice(resolution=(30, 20)),
        resume=True,
    )
    assert other["kept"] == []  # of another size


def test_what_another_render_has_finished_meanwhile_is_left(
    blend: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "f"

    @bpy.app.handlers.persistent
    def finish(scene: Any, *_: Any) -> None:
        if scene.frame_current == 2:
            (folder / "3.exr").write_bytes((folder / "1.exr").read_bytes())

    bpy.app.handlers.render_complete.append(finish)
    job = render_request(plain=True, samples=1)
    try:
        result = render_file(
            blend, f"{folder}/#.exr", job, frames=range(1, 4), resume=True
        )
    finally:
        bpy.app.handlers.render_complete.remove(finish)
    assert result["kept"] == [3]
    assert names(folder) == ["1.exr", "2.exr", "3.exr"]


def test_a_border_resumes_too(blend: Path, tmp_path: Path) -> None:
    edges = bpy.context.scene.render
    edges.use_border, edges.use_crop_to_border = True, True
    edges.border_min_x, edges.border_max_x = 0.31, 0.8
    edges.border_min_y, edges.border_max_y = 0.2, 0.93
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    job = render_request(plain=True, samples=1)
    results = [
        render_file(blend, f"{tmp_path}/f.png", job, resume=True) for _ in range(2)
    ]
    assert results[0]["kept"] == []
    assert results[1]["kept"] == [1]
    assert results[0]["resolution"] == results[1]["resolution"] == [23, 24]


def test_two_renders_into_one_folder(blend: Path, tmp_path: Path) -> None:
    folder = tmp_path / "f"
    words = [sys.executable, "-m", "xrds_blender.command.main"]
    line = [*words, *command(blend, f"{folder}/#.exr", "1-2")]
    children = [
        subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        for _ in range(2)
    ]
    for child in children:
        output, _ = child.communicate()
        assert child.returncode == 0, output
    assert names(folder) == ["1.exr", "2.exr"]
    assert all(is_whole(path, SIZE) for path in folder.iterdir())
