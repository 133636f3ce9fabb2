"""`xrds bench stills`: error against run time of single frames."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from xrds_blender.command import arguments
from xrds_blender.command.console import need_blender
from xrds_blender.command.options import DEVICE_HELP
from xrds_core.superres.weights_header import PRESETS

from .bench_inputs import add_inputs, inputs


def add_stills(benches: Any) -> argparse.ArgumentParser:
    """Add `xrds bench stills`."""
    command: argparse.ArgumentParser = benches.add_parser(
        "stills", help="error against run time of single frames, by every method"
    )
    add_inputs(command)
    add = command.add_argument
    add(
        "--budgets",
        type=arguments.factors,
        default=(0.25, 0.5, 1.0, 2.0, 4.0, 8.0),
        help="multiples of each scene's 1 spp + OIDN, as 0.5,1,2",
    )
    add(
        "--preset",
        type=arguments.names(PRESETS),
        default=("fast",),
        help="networks, as fast,balanced; fast",
    )
    add("--rounds", type=arguments.positive, default=3, help="runs of each timed stage")
    add("--errors-only", action="store_true", help="time nothing")
    add(
        "--noise-thresholds",
        type=arguments.factors,
        help="of Cycles' adaptive sampling, whose frames take long to time; "
        "0.01,0.03,0.1,0.3",
    )
    add("--no-adaptive", action="store_true", help="leave out adaptive sampling")
    add(
        "--no-picker",
        action="store_true",
        help="leave out whole frames by --time-budget, one for each budget",
    )
    add(
        "--coarse",
        action="store_true",
        help="few samples for super-resolution: a third of the time",
    )
    add("--model", type=Path, help="where to write what --time-budget goes by")
    add("--device", default="auto", help=DEVICE_HELP)
    add("--weights", type=Path, help="folder of weights files")
    command.set_defaults(work=_stills)
    return command


def _stills(options: argparse.Namespace) -> dict[str, Any]:
    need_blender("bench")
    from ..bench.bench import bench
    from ..bench.sweep import NOISE_THRESHOLDS

    thresholds = options.noise_thresholds or NOISE_THRESHOLDS
    return bench(
        options.scenes,
        options.out,
        budgets=options.budgets,
        **inputs(options),
        presets=options.preset,
        rounds=options.rounds,
        timing=not options.errors_only,
        picker=not (options.errors_only or options.no_picker),
        noise_thresholds=() if options.no_adaptive else thresholds,
        coarse=options.coarse,
        model=options.model,
        weights=options.weights,
        device=options.device,
    )
