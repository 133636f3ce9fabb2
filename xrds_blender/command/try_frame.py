"""`xrds try`: one frame by Cycles and by XRDS in the same seconds, side by side."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from xrds_core.arrays import Array
from xrds_core.errors import UsageError, warn
from xrds_core.files import check_output
from xrds_core.progress import duration

from ..planning.request import render_request
from ..planning.settings import QUALITIES, counted
from . import arguments
from .console import need_blender
from .options import RENDER_DEVICE_HELP, add_scene, choice_of, resolve_paths


def add_try(commands: Any) -> argparse.ArgumentParser:
    """Add `xrds try`."""
    command = commands.add_parser(
        "try", help="compare a frame by Cycles and by XRDS in the same seconds"
    )
    add_scene(command)
    add = command.add_argument
    add(
        "--frame",
        type=arguments.frame,
        dest="frames",
        metavar="N",
        help="the frame (default: the file's current one)",
    )
    add(
        "-o",
        "--out",
        type=Path,
        required=True,
        metavar="OUT",
        help="a .webp, .png or .jpg file, Cycles' picture left and XRDS' right; or an "
        ".exr file with both as layers",
    )
    add(
        "--temporal-radius",
        type=arguments.positive,
        metavar="N",
        help="neighbour frames on each side whose samples are reused (default: the "
        "file's, which is 4 unless it was changed)",
    )
    add(
        "--denoise",
        choices=QUALITIES,
        default="high",
        help="quality of XRDS' denoiser (default: high)",
    )
    add("--device", default="auto", help=RENDER_DEVICE_HELP)
    add("--threads", type=arguments.positive, metavar="N", help="of the processor")
    add(
        "--memory-limit",
        type=arguments.size_in_bytes,
        help="memory for the denoiser, such as 500M or 4G",
    )
    command.set_defaults(work=_try, lines=_lines)
    return command


def _try(options: argparse.Namespace) -> dict[str, Any]:
    need_blender("try")
    from ..rendering.try_frame import Way, try_frame
    from .picture_file import SHOWN
    from .scene_file import open_scene

    resolve_paths(options)
    suffix = options.out.suffix.lower()
    if suffix not in {*SHOWN, ".exr"}:
        raise UsageError(
            f"output {str(options.out)!r} must end in .webp, .png, .jpg or .exr"
        )
    check_output(options.out, [options.scene])
    scene = open_scene(options.scene, choice_of(options))
    radius = options.temporal_radius
    request = render_request(
        temporal_radius=scene.xrds.temporal_radius if radius is None else radius,
        denoise=options.denoise,
        device=options.device,
        threads=options.threads,
        memory_limit=options.memory_limit,
    )
    if options.frames:
        scene.frame_set(*options.frames)
    tried = try_frame(scene, request, warn)
    for note in tried.notes:
        warn(note)
    _write(options.out, scene, tried)

    def entry(way: Way) -> dict[str, Any]:
        return {
            "samples": way.samples,
            "at_most": way.at_most,
            "seconds": way.seconds,
            "finishing": way.finishing,
        }

    height, width = tried.xrds.pixels.shape[:2]
    return {
        "output": str(options.out),
        "frame": tried.frame,
        "resolution": [width, height],
        "cycles": entry(tried.cycles),
        "xrds": entry(tried.xrds) | {"frames": list(tried.frames)},
        "notes": list(tried.notes),
    }


def _write(path: Path, scene: Any, tried: Any) -> None:
    """Write both pictures, as the suffix says."""
    from xrds_core import exr

    from ..rendering.split import split_picture
    from .labels import draw_label
    from .picture_file import save_as_shown

    ways = (tried.cycles, tried.xrds)
    if path.suffix.lower() == ".exr":
        channels: dict[str, Array] = {}
        for way in ways:
            letters = "RGBA" if scene.render.film_transparent else "RGB"
            for i, letter in enumerate(letters):
                channels[f"{way.name}.{letter}"] = way.pixels[..., i]
        exr.write_picture(path, channels)
        return
    picture = split_picture(tried.cycles.pixels, tried.xrds.pixels)
    for way, at_right in zip(ways, (False, True), strict=True):
        draw_label(picture, _label(way.name, vars(way)), at_right)
    save_as_shown(path, picture, scene)


def _label(name: str, way: dict[str, Any]) -> str:
    """Who made a picture, of how many samples, in what time."""
    most = "up to " if way["at_most"] else ""
    samples = counted(way["samples"], "sample")
    return f"{name}, {most}{samples}, {duration(way['seconds'])}"


def _lines(result: dict[str, Any]) -> list[str]:
    labels = _label("Cycles", result["cycles"]), _label("XRDS", result["xrds"])
    return [f"{result['output']}: {'; '.join(labels)} a frame"]
