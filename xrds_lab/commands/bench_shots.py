"""`xrds bench shots`, `same-picture` and `light-parts`: shots of scene files."""

from __future__ import annotations

import argparse
from typing import Any

from xrds_blender.command import arguments
from xrds_blender.command.console import need_blender
from xrds_core.errors import UsageError

from .bench_inputs import add_inputs, inputs

MOTIONS = ("pan", "fast", "still", "objects", "both")
FILE = "file"


def add_shots(benches: Any) -> argparse.ArgumentParser:
    """Add `xrds bench shots`."""
    command: argparse.ArgumentParser = benches.add_parser(
        "shots", help="make shots of each scene and judge a frame of each"
    )
    add_inputs(command)
    add = command.add_argument
    _add_motions(command, MOTIONS, "all")
    add(
        "--samples",
        type=arguments.integers,
        default=(2,),
        help="per frame, as 2,16; 2",
    )
    add(
        "--radii",
        type=arguments.integers,
        default=(0, 1, 2, 4),
        help="temporal radii, as 0,4; more than 4 asks for more frames",
    )
    add(
        "--seeds",
        type=arguments.positive,
        default=1,
        help="render each shot so many times, with other noise (default: 1)",
    )
    add("--seconds", action="store_true", help="time whole frames; on a quiet machine")
    add(
        "--seconds-resolution",
        type=arguments.size,
        metavar="WxH",
        help="of the frames that are timed; the files' own",
    )
    add(
        "--seconds-samples",
        type=arguments.integers,
        default=(),
        help="that are timed, as 2,16: others lie on a line; all",
    )
    add("--rounds", type=arguments.positive, default=3, help="runs of each timed stage")
    add("--films", action="store_true", help="also the best and the worst shot as WebP")
    command.set_defaults(work=_shots)
    return command


def add_same_picture(benches: Any) -> argparse.ArgumentParser:
    """Add `xrds bench same-picture`."""
    command: argparse.ArgumentParser = benches.add_parser(
        "same-picture",
        help="time the picture of the file's samples, with fewer; on a quiet machine",
    )
    add_inputs(command)
    add = command.add_argument
    _add_motions(command, ("pan",), "pan")
    add("--samples", type=arguments.integers, help="of the file, as 16; 16,64,256")
    add(
        "--noise-thresholds",
        type=arguments.factors,
        help="of Cycles' adaptive sampling, as 0.1; none",
    )
    add("--frames", type=arguments.positive, help="of a shot, odd; 21")
    add(
        "--card",
        action="store_true",
        help="Cycles renders on this machine's graphics card",
    )
    add(
        "--around",
        type=arguments.size,
        metavar="WxH",
        help="render so much around each of the --windows",
    )
    command.set_defaults(work=_same_picture)
    return command


def add_light_parts(benches: Any) -> argparse.ArgumentParser:
    """Add `xrds bench light-parts`."""
    command: argparse.ArgumentParser = benches.add_parser(
        "light-parts", help="judge the parts of the light under a moving camera"
    )
    add_inputs(command)
    command.add_argument(
        "--samples", type=arguments.integers, default=(4,), help="per frame, as 2,4; 4"
    )
    command.set_defaults(work=_light_parts)
    return command


def _add_motions(
    command: argparse.ArgumentParser, default: tuple[str, ...], told: str
) -> None:
    command.add_argument(
        "--motions",
        type=arguments.names((*MOTIONS, FILE)),
        default=default,
        help=f"of {', '.join(MOTIONS)}; {told}; or {FILE}: what the file itself "
        "animates around its current frame",
    )


def _shots(options: argparse.Namespace) -> dict[str, Any]:
    need_blender("bench")
    from ..shots.bench import Measure, bench_shots

    return bench_shots(
        options.scenes,
        options.out,
        Measure(
            options.motions,
            options.samples,
            options.radii,
            options.seeds,
            seconds=options.seconds,
            seconds_at=options.seconds_resolution,
            seconds_samples=options.seconds_samples,
            films=options.films,
            rounds=options.rounds,
        ),
        **inputs(options),
    )


def _same_picture(options: argparse.Namespace) -> dict[str, Any]:
    need_blender("bench")
    from ..cards.cycles import CPU, find_card
    from ..shots.sooner import FRAMES, MOST_SAMPLES, SAMPLES, Case, bench_same_picture

    thresholds = options.noise_thresholds or ()
    counts = options.samples or (() if thresholds else SAMPLES)
    cases = [
        Case(*case, frames=options.frames or FRAMES)
        for motion in options.motions
        for case in (
            *((motion, samples, None) for samples in counts),
            *((motion, MOST_SAMPLES, threshold) for threshold in thresholds),
        )
    ]
    device = find_card() if options.card else CPU
    if options.card and device == CPU:
        raise UsageError("Cycles finds no graphics card here: leave out --card")
    return bench_same_picture(
        options.scenes,
        options.out,
        cases,
        around=options.around,
        device=device,
        **inputs(options),
    )


def _light_parts(options: argparse.Namespace) -> dict[str, Any]:
    need_blender("bench")
    from ..shots.light import bench_light_parts

    return bench_light_parts(
        options.scenes, options.out, options.samples, **inputs(options)
    )
