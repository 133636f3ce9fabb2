"""`xrds denoise`: a shot that lies in EXR files, without Blender or PyTorch."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from xrds_core.errors import UsageError, XRDSError, warn
from xrds_core.frames import in_words
from xrds_core.shot_files.pass_names import PASSES, PassNames

from ..planning.settings import QUALITIES
from . import arguments
from .options import add_light, add_read_limit, add_strength

SPACES = ("camera", "world")


def add_denoise(commands: Any) -> argparse.ArgumentParser:
    """Add `xrds denoise`."""
    command = commands.add_parser(
        "denoise", help="denoise frames that lie in EXR files, as a shot"
    )
    add = command.add_argument
    add(
        "source", nargs="?", metavar="IN.exr", help="noisy frames; #### is their number"
    )
    add("-i", "--input", metavar="IN.exr", help="the same, as other denoisers have it")
    add("-o", "--out", required=True, metavar="OUT.exr", help="denoised frames")
    add(
        "--frames",
        type=arguments.frames,
        metavar="A-B",
        help="first and last frame, such as 1-24, or 1,3,5-10 (default: all)",
    )
    add(
        "--temporal-radius",
        type=arguments.whole,
        metavar="N",
        help="neighbour frames on each side whose samples are reused (default: 4)",
    )
    add_strength(command, "1", 1.0)
    add(
        "--denoise",
        choices=QUALITIES,
        default="high",
        help="quality of the denoiser (default: high)",
    )
    _add_inputs(command)
    add(
        "--crop",
        type=arguments.crop,
        metavar="WxH+X+Y",
        help="denoise and write this part of the picture alone, as 640x360+100+50",
    )
    add("--resume", action="store_true", help="skip frames whose files are complete")
    add(
        "--picture-only",
        action="store_true",
        help="write R, G, B and A alone, not the input's other channels",
    )
    _add_machine(command)
    add_read_limit(command)
    _add_reading(command)
    command.set_defaults(work=_denoise, lines=_lines, check=_check)
    return command


def _add_inputs(command: argparse.ArgumentParser) -> None:
    """Add what is read beside the picture."""
    add = command.add_argument
    add(
        "--halves",
        metavar="B.exr",
        help="files with as many other samples of each frame; #### is its number: no "
        "neighbour that shows something else is believed then",
    )
    add(
        "--also",
        action="append",
        default=[],
        metavar="PARTS.exr",
        help="further files of the same frames, with passes that IN.exr lacks; may be "
        "given several times",
    )
    add_light(command)
    add(
        "--passes-from",
        type=Path,
        metavar="FILE.toml",
        help="how a renderer calls the parts of its light, where it is not known",
    )


def _add_machine(command: argparse.ArgumentParser) -> None:
    """Add what the denoiser runs on."""
    add = command.add_argument
    add("--device", default="auto", help="of the denoiser: auto, cpu, cuda, metal")
    add("--threads", type=arguments.positive, help="of the denoiser (default: all)")
    add(
        "--memory-limit",
        type=arguments.size_in_bytes,
        help="memory for the denoiser, such as 500M or 4G",
    )


def _add_reading(command: argparse.ArgumentParser) -> None:
    """Add how files are read that do not say it themselves."""
    group = command.add_argument_group("passes, where they have unusual names")
    for name in PASSES:
        group.add_argument(f"--{name}", metavar="NAME", help=_PASS_HELP[name])
    add = command.add_argument_group("what files may not say").add_argument
    add("--camera", type=Path, metavar="FILE.json", help="cameras, by frame number")
    add(
        "--samples",
        type=arguments.positive,
        help="per pixel (default: as the file says, or 16)",
    )
    add(
        "--normal-space", choices=SPACES, help="(default: world but for Cycles' guides)"
    )
    add("--position-space", choices=SPACES, help="(default: world)")
    add(
        "--motion-scale",
        type=arguments.pair,
        metavar="X,Y",
        help="factors that make a motion pass of two channels pixels to the next "
        "frame, x to the right and y upwards",
    )


_PASS_HELP = {
    "beauty": "noisy radiance",
    "albedo": "albedo",
    "normal": "normals",
    "position": "place of the first hit",
    "depth": "depth along the camera's axis",
    "vector": "motion",
}


def _denoise(options: argparse.Namespace) -> dict[str, Any]:
    from xrds_core.denoising import Denoiser
    from xrds_core.denoising.light_passes import Wanted, read_renderers
    from xrds_core.exr import raw_header
    from xrds_core.shot_files.cameras import read_cameras
    from xrds_core.shot_files.frame_file import Reading
    from xrds_core.shot_files.sequence import Files, denoise_sequence

    raw_header.allow(options.read_limit)
    reading = Reading(
        PassNames(**{name: getattr(options, name) for name in PASSES}),
        cameras=read_cameras(options.camera) if options.camera else None,
        samples=options.samples,
        normal_space=options.normal_space,
        position_space=options.position_space,
        motion_scale=options.motion_scale or (1.0, 1.0),
        halves=options.halves,
        light=Wanted(
            options.passes, options.light_aovs, read_renderers(options.passes_from)
        ),
        also=tuple(options.also),
    )
    denoiser = Denoiser(
        options.denoise,
        options.device,
        threads=options.threads or 0,
        memory_limit=options.memory_limit,
    )
    others = (options.camera,) if options.camera else ()
    return denoise_sequence(
        Files(
            _source(options),
            options.out,
            options.picture_only,
            others,
            options.halves,
            tuple(options.also),
            options.crop,
        ),
        denoiser,
        frames=options.frames,
        radius=options.temporal_radius,
        strength=options.strength,
        reading=reading,
        resume=options.resume,
        say=warn,
    )


def _source(options: argparse.Namespace) -> str:
    """The input, which has two ways to be given; raises UsageError for none or both."""
    given = [x for x in (options.source, options.input) if x is not None]
    if len(given) != 1:
        raise UsageError("give the noisy frames once, as IN.exr or with -i IN.exr")
    return str(given[0])


def _lines(result: dict[str, Any]) -> list[str]:
    from xrds_core.holes import describe_bad_pixels

    done = [entry["frame"] for entry in result["frames"]]
    outcomes = {"denoised": done, "skipped, complete": result["kept"]}
    lines = [
        f"{result['output']}: frames {in_words(numbers)} {outcome}"
        for outcome, numbers in outcomes.items()
        if numbers
    ]
    return lines + [
        f"  frame {entry['frame']}: {describe_bad_pixels(entry['bad_pixels'])}"
        for entry in result["frames"]
        if entry["bad_pixels"]
    ]


def _check(result: dict[str, Any]) -> None:
    """Fail, after all that could be done, where a requested frame is missing."""
    missing = [entry["frame"] for entry in result["left_out"]]
    if missing:
        raise XRDSError(
            f"frames {in_words(missing)} could not be finished and were left out; "
            "render them again, then denoise with --resume"
        )
