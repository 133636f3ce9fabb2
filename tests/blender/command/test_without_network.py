"""Without PyTorch, safetensors and tqdm all but super-resolution works."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import bpy
import pytest

pytestmark = pytest.mark.skipif(
    not getattr(bpy.app, "module", False), reason="starts the bpy module anew"
)
SHOTS = ("frames", "denoised")
# As in a Python that lacks them: neither an import nor a look for them finds them.
WITHOUT = """
import json, os, sys
from importlib.machinery import PathFinder
usual = PathFinder.find_spec
def find(name, *more):
    lacking = name.partition(".")[0] in {"torch", "safetensors", "tqdm"}
    return None if lacking else usual(name, *more)
PathFinder.find_spec = find
from xrds_blender.command.main import main
for line in json.loads(sys.argv[1]):
    print("status", main(line.split()), "of", line, flush=True)
os._exit(0)
"""


def run(folder: Path, *lines: str) -> tuple[list[int], subprocess.CompletedProcess]:
    """Exit status of each command, all in one process, and what they printed."""
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT, json.dumps(lines)],
        capture_output=True,
        text=True,
        check=False,
        cwd=folder,
    )
    told = [x.split()[1] for x in done.stdout.splitlines() if x.startswith("status")]
    return [int(status) for status in told], done


def test_it_needs_no_torch(blend: Path) -> None:
    folder = blend.parent
    bpy.context.scene.frame_end = 3
    bpy.ops.wm.save_mainfile()
    status, done = run(
        folder,
        "render shot.blend -o still.png",
        "render shot.blend -o frames/#.exr -a --json",
        "render shot.blend --frames 1-3 --sample-cache samples",
        "denoise samples/####.exr -o denoised/#.exr --picture-only",
        "plan shot.blend",
        "info",
    )
    assert status == [0] * 6, done.stderr
    assert "network: none (No module named 'torch'); pip install" in done.stdout
    assert "denoiser: " in done.stdout
    assert "fast_x2.safetensors" in done.stdout
    told, _ = json.JSONDecoder().raw_decode(done.stdout[done.stdout.index("{") :])
    assert told["scale"] == 1
    assert [frame["temporal"]["radius"] for frame in told["frames"]] == [4, 4, 4]
    written = {path.relative_to(folder).as_posix() for path in folder.glob("*/*.exr")}
    assert written >= {f"{name}/{n}.exr" for name in SHOTS for n in (1, 2, 3)}
    assert (folder / "still.png").stat().st_size > 0


def test_super_resolution_says_what_to_install(blend: Path) -> None:
    lines = (
        "render shot.blend -o still.exr --scale 2",
        "upscale a.exr b.exr -o c.exr",
    )
    status, done = run(blend.parent, *lines)
    assert status == [1, 1]
    told = [line for line in done.stderr.splitlines() if line.startswith("xrds: ")]
    assert len(told) == 2
    for line in told:
        assert line.startswith("xrds: super-resolution needs PyTorch and safetensors,")
        assert "pip install xrds[network]" in line
    assert not (blend.parent / "still.exr").exists()
