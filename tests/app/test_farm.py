"""Open Job Description's own runner over the template, with a real Blender."""

from __future__ import annotations

import shlex
import subprocess
import sys
from pathlib import Path

import pytest
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


def run(program: Program, engine: str) -> subprocess.CompletedProcess[str]:
    """Submit two frames of the default scene with `openjd run`."""
    pytest.importorskip("openjd.cli")
    share = program.share
    blend = share / f"{engine}.blend"
    script = share / "make_scene.py"
    script.write_text(SCENE.format(engine=engine, path=program.seen(blend)))
    program.run("blender", "-b", "--python", program.seen(script))
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
    }
    told = [word for k, v in parameters.items() for word in ("-p", f"{k}={v}")]
    command = [OPENJD, "run"]
    template = str(TEMPLATE / "xrds_render.template.yaml")
    return subprocess.run(
        [*command, template, "--step", "Render", *told],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
        env={"TMPDIR": str(sessions), "PATH": "/usr/sbin:/usr/bin:/sbin:/bin"},
    )


def test_frames_are_rendered_with_progress(installed: Program) -> None:
    done = run(installed, "XRDS")
    assert done.returncode == 0, done.stdout
    frames = sorted((installed.share / "farm_XRDS").iterdir())
    assert [path.name for path in frames] == ["0001.exr", "0002.exr"]
    for line in ("openjd_progress: ", "openjd_status: XRDS 3/3: Network"):
        assert line in done.stdout
    for word in ("Warning", "Error:", "Exception:"):
        assert word not in done.stdout


def test_a_file_of_another_engine_fails_at_once(installed: Program) -> None:
    done = run(installed, "CYCLES")
    assert done.returncode != 0
    assert "the file is not set to XRDS" in done.stdout
    assert not (installed.share / "farm_CYCLES").exists()
