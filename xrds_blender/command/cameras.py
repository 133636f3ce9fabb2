"""`xrds cameras`: a .blend file's cameras, for `xrds denoise --camera`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from xrds_core.files import check_output, write_json

from . import arguments
from .console import need_blender
from .options import add_scene, choice_of, resolve_paths


def add_cameras(commands: Any) -> argparse.ArgumentParser:
    """Add `xrds cameras`."""
    command = commands.add_parser(
        "cameras", help="write the cameras of a .blend file for xrds denoise"
    )
    add_scene(command)
    add = command.add_argument
    add("-o", "--out", type=Path, required=True, metavar="CAMERAS.json")
    add(
        "--frames",
        type=arguments.frames,
        metavar="A-B",
        help="such as 1-24 (default: those of the file)",
    )
    command.set_defaults(work=_cameras, lines=_lines)
    return command


def _cameras(options: argparse.Namespace) -> dict[str, Any]:
    need_blender("cameras")
    from xrds_core.shot_files.cameras import to_json

    from ..rendering.shot import shot_cameras
    from .scene_file import open_scene

    resolve_paths(options)
    check_output(options.out, [options.scene])
    scene = open_scene(options.scene, choice_of(options))
    whole = range(scene.frame_start, scene.frame_end + 1, scene.frame_step)
    cameras = shot_cameras(scene, options.frames or whole)
    entries = {str(number): to_json(camera) for number, camera in cameras.items()}
    write_json(options.out, entries)
    return {"output": str(options.out), "frames": list(cameras)}


def _lines(result: dict[str, Any]) -> list[str]:
    return [f"{result['output']}: cameras of {len(result['frames'])} frames"]
