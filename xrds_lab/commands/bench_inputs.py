"""What the benches of scene files take in common: the scenes and their references."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from xrds_blender.command import arguments

REFERENCE_SAMPLES = 128


def add_inputs(command: argparse.ArgumentParser) -> None:
    """Add the scenes, and what they are rendered and judged with."""
    add = command.add_argument
    add("scenes", type=Path, nargs="+", metavar="SCENE.blend")
    add(
        "--resolution",
        type=arguments.size,
        metavar="WxH",
        help="in place of the files' own",
    )
    add(
        "--reference-samples",
        type=arguments.positive,
        default=REFERENCE_SAMPLES,
        help=f"of each half; {REFERENCE_SAMPLES}",
    )
    add("--windows", type=Path, help="JSON file of windows that errors are taken on")
    add("--references", type=Path, help="folder of NAME.exr, for the windows")
    add("--cache", type=Path, help="folder of rendered inputs; OUT/cache")


def inputs(options: argparse.Namespace) -> dict[str, Any]:
    """What a bench measures on, beside the scenes."""
    names = ("windows", "references", "resolution", "cache", "reference_samples")
    return {name: getattr(options, name) for name in names}
