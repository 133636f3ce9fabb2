"""Options that several commands have, and the job that they describe."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..frame.job import RenderJob
from ..planning.plan import SAVINGS
from . import arguments

PRESETS = ("fast", "balanced", "paper")
GUIDES = ("fast", "full")
DEVICE_HELP = "auto, cpu, cuda, cuda:1, mps"


def add_job(command: argparse.ArgumentParser) -> None:
    """Add what `RenderJob` holds."""
    add = command.add_argument
    add("scene", type=Path, metavar="SCENE.blend")
    size = command.add_mutually_exclusive_group()
    size.add_argument("--scale", type=int, choices=(1, 2, 4, 8), default=2)
    size.add_argument("--plain", action="store_true", help="Cycles as the file has it")
    size.add_argument(
        "--time-budget",
        type=arguments.factor,
        metavar="SECONDS",
        help="of a frame; chooses scale, samples, guides, network and denoiser",
    )
    size.add_argument(
        "--quality",
        type=arguments.factor,
        metavar="DB",
        help="expected PSNR; chooses the same for the least seconds",
    )
    add("--samples", type=arguments.positive, help="of the low-resolution render")
    add("--guide-samples", type=arguments.positive, default=4)
    add("--guide-cache", type=Path, metavar="DIR", help="folder that keeps guides")
    add("--guide-limit", type=int, default=0, help="samples that kept guides gather")
    add("--keep-all", action="store_true", help="leave nothing out")
    add("--resolution", type=arguments.size, metavar="WxH")
    add("--seed", type=int)
    add_network(command)


def add_network(command: argparse.ArgumentParser) -> None:
    """Add what chooses a network and how it runs."""
    add = command.add_argument
    add("--guides", choices=GUIDES, default="fast")
    add("--preset", choices=PRESETS, default="fast")
    add(
        "--exposure", type=arguments.factor, help="hold it for an animation or a border"
    )
    add("--device", default="auto", help=DEVICE_HELP)
    add(
        "--memory-limit",
        type=arguments.size_in_bytes,
        help="of the network, as 500M or 4G",
    )
    add("--weights", type=Path, help="weights file, or folder of such")


def job_of(options: argparse.Namespace) -> RenderJob:
    """The job that the options of `add_job` describe; raises UsageError."""
    return RenderJob(
        scale=options.scale,
        samples=options.samples,
        guide_samples=options.guide_samples,
        guides=options.guides,
        preset=options.preset,
        device=options.device,
        exposure=options.exposure,
        seed=options.seed,
        plain=options.plain,
        time_budget=options.time_budget,
        quality=options.quality,
        memory_limit=options.memory_limit,
        weights=options.weights,
        savings=() if options.keep_all else SAVINGS,
        guide_cache=options.guide_cache,
        guide_limit=options.guide_limit,
    )
