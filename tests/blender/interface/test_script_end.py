"""A script that renders by the package ends as any other."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("bpy")
pytest.importorskip("mitsuba_oidn")

SCRIPT = """
import sys, bpy, xrds_blender
bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
scene = bpy.context.scene
scene.render.use_persistent_data = sys.argv[2] == "True"
print(xrds_blender.render(scene, 1).radiance.shape)
"""


@pytest.mark.parametrize("persistent", [False, True])
def test_the_interpreter_ends_well_after_a_render(
    blend: Path, persistent: bool
) -> None:
    command = [sys.executable, "-c", SCRIPT, str(blend), str(persistent)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "(48, 64, 3)" in done.stdout, done.stderr
    assert done.returncode == 0, done.stderr
