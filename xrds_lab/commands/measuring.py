"""The commands that measure: error, speed and stability."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from xrds_blender.command import arguments
from xrds_blender.command.console import need_blender, no_lines
from xrds_blender.command.options import DEVICE_HELP
from xrds_core.errors import XRDSError
from xrds_core.superres.weights_header import PRESETS

from ..progress import report_line
from . import bench_gallery, bench_machine, bench_shots, bench_stills

STABILITY = ("arrays", "large", "scenes", "shots", "load", "accumulation")
BENCHES = (
    bench_stills.add_stills,
    bench_shots.add_shots,
    bench_shots.add_same_picture,
    bench_shots.add_light_parts,
    bench_gallery.add_gallery,
    bench_machine.add_device_report,
    bench_machine.add_own_seconds,
    bench_machine.add_left_out,
)


def add_evaluate(commands: Any) -> argparse.ArgumentParser:
    """Add `xrds evaluate`."""
    command = commands.add_parser("evaluate", help="measure error against references")
    add = command.add_argument
    add("scenes", type=Path, nargs="+", metavar="SCENE.blend")
    add("--windows", type=Path, required=True, help="JSON file of windows")
    add("--references", type=Path, required=True, help="folder of NAME.exr")
    add("--cache", type=Path, help="folder that keeps rendered inputs")
    add("--scale", type=arguments.integers, default=(2, 4), help="as 2,4")
    add(
        "--preset",
        type=arguments.names(PRESETS),
        default=("fast",),
        help="as fast,balanced",
    )
    add("--weights", type=Path, help="folder of weights files")
    add("-o", "--out", type=arguments.folder, help="folder for results.json")
    command.set_defaults(work=_evaluate, lines=no_lines)
    return command


def _evaluate(options: argparse.Namespace) -> dict[str, Any]:
    need_blender("evaluate")
    from ..bench.evaluate import evaluate

    return evaluate(
        options.scenes,
        windows=options.windows,
        references=options.references,
        cache=options.cache,
        scales=options.scale,
        presets=options.preset,
        out=options.out,
        weights=options.weights,
        progress=report_line,
    )


def add_stability(commands: Any) -> argparse.ArgumentParser:
    """Add `xrds stability`."""
    command = commands.add_parser("stability", help="measure stiff and extreme cases")
    add = command.add_argument
    add(
        "-o",
        "--out",
        type=arguments.folder,
        required=True,
        help="folder for results.json and report",
    )
    add(
        "--parts",
        type=arguments.names(STABILITY),
        default=STABILITY,
        help="as arrays,large",
    )
    add(
        "--quick",
        action="store_true",
        help="of the networks fast x2 in single precision alone",
    )
    add("--resume", action="store_true", help="leave out what is measured in DIR")
    add("--cache", type=Path, help="folder that keeps rendered pictures")
    add("--device", default="auto", help=DEVICE_HELP)
    add("--weights", type=Path, help="folder of weights files")
    add(
        "--fuzz",
        type=arguments.factor,
        metavar="MINUTES",
        help="instead denoise odd shots for so long; faults go to fuzz.json",
    )
    add("--seed", type=arguments.whole, default=0, help="of --fuzz")
    add(
        "--case",
        type=arguments.whole,
        help="of --fuzz: this one alone, whose files are kept",
    )
    command.set_defaults(work=_stability, lines=no_lines)
    return command


def _stability(options: argparse.Namespace) -> dict[str, Any]:
    if options.fuzz is not None or options.case is not None:
        return _fuzz(options)
    if set(options.parts) - {"arrays", "large"}:
        need_blender("stability")
    from ..stability.suite import stability

    result = stability(
        options.out,
        parts=options.parts,
        cache=options.cache,
        device=options.device,
        weights=options.weights,
        quick=options.quick,
        resume=options.resume,
        progress=report_line,
    )
    if not result["passed"]:
        raise XRDSError(f"some bounds are not held: see {options.out / 'report.md'}")
    return result


def _fuzz(options: argparse.Namespace) -> dict[str, Any]:
    from ..stability import fuzz

    if options.case is not None:
        runs = fuzz.keep_case(options.out, options.seed, options.case)
        return {"runs": [vars(run) for run in runs]}
    result = fuzz.fuzz(
        options.out,
        options.fuzz,
        seed=options.seed,
        resume=options.resume,
        progress=report_line,
    )
    if not result["passed"]:
        raise XRDSError(
            f"{result['wrong']} of {result['cases']} cases have faults: see "
            f"{options.out / 'fuzz.json'}"
        )
    return result


def add_bench(commands: Any) -> argparse.ArgumentParser:
    """Add `xrds bench`, whose commands measure one thing each."""
    command: argparse.ArgumentParser = commands.add_parser(
        "bench", help="measure pictures and seconds; write a report"
    )
    benches = command.add_subparsers(dest="bench", required=True, metavar="WHAT")
    for add in BENCHES:
        bench = add(benches)
        bench.add_argument(
            "-o",
            "--out",
            type=arguments.folder,
            required=True,
            help="folder; an unfinished run resumes",
        )
        bench.add_argument(
            "--json",
            action="store_true",
            default=argparse.SUPPRESS,  # or it undoes one before the bench's name
            help="print JSON on stdout and everything else on stderr",
        )
        bench.set_defaults(lines=_bench_lines)
    return command


def _bench_lines(result: dict[str, Any]) -> list[str]:
    failed = [f"left out: {name}: {why}" for name, why in result["failures"].items()]
    points = next(result[x] for x in ("points", "shots", "parts") if x in result)
    return [f"{len(points)} points", *failed]
