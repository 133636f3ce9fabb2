"""`xrds bench device-report`, `own-seconds`, `left-out`: seconds on this machine."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from xrds_blender.command import arguments
from xrds_blender.command.console import need_blender


def add_device_report(benches: Any) -> argparse.ArgumentParser:
    """Add `xrds bench device-report`."""
    command: argparse.ArgumentParser = benches.add_parser(
        "device-report",
        help="every stage on this machine's graphics card and on its processor",
    )
    add = command.add_argument
    add("--resolution", type=arguments.size, metavar="WxH", help="of the frames")
    add("--samples", type=arguments.integers, help="per frame, as 2,16")
    add("--reference-samples", type=arguments.positive, default=512, help="512")
    add("--rounds", type=arguments.positive, default=3, help="runs of each timed stage")
    add(
        "--minutes",
        type=arguments.factor,
        help="after which nothing more is begun; a second run goes on; 10",
    )
    command.set_defaults(work=_device_report)
    return command


def add_own_seconds(benches: Any) -> argparse.ArgumentParser:
    """Add `xrds bench own-seconds`."""
    command: argparse.ArgumentParser = benches.add_parser(
        "own-seconds",
        help="each part of finishing a frame of synthetic samples, on 1, 2, 4 cores",
    )
    add = command.add_argument
    add("size", type=arguments.size, metavar="WxH", help="of the frame")
    add("--samples", type=arguments.integers, default=(2, 16), help="as 2,16; 2,16")
    add("--rounds", type=arguments.positive, default=3, help="runs of each timed stage")
    command.set_defaults(work=_own_seconds)
    return command


def add_left_out(benches: Any) -> argparse.ArgumentParser:
    """Add `xrds bench left-out`."""
    command: argparse.ArgumentParser = benches.add_parser(
        "left-out",
        help="seconds that a super-resolution picture saves by what a scene lacks",
    )
    add = command.add_argument
    add("scenes", type=Path, nargs="+", metavar="SCENE.blend")
    add("--resolution", type=arguments.size, metavar="WxH", help="of the pictures")
    add("--rounds", type=arguments.positive, default=3, help="runs of each picture")
    command.set_defaults(work=_left_out)
    return command


def _device_report(options: argparse.Namespace) -> dict[str, Any]:
    need_blender("bench")
    from ..cards.report import MINUTES, SAMPLES, SIZES, bench_devices

    return bench_devices(
        options.out,
        sizes=(options.resolution,) if options.resolution else SIZES,
        samples=options.samples or SAMPLES,
        minutes=options.minutes or MINUTES,
        rounds=options.rounds,
        reference_samples=options.reference_samples,
    )


def _own_seconds(options: argparse.Namespace) -> dict[str, Any]:
    from ..shots.own_seconds import bench_own_seconds

    return bench_own_seconds(
        options.out, options.size, samples=options.samples, rounds=options.rounds
    )


def _left_out(options: argparse.Namespace) -> dict[str, Any]:
    need_blender("bench")
    from ..bench.left_out import bench_left_out

    return bench_left_out(
        options.scenes,
        options.out,
        resolution=options.resolution,
        rounds=options.rounds,
    )
