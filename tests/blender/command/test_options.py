"""Every option that a command takes leads somewhere, or is refused."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

import xrds_core.denoising
import xrds_core.denoising.light_passes
import xrds_core.exr.raw_header
import xrds_core.info
import xrds_core.shot_files.cameras
import xrds_core.shot_files.sequence
from xrds_blender.command import cameras, main, render, render_file, scene_file
from xrds_blender.rendering import explain, torch_folder
from xrds_blender.rendering import shot as shot_cameras
from xrds_core import files
from xrds_core.errors import UsageError

BASE = {
    "render": "render a.blend -o a.####.exr --frames 1-3",
    "plan": "plan a.blend --frames 1-3",
    "denoise": "denoise a.####.exr -o b.####.exr",
    "cameras": "cameras a.blend -o c.json",
    "upscale": "upscale a.exr b.exr -o c.exr",
    "info": "info",
}
VALUES = {
    "--albedo": "other",
    "--also": "c.####.exr",
    "--beauty": "other",
    "--camera": "other",
    "--crop": "8x8+1+1",
    "--deadline": "8h",
    "--denoise": "fast",
    "--depth": "other",
    "--device": "cpu",
    "--exposure": "2",
    "--exr-codec": "piz",
    "--exr-depth": "half",
    "--frame": "7",
    "--frames": "7-9",
    "--guide-cache": "folder",
    "--guide-limit": "3",
    "--guide-samples": "7",
    "--halves": "h.####.exr",
    "--input": "c.exr",
    "--light-aovs": "sparks",
    "--memory-limit": "3G",
    "--motion-scale": "2,3",
    "--noise-threshold": "0.5",
    "--normal": "other",
    "--normal-space": "camera",
    "--out": "other.exr",
    "--passes": "all",
    "--passes-from": "a.toml",
    "--position": "other",
    "--position-space": "camera",
    "--preset": "balanced",
    "--read-limit": "3G",
    "--resolution": "64x32",
    "--sample-cache": "folder",
    "--samples": "7",
    "--scale": "4",
    "--scene": "other",
    "--seed": "7",
    "--strength": "0.5",
    "--temporal-radius": "2",
    "--threads": "3",
    "--time-budget": "9",
    "--vector": "other",
    "--view-layer": "other",
    "--weights": "folder",
}


def actions(command: str) -> list[argparse.Action]:
    parser = main._parser([command])
    commands = next(
        x for x in parser._actions if isinstance(x, argparse._SubParsersAction)
    )
    found = commands.choices[command]._actions
    # --json is read by `main`, and --help by argparse
    return [x for x in found if x.option_strings and x.dest not in {"json", "help"}]


OPTIONS = [
    (command, action.option_strings[-1], action.nargs == 0)
    for command in BASE
    for action in actions(command)
]


@pytest.fixture
def said(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """All that reaches what does the work, in the place of which this stands."""
    told: list[Any] = []

    def note(*words: Any, **more: Any) -> Any:
        told.append((words, more))
        return {"output": "", "frames": []}

    for module in (render, cameras):
        monkeypatch.setattr(module, "need_blender", lambda _: None)
    for module, name in (
        (render_file, "render_file"),
        (explain, "explain"),
        (shot_cameras, "shot_cameras"),
        (cameras, "write_json"),
        (cameras, "check_output"),
        (files, "check_output"),
        (xrds_core.denoising, "Denoiser"),
        (xrds_core.exr.raw_header, "allow"),
        (xrds_core.denoising.light_passes, "read_renderers"),
        (xrds_core.shot_files.cameras, "read_cameras"),
        (xrds_core.shot_files.sequence, "denoise_sequence"),
        (xrds_core.info, "info"),
    ):
        monkeypatch.setattr(module, name, note)
    monkeypatch.setattr(shot_cameras, "shot_cameras", lambda *x: note(*x) and {})
    scene = argparse.Namespace(frame_start=1, frame_end=2, frame_step=1)
    monkeypatch.setattr(
        scene_file, "open_scene", lambda *words: told.append(words) or scene
    )
    upscale = argparse.Namespace(upscale_file=note)
    monkeypatch.setattr(torch_folder, "load", lambda _: upscale)
    return told


def outcome(line: str, said: list[Any]) -> str:
    """What the command's work was told; the error where it is refused."""
    said.clear()
    words = line.split()
    options = main._parser(words).parse_args(words)
    try:
        options.work(options)
    except UsageError as error:
        return str(error)
    return repr(said)


@pytest.mark.parametrize(("command", "option", "is_flag"), OPTIONS)
def test_it_changes_what_is_done(
    command: str, option: str, is_flag: bool, said: list[Any]
) -> None:
    base = BASE[command]
    if option in {"--frame", "--animation"}:  # in the place of --frames
        base = base.removesuffix(" --frames 1-3")
    more = option if is_flag else f"{option} {VALUES[option]}"
    assert outcome(f"{base} {more}", said) != outcome(base, said)


PATHS = [
    ("render", "--out"),
    ("render", "--sample-cache"),
    ("render", "--guide-cache"),
    ("render", "--weights"),
    ("plan", "--guide-cache"),
    ("cameras", "--out"),
]


@pytest.mark.parametrize(("command", "option"), PATHS)
def test_two_slashes_lie_beside_the_blend(
    command: str, option: str, said: list[Any]
) -> None:
    """As in Blender: not in the root folder of the disk."""
    line = f"{BASE[command]} {option} //here/x.exr".replace("a.blend", "shots/a.blend")
    found = outcome(line, said)
    beside = Path("shots").resolve() / "here" / "x.exr"
    assert str(beside) in found
    assert "//here" not in found
