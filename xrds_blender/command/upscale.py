"""`xrds upscale`: pictures out of EXR files, without Blender."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from ..planning.settings import SCALES
from . import arguments
from .options import add_network, add_output, add_read_limit, encoding_of


def add_upscale(commands: Any) -> argparse.ArgumentParser:
    """Add `xrds upscale`."""
    command = commands.add_parser(
        "upscale", help="enlarge a render that lies in EXR files"
    )
    add = command.add_argument
    add(
        "beauty",
        type=Path,
        metavar="BEAUTY.exr",
        help="low-resolution render",
    )
    add(
        "guide_file",
        type=Path,
        metavar="GUIDES.exr",
        help="full-resolution passes",
    )
    add_output(
        command,
        type=Path,
        required=True,
        metavar="OUT.exr",
        help="the enlarged picture",
    )
    add(
        "--scale",
        type=int,
        choices=SCALES,
        default=2,
        help="size of the guides over that of the picture (default: 2)",
    )
    add(
        "--guide-samples",
        type=arguments.positive,
        metavar="N",
        help="samples per pixel of GUIDES.exr; few are denoised first (default: many)",
    )
    add_read_limit(command)
    add_network(command)
    command.set_defaults(work=_upscale, lines=_lines)
    return command


def _upscale(options: argparse.Namespace) -> dict[str, Any]:
    from xrds_core.exr import raw_header

    from ..rendering.torch_folder import load

    raw_header.allow(options.read_limit)
    return load("superres.exr_upscale").upscale_file(
        options.beauty,
        options.guide_file,
        options.out,
        scale=options.scale,
        preset=options.preset,
        guide_samples=options.guide_samples,
        exposure=options.exposure,
        device=options.device,
        memory_limit=options.memory_limit,
        weights=options.weights,
        encoding=encoding_of(options),
        threads=options.threads,
    )


def _lines(result: dict[str, Any]) -> list[str]:
    from xrds_core.holes import describe_bad_pixels

    lines = [f"{result['output']}: {result['seconds']:.1f} s"]
    if result["bad_pixels"]:
        lines.append(f"  {describe_bad_pixels(result['bad_pixels'])}")
    return lines
