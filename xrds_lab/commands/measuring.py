"""The commands that measure: error, speed, stability and what the plan saves."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from xrds_blender.command import arguments
from xrds_blender.command.console import need_blender, no_lines
from xrds_blender.command.options import DEVICE_HELP
from xrds_core.errors import UsageError, XRDSError
from xrds_core.superres.weights_header import PRESETS

from ..progress import report_line

MOTIONS = ("pan", "fast", "still", "objects", "both")
FILE = "file"
GALLERY_HALVES = ("choosing", "judging")
STABILITY = ("arrays", "large", "scenes", "shots", "load", "accumulation")


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
    add("--timing", action="store_true", help="also time whole frames")
    add("--timing-scenes", type=arguments.words, help="of these alone, as bmw27,house")
    add("--weights", type=Path, help="folder of weights files")
    add("-o", "--out", type=arguments.folder, help="folder for results.json")
    add("--sheets", type=Path, help="folder for a JPEG of crops for each scene")
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
        timing=options.timing,
        timing_scenes=options.timing_scenes,
        out=options.out,
        sheets=options.sheets,
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
    """Add `xrds bench`."""
    command = commands.add_parser(
        "bench", help="error against run time, of frames or of shots; a report"
    )
    add = command.add_argument
    add("scenes", type=Path, nargs="*", metavar="SCENE.blend")
    add(
        "-o",
        "--out",
        type=arguments.folder,
        required=True,
        help="folder; an unfinished run resumes",
    )
    add(
        "--budgets",
        type=arguments.factors,
        default=(0.25, 0.5, 1.0, 2.0, 4.0, 8.0),
        help="multiples of each scene's 1 spp + OIDN, as 0.5,1,2",
    )
    add(
        "--resolution",
        type=arguments.size,
        metavar="WxH",
        help="in place of the files' own",
    )
    add(
        "--reference-samples",
        type=arguments.positive,
        help="of each half; 128, of the gallery 512",
    )
    add("--windows", type=Path, help="JSON file of windows that errors are taken on")
    add("--references", type=Path, help="folder of NAME.exr, for the windows")
    add("--cache", type=Path, help="folder of rendered inputs; OUT/cache")
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
    _add_shots(command.add_argument_group("shots, instead of single frames"))
    _add_gallery(command.add_argument_group("the gallery, instead of scenes"))
    _add_device_report(command.add_argument_group("graphics cards, instead of scenes"))
    _add_own_seconds(command.add_argument_group("our own seconds, instead of scenes"))
    command.set_defaults(work=_bench, lines=_bench_lines)
    return command


def _add_shots(group: Any) -> None:
    add = group.add_argument
    add("--shots", action="store_true", help="make a shot of each scene and measure it")
    add(
        "--motions",
        type=arguments.names((*MOTIONS, FILE)),
        help=f"of {', '.join(MOTIONS)}; all, with --same-picture pan; or {FILE}: "
        "what the file itself animates around its current frame",
    )
    add(
        "--samples",
        type=arguments.integers,
        help="per frame, as 2,16; 2, of the gallery 2,4,16, with --same-picture "
        "16,64,256",
    )
    add(
        "--same-picture",
        action="store_true",
        help="time the picture of the file's samples, with fewer; on a quiet machine",
    )
    add(
        "--card",
        action="store_true",
        help="with --same-picture: Cycles renders on this machine's graphics card",
    )
    add(
        "--around",
        type=arguments.size,
        metavar="WxH",
        help="with --same-picture: render so much around each of the --windows",
    )
    add(
        "--light-parts",
        action="store_true",
        help="judge the parts of the light under a moving camera",
    )
    add(
        "--radii",
        type=arguments.integers,
        default=(0, 1, 2, 4),
        help="temporal radii, as 0,4; more than 4 asks for more frames",
    )
    add(
        "--pair-samples",
        type=arguments.whole,
        default=64,
        help="of the frame that flicker under a moving camera is judged by; 0: none",
    )
    add(
        "--seeds",
        type=arguments.positive,
        default=1,
        help="render each shot so many times, with other noise (default: 1)",
    )
    add(
        "--equal",
        action="store_true",
        help="find the samples with which Cycles + OIDN is as good under pan",
    )
    add("--seconds", action="store_true", help="time whole frames; on a quiet machine")
    add(
        "--seconds-resolution",
        type=arguments.size,
        metavar="WxH",
        help="of the frames that are timed; the files' own",
    )
    add("--films", action="store_true", help="also the best and the worst shot as WebP")


def _add_gallery(group: Any) -> None:
    add = group.add_argument
    add(
        "--gallery",
        nargs="*",
        metavar="NAME",
        help="judge small shots, by name or all, block by block against frames alone",
    )
    add("--half", choices=GALLERY_HALVES, help="of the gallery: its shots alone")
    add("--middle-only", action="store_true", help="judge no first frames")
    add("--references-only", action="store_true", help="render these, judge nothing")
    add(
        "--crops",
        action="store_true",
        help="also crops.webp: the shots with neighbours that nothing judges, by XRDS",
    )


def _add_device_report(group: Any) -> None:
    add = group.add_argument
    add(
        "--device-report",
        action="store_true",
        help="every stage on this machine's graphics card and on its processor",
    )
    add(
        "--minutes",
        type=arguments.factor,
        default=20.0,
        help="after which nothing more is begun; a second run goes on (default: 20)",
    )


def _add_own_seconds(group: Any) -> None:
    group.add_argument(
        "--own-seconds",
        type=arguments.size,
        metavar="WxH",
        help="each part of finishing a frame of synthetic samples, on 1, 2, 4 cores",
    )


def _own_seconds(options: argparse.Namespace) -> dict[str, Any]:
    from ..shots.own_seconds import bench_own_seconds

    return bench_own_seconds(
        options.out,
        options.own_seconds,
        samples=options.samples or (2, 16),
        rounds=options.rounds,
    )


def _bench(options: argparse.Namespace) -> dict[str, Any]:
    if options.own_seconds:
        return _own_seconds(options)
    need_blender("bench")
    if options.gallery is not None:
        return _bench_gallery(options)
    if options.device_report:
        return _device_report(options)
    if not options.scenes:
        raise UsageError(
            "no scenes: give files, or --gallery, --device-report or --own-seconds"
        )
    kinds = {
        "same_picture": _bench_same_picture,
        "light_parts": _bench_light_parts,
        "shots": _bench_shots,
    }
    chosen = [work for name, work in kinds.items() if getattr(options, name)]
    return (chosen or [_bench_frames])[0](options)


def _bench_frames(options: argparse.Namespace) -> dict[str, Any]:
    from ..bench.bench import bench
    from ..bench.sweep import NOISE_THRESHOLDS

    thresholds = options.noise_thresholds or NOISE_THRESHOLDS
    return bench(
        options.scenes,
        options.out,
        budgets=options.budgets,
        **_inputs(options),
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


def _device_report(options: argparse.Namespace) -> dict[str, Any]:
    from ..cards.report import SAMPLES, SIZES, bench_devices

    return bench_devices(
        options.out,
        sizes=(options.resolution,) if options.resolution else SIZES,
        samples=options.samples or SAMPLES,
        minutes=options.minutes,
        rounds=options.rounds,
        reference_samples=options.reference_samples or 512,
    )


def _bench_gallery(options: argparse.Namespace) -> dict[str, Any]:
    from ..gallery.bench import bench_gallery
    from ..gallery.frames import REFERENCE_SAMPLES, Measure
    from ..gallery.stage import SIZE
    from ..gallery.table import SAMPLES

    measure = Measure(
        options.samples or SAMPLES,
        options.reference_samples or REFERENCE_SAMPLES,
        options.resolution or SIZE,
        options.middle_only,
    )
    return bench_gallery(
        options.gallery,
        options.out,
        measure,
        cache=options.cache,
        half=options.half,
        references_only=options.references_only,
        crops=options.crops,
    )


def _bench_shots(options: argparse.Namespace) -> dict[str, Any]:
    from ..shots.bench import Measure, bench_shots

    return bench_shots(
        options.scenes,
        options.out,
        Measure(
            options.motions or MOTIONS,
            options.samples or (2,),
            options.radii,
            options.pair_samples,
            options.seeds,
            equal_quality=options.equal,
            seconds=options.seconds,
            seconds_at=options.seconds_resolution,
            films=options.films,
            rounds=options.rounds,
        ),
        **_inputs(options),
    )


def _bench_same_picture(options: argparse.Namespace) -> dict[str, Any]:
    from ..cards.cycles import CPU, find_card
    from ..shots.sooner import MOST_SAMPLES, SAMPLES, Case, bench_same_picture

    thresholds = options.noise_thresholds or ()
    counts = options.samples or (() if thresholds else SAMPLES)
    cases = [
        case
        for motion in options.motions or ("pan",)
        for case in (
            *(Case(motion, samples) for samples in counts),
            *(Case(motion, MOST_SAMPLES, threshold) for threshold in thresholds),
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
        **_inputs(options),
    )


def _bench_light_parts(options: argparse.Namespace) -> dict[str, Any]:
    from ..shots.light import bench_light_parts

    samples = options.samples or (4,)
    return bench_light_parts(options.scenes, options.out, samples, **_inputs(options))


def _inputs(options: argparse.Namespace) -> dict[str, Any]:
    """What every kind of bench measures on."""
    names = ("windows", "references", "resolution", "cache")
    given = {name: getattr(options, name) for name in names}
    return given | {"reference_samples": options.reference_samples or 128}


def _bench_lines(result: dict[str, Any]) -> list[str]:
    failed = [f"left out: {name}: {why}" for name, why in result["failures"].items()]
    points = next(result[x] for x in ("points", "shots", "parts") if x in result)
    return [f"{len(points)} points", *failed]
