"""`xrds info`: versions, devices, weights, costs."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from .console import lines_of


def add_info(commands: Any) -> argparse.ArgumentParser:
    """Add `xrds info`."""
    command = commands.add_parser(
        "info", help="show versions, devices, weights and costs"
    )
    command.add_argument(
        "--weights",
        type=Path,
        metavar="DIR",
        help="folder of weights files; default: the shipped ones",
    )
    command.set_defaults(work=_info, lines=lines_of("xrds_core.info"))
    return command


def _info(options: argparse.Namespace) -> dict[str, Any]:
    from xrds_core.info import info

    return info(_blender_version(), options.weights)


def _blender_version() -> str | None:
    try:
        import bpy
    except ImportError:
        return None
    return bpy.app.version_string
