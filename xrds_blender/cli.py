"""`xrds ...` and `blender --command xrds ...`: parse, call the work, print.

Exit status: 0 done, 1 failed, 2 wrong usage, 130 interrupted. With --json, stdout
holds the JSON alone.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NoReturn

from xrds_core.errors import UsageError, XRDSError

from . import arguments, cli_training, console
from .commands import lines_of, need_blender

PRESETS = ("fast", "balanced", "paper")
GUIDES = ("fast", "full")
STABILITY = ("arrays", "large", "scenes", "shots", "load")
Work = Callable[[argparse.Namespace], dict[str, Any] | None]


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status."""
    try:
        options = _parser().parse_args(argv)
    except SystemExit as end:  # argparse has told why
        return int(end.code or 0)
    if not options.json:
        return console.status_of(lambda: _show(options))
    with console.stdout_for_json() as tell:
        return console.status_of(lambda: tell(options.work(options)))


def program() -> NoReturn:
    """Run the console script `xrds`."""
    console.interrupt_at_once()
    console.leave(main())


def _show(options: argparse.Namespace) -> None:
    told = options.work(options)
    lines = options.lines(told) if told else ()
    for line in lines:
        print(line)


# --- the commands: each calls the function that does the work -------------------------


def _info(options: argparse.Namespace) -> dict[str, Any]:
    from .torch_folder import load

    return load("info").info(_blender_version(), options.weights)


def _blender_version() -> str | None:
    try:
        import bpy
    except ImportError:
        return None
    return bpy.app.version_string


def _render(options: argparse.Namespace) -> dict[str, Any]:
    if options.explain:
        return _plan(options)
    need_blender("render")
    if options.output is None:
        raise UsageError("name the output with -o, or ask for the plan with --explain")
    from .render_file import render_file

    return render_file(
        options.scene,
        options.output,
        _job(options),
        frames=options.frames,
        resolution=options.resolution,
        resume=options.resume,
    )


def _job(options: argparse.Namespace) -> Any:
    from .job import RenderJob
    from .plan import OMISSIONS

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
        keep=OMISSIONS if options.keep_all else (),
        guide_cache=options.guide_cache,
        guide_limit=options.guide_limit,
    )


def _plan(options: argparse.Namespace) -> dict[str, Any]:
    need_blender("plan")
    from .explain import explain_file

    return explain_file(options.scene, _job(options), resolution=options.resolution)


def _plan_lines(told: dict[str, Any]) -> list[str]:
    return [f"{_decision_line(each)}: {each['reason']}" for each in told["decisions"]]


def _decision_line(told: dict[str, Any]) -> str:
    saved = told["saving_seconds"]
    estimate = f" (saves about {saved:.1f} s)" if saved else ""
    return f"{told['decision']}: {told['value']}{estimate}"


def _render_lines(told: dict[str, Any]) -> list[str]:
    if "decisions" in told:
        return _plan_lines(told)
    lines = [f"frame {number}: was there" for number in told["kept"]]
    lines += [
        f"{frame['output']}: {frame['seconds']['total']:.1f} s"
        for frame in told["frames"]
    ]
    return lines + [f"  {_decision_line(each)}" for each in told["plan"]]


def _upscale(options: argparse.Namespace) -> dict[str, Any]:
    from .torch_folder import load

    return load("exr_upscale").upscale_file(
        options.beauty,
        options.guide_file,
        options.output,
        scale=options.scale,
        preset=options.preset,
        guides=options.guides,
        guide_samples=options.guide_samples,
        exposure=options.exposure,
        device=options.device,
        memory_limit=options.memory_limit,
        weights=options.weights,
    )


def _upscale_lines(told: dict[str, Any]) -> list[str]:
    return [f"{told['output']}: {told['seconds']:.1f} s"]


def _evaluate(options: argparse.Namespace) -> dict[str, Any]:
    need_blender("evaluate")
    from .bench.evaluate import evaluate
    from .bench.samples import samples_table

    if options.table == "samples":
        return samples_table(
            options.scenes,
            windows=options.windows,
            references=options.references,
            cache=options.cache,
            scale=options.scale[0],
            preset=options.preset[0],
            out=options.out,
            weights=options.weights,
            progress=_progress,
        )
    return evaluate(
        options.scenes,
        windows=options.windows,
        references=options.references,
        cache=options.cache,
        scales=options.scale,
        presets=options.preset,
        guides=options.guides,
        timing=options.timing,
        timing_scenes=options.timing_scenes,
        out=options.out,
        sheets=options.sheets,
        weights=options.weights,
        progress=_progress,
    )


def _bench(options: argparse.Namespace) -> dict[str, Any]:
    need_blender("bench")
    from .bench.bench import bench

    return bench(
        options.scenes,
        options.out,
        budgets=options.budgets,
        resolution=options.resolution,
        reference_samples=options.reference_samples,
        windows=options.windows,
        references=options.references,
        cache=options.cache,
        presets=options.preset,
        rounds=options.rounds,
        timing=not options.errors_only,
        picker=not options.errors_only,
        growth=options.growth,
        model=options.model,
        weights=options.weights,
        device=options.device,
    )


def _bench_lines(told: dict[str, Any]) -> list[str]:
    failed = [f"left out: {name}: {why}" for name, why in told["failures"].items()]
    return [f"{len(told['points'])} points", *failed]


def _progress(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _stability(options: argparse.Namespace) -> dict[str, Any]:
    if {"scenes", "shots", "load"} & set(options.parts):
        need_blender("stability")
    from .bench.stability.suite import stability

    told = stability(
        options.out,
        parts=options.parts,
        cache=options.cache,
        device=options.device,
        weights=options.weights,
        progress=_progress,
    )
    if not told["passed"]:
        raise XRDSError(f"some bounds are not held: see {options.out / 'report.md'}")
    return told


def _plan_report(options: argparse.Namespace) -> dict[str, Any]:
    need_blender("plan-report")
    from .bench.plan_report import Setting, report

    setting = Setting(
        options.scale,
        options.samples,
        options.guide_samples,
        *options.resolution,
        options.rounds,
    )
    return report(options.scenes, options.kind, setting, options.out, _progress)


# --- the options ----------------------------------------------------------------------


class _Parser(argparse.ArgumentParser):
    """Tells wrong usage in one line, as every other error is told."""

    def error(self, message: str) -> NoReturn:
        line = f"xrds: {message}; see {self.prog} --help\n"
        self.exit(console.WRONG_USAGE, line)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser("xrds", description="Guided super-resolution of Cycles renders.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for add in (
        _add_info,
        _add_render,
        _add_plan,
        _add_upscale,
        _add_evaluate,
        _add_stability,
        _add_plan_report,
        _add_bench,
        cli_training.add_dataset,
        cli_training.add_train,
        cli_training.add_ablate,
        cli_training.add_train_filter,
    ):
        command = add(commands)
        command.add_argument(
            "--json", action="store_true", help="print JSON on stdout, all else beside"
        )
    return parser


def _add_info(commands: Any) -> argparse.ArgumentParser:
    command = commands.add_parser("info", help="versions, devices, weights, costs")
    command.add_argument("--weights", type=Path, help="folder of weights files")
    command.set_defaults(work=_info, lines=lines_of("xrds_core.info"))
    return command


def _add_render(commands: Any) -> argparse.ArgumentParser:
    command = commands.add_parser("render", help="render a .blend file")
    add = command.add_argument
    _add_job(command)
    add("-o", "--output", help=".exr or .png; # for frame numbers")
    add("--explain", action="store_true", help="tell the plan and render nothing")
    add("--resume", action="store_true", help="only frames that are not there, whole")
    which = command.add_mutually_exclusive_group()
    which.add_argument("--frame", type=arguments.frame, dest="frames", metavar="F")
    which.add_argument(
        "--frames", type=arguments.frames, help="first-last", metavar="A-B"
    )
    command.set_defaults(work=_render, lines=_render_lines)
    return command


def _add_plan(commands: Any) -> argparse.ArgumentParser:
    command = commands.add_parser("plan", help="what a render would do and leave out")
    _add_job(command)
    command.set_defaults(work=_plan, lines=_plan_lines)
    return command


def _add_job(command: argparse.ArgumentParser) -> None:
    """What `RenderJob` holds."""
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
    _add_network(command)


def _add_upscale(commands: Any) -> argparse.ArgumentParser:
    command = commands.add_parser("upscale", help="enlarge a render from EXR files")
    add = command.add_argument
    add("beauty", type=Path, metavar="BEAUTY.exr", help="low-resolution picture")
    add("guide_file", type=Path, metavar="GUIDES.exr", help="full-resolution passes")
    add("-o", "--output", type=Path, required=True, metavar="OUT.exr")
    add("--scale", type=int, choices=(1, 2, 4, 8), default=2)
    add(
        "--guide-samples",
        type=arguments.positive,
        metavar="N",
        help="per pixel of GUIDES.exr: the noise of few is filtered; many by default",
    )
    _add_network(command)
    command.set_defaults(work=_upscale, lines=_upscale_lines)
    return command


def _add_network(command: argparse.ArgumentParser) -> None:
    add = command.add_argument
    add("--guides", choices=GUIDES, default="fast")
    add("--preset", choices=PRESETS, default="fast")
    add(
        "--exposure", type=arguments.factor, help="hold it for an animation or a border"
    )
    add("--device", default="auto", help="auto, cpu, cuda, cuda:1, mps")
    add(
        "--memory-limit",
        type=arguments.size_in_bytes,
        help="of the network, as 500M or 4G",
    )
    add("--weights", type=Path, help="weights file, or folder of such")


def _add_evaluate(commands: Any) -> argparse.ArgumentParser:
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
    add(
        "--guides", type=arguments.names(GUIDES), default=("fast",), help="as fast,full"
    )
    add("--table", choices=("standard", "samples"), default="standard")
    add("--timing", action="store_true", help="also time whole frames")
    add("--timing-scenes", type=arguments.words, help="of these alone, as bmw27,house")
    add("--weights", type=Path, help="folder of weights files")
    add("--out", type=Path, help="folder for results.json")
    add("--sheets", type=Path, help="folder for a JPEG of crops for each scene")
    command.set_defaults(work=_evaluate, lines=lambda _: ())
    return command


def _add_stability(commands: Any) -> argparse.ArgumentParser:
    command = commands.add_parser("stability", help="measure stiff and extreme cases")
    add = command.add_argument
    add("--out", type=Path, required=True, help="folder for results.json and report")
    add(
        "--parts",
        type=arguments.names(STABILITY),
        default=STABILITY,
        help="as arrays,large",
    )
    add("--cache", type=Path, help="folder that keeps rendered pictures")
    add("--device", default="auto", help="auto, cpu, cuda, cuda:1, mps")
    add("--weights", type=Path, help="folder of weights files")
    command.set_defaults(work=_stability, lines=lambda _: ())
    return command


def _add_plan_report(commands: Any) -> argparse.ArgumentParser:
    command = commands.add_parser("plan-report", help="measure what the plan saves")
    add = command.add_argument
    add("scenes", nargs="+", help="SCENE.blend, or a scene of studio/traps.py")
    kinds = ("still", "animation", "look-dev")
    add(
        "--kind",
        type=arguments.names(kinds),
        default=("still",),
        help="as still,look-dev",
    )
    add("--scale", type=int, choices=(2, 4, 8), default=2)
    add("--samples", type=arguments.positive, default=16)
    add("--guide-samples", type=arguments.positive, default=4)
    add("--resolution", type=arguments.size, metavar="WxH", default=(960, 540))
    add("--rounds", type=arguments.positive, default=1, help="pairs of runs")
    add("--out", type=Path, required=True, help="path of the .json and .md")
    command.set_defaults(work=_plan_report, lines=lambda _: ())
    return command


def _add_bench(commands: Any) -> argparse.ArgumentParser:
    command = commands.add_parser("bench", help="error against run time, a report")
    add = command.add_argument
    add("scenes", type=Path, nargs="+", metavar="SCENE.blend")
    add("--out", type=Path, required=True, help="folder; an unfinished run resumes")
    add(
        "--budgets",
        type=arguments.factors,
        default=(0.5, 1.0, 2.0, 4.0, 8.0),
        help="multiples of each scene's 1 spp + OIDN, as 0.5,1,2",
    )
    add(
        "--resolution",
        type=arguments.size,
        metavar="WxH",
        help="in place of the files' own",
    )
    add(
        "--reference-samples", type=arguments.positive, default=128, help="of each half"
    )
    add("--windows", type=Path, help="JSON file of windows that errors are taken on")
    add("--references", type=Path, help="folder of NAME.exr, for the windows")
    add("--cache", type=Path, help="folder of rendered inputs; OUT/cache")
    add(
        "--preset",
        type=arguments.names(PRESETS),
        help="as fast,balanced; all with weights",
    )
    add("--rounds", type=arguments.positive, default=3, help="runs of each timed stage")
    add("--errors-only", action="store_true", help="time nothing")
    add(
        "--growth",
        type=arguments.sizes,
        default=(),
        help="frames, as 512x512,1920x1080",
    )
    add("--model", type=Path, help="where to write what --time-budget goes by")
    add("--device", default="auto", help="auto, cpu, cuda, cuda:1, mps")
    add("--weights", type=Path, help="folder of weights files")
    command.set_defaults(work=_bench, lines=_bench_lines)
    return command


if __name__ == "__main__":
    program()
