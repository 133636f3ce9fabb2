"""The farm examples with a real Blender: Open Job Description, Flamenco."""

from __future__ import annotations

import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from channels import read_channels
from flamenco import compile_job
from program import Program

pytestmark = pytest.mark.timeout(1800)
TEMPLATE = Path(__file__).resolve().parents[2] / "docs" / "pipeline"
OPENJD = str(Path(sys.executable).with_name("openjd"))
SCENE = """
import bpy
scene = bpy.context.scene
scene.render.engine = {engine!r}
scene.render.resolution_x, scene.render.resolution_y = 96, 64
scene.cycles.samples = 4
bpy.ops.wm.save_as_mainfile(filepath={path!r})
"""


@pytest.fixture(scope="module")
def installed(program: Program) -> Program:
    words = ("extension", "install-file", "-r", "user_default", "-e")
    (path,) = program.share.glob("*.zip")
    done = program.run("blender", "--command", *words, program.seen(path))
    assert done.returncode == 0, done.stdout
    return program


def scene_file(program: Program, engine: str) -> Path:
    """The default scene, small, saved for an engine."""
    path = program.share / f"{engine}.blend"
    script = program.share / "make_scene.py"
    script.write_text(SCENE.format(engine=engine, path=program.seen(path)))
    done = program.run("blender", "-b", "--python", program.seen(script))
    assert path.exists(), done.stdout
    return path


def run(
    program: Program, engine: str, template: str, step: str, **more: object
) -> subprocess.CompletedProcess[str]:
    """Submit two frames of the default scene with `openjd run`."""
    pytest.importorskip("openjd.cli")
    share = program.share
    blend = scene_file(program, engine)
    wrapper = share / "worker.sh"
    # The runner's own files, the check among them, lie in its session folder.
    sessions = share / "sessions"
    sessions.mkdir(exist_ok=True)
    words = " ".join(shlex.quote(word) for word in program.command("blender"))
    seen = f"sed s,{share},{program.seen(share)},g"
    wrapper.write_text(
        "#!/bin/bash\nargs=()\n"
        f'for word in "$@"; do args+=("$(echo "$word" | {seen})"); done\n'
        f'exec {words} "${{args[@]}}"\n'
    )
    wrapper.chmod(0o755)
    parameters = {
        "BlendFile": blend,
        "Frames": "1-2",
        "OutputFolder": share / f"farm_{engine}",
        "Blender": wrapper,
        **more,
    }
    told = [word for k, v in parameters.items() for word in ("-p", f"{k}={v}")]
    command = [OPENJD, "run", str(TEMPLATE / f"{template}.template.yaml")]
    return subprocess.run(
        [*command, "--step", step, "--run-dependencies", *told],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
        env={"TMPDIR": str(sessions), "PATH": "/usr/sbin:/usr/bin:/sbin:/bin"},
    )


def test_frames_are_rendered_with_progress(installed: Program) -> None:
    done = run(installed, "XRDS", "xrds_render", "Render")
    assert done.returncode == 0, done.stdout
    frames = sorted((installed.share / "farm_XRDS").iterdir())
    assert [path.name for path in frames] == ["0001.exr", "0002.exr"]
    for line in (
        "openjd_progress: ",
        "openjd_status: XRDS: frame ",
        "openjd_progress: 100",
    ):
        assert line in done.stdout
    for word in ("Warning", "Error:", "Exception:"):
        assert word not in done.stdout


def test_a_file_of_another_engine_fails_at_once(installed: Program) -> None:
    done = run(installed, "CYCLES", "xrds_render", "Render")
    assert done.returncode != 0
    assert "the file is not set to XRDS" in done.stdout
    assert not (installed.share / "farm_CYCLES").exists()


@pytest.mark.parametrize("engine", ["XRDS", "CYCLES"])
def test_a_flamenco_worker_renders_its_chunk(installed: Program, engine: str) -> None:
    """The command line that Flamenco's worker makes of the task, run as it runs it."""
    folder = installed.share / f"flamenco_{engine}"
    settings = {
        "frames": "1-2",
        "chunk_size": 2,
        "blendfile": installed.seen(scene_file(installed, engine)),
        "render_output_path": f"{installed.seen(folder)}/######",
        "format": "OPEN_EXR",
    }
    (task,) = compile_job(settings)
    (command,) = task["commands"]
    told = command["parameters"]
    given = {"{blender}": ["blender"], "{blenderArgs}": ["-b", "-y"]}
    words = [*given[told["exe"]], *given[told["exeArgs"]], *told["argsBefore"]]
    done = installed.run(*words, told["blendfile"], *told["args"], timeout=900)
    if engine == "XRDS":
        assert done.returncode == 0, done.stdout
        names = sorted(path.name for path in folder.iterdir())
        assert names == ["000001.exr", "000002.exr"]
    else:
        assert done.returncode == 3
        assert "not set to XRDS" in done.stdout
        assert not folder.exists()


def test_a_shot_is_rendered_apart_and_denoised_as_one(installed: Program) -> None:
    """By Open Job Description's steps and by Flamenco's tasks: the same frames."""
    share = installed.share
    settings = {"SamplesFolder": share / "samples", "ChunkSize": 1}
    done = run(installed, "CYCLES", "xrds_shot", "Denoise", **settings)
    assert done.returncode == 0, done.stdout
    assert len(list((share / "samples").glob("*.exr"))) == 2
    frames = sorted((share / "farm_CYCLES").iterdir())
    assert [path.name for path in frames] == ["0001.exr", "0002.exr"]
    tasks = compile_job(
        {
            "frames": "1-2",
            "chunk_size": 2,
            "temporal_radius": 4,
            "blendfile": installed.seen(scene_file(installed, "CYCLES")),
            "render_output_path": f"{installed.seen(share / 'shot')}/####.exr",
            "samples_path": installed.seen(share / "flamenco samples"),
        },
        "xrds_shot",
    )
    for task in tasks:
        (command,) = task["commands"]
        told = command["parameters"]
        done = installed.run("blender", *told["args"], timeout=900)
        assert done.returncode == 0, done.stdout
    for path in frames:
        ours, theirs = read_channels(path), read_channels(share / "shot" / path.name)
        assert ours.keys() == theirs.keys() == set("RGB")
        assert all(np.array_equal(ours[name], theirs[name]) for name in "RGB")
