"""`xrds render` and `xrds plan`: a .blend file's frames, or what they would take."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from xrds_core.errors import UsageError
from xrds_core.progress import duration

from ..planning.plan import DEADLINE, GUIDE_CACHE, SAME_PICTURE
from ..planning.settings import counted
from . import arguments
from .console import need_blender
from .options import (
    add_output,
    add_request,
    choice_of,
    encoding_of,
    request_of,
    resolve_paths,
)


def add_render(commands: Any) -> argparse.ArgumentParser:
    """Add `xrds render`."""
    command = commands.add_parser("render", help="render frames of a .blend file")
    add = command.add_argument
    add_request(command)
    add_output(command, help="an .exr or .png file; #### stands for the frame number")
    add("--explain", action="store_true", help="print the plan without rendering")
    add("--resume", action="store_true", help="skip frames whose files are complete")
    add(
        "--sample-cache",
        type=Path,
        metavar="DIR",
        help="folder for frames' samples, which are not rendered again then; without "
        "-o for xrds denoise to finish",
    )
    _add_frames(command)
    command.set_defaults(work=_render, lines=_lines)
    return command


def add_plan(commands: Any) -> argparse.ArgumentParser:
    """Add `xrds plan`."""
    command = commands.add_parser("plan", help="show what a render would do and skip")
    add_request(command)
    _add_frames(command)
    command.set_defaults(work=_plan, lines=_plan_lines)
    return command


def _add_frames(command: argparse.ArgumentParser) -> None:
    """Add which frames: several are a shot."""
    which = command.add_mutually_exclusive_group()
    which.add_argument(
        "--frame",
        type=arguments.frame,
        dest="frames",
        metavar="N",
        help="one frame (default: the file's current one)",
    )
    which.add_argument(
        "--frames",
        type=arguments.frames,
        help="such as 1-24, 1-100x4 (every fourth) or 1-24,30",
        metavar="A-B",
    )
    command.add_argument(
        "-a", "--animation", action="store_true", help="the frame range of the file"
    )


def _render(options: argparse.Namespace) -> dict[str, Any]:
    if options.explain:
        return _plan(options)
    need_blender("render")
    if options.out is None and options.sample_cache is None:
        raise UsageError("name the output with -o, or ask for the plan with --explain")
    from .render_file import render_file

    resolve_paths(options)
    return render_file(
        options.scene,
        options.out,
        request_of(options),
        frames=options.frames,
        animation=options.animation,
        choice=choice_of(options),
        encoding=encoding_of(options),
        resume=options.resume,
        sample_cache=options.sample_cache,
    )


def _plan(options: argparse.Namespace) -> dict[str, Any]:
    need_blender("plan")
    from ..rendering.explain import explain
    from .scene_file import frames_of, open_scene

    resolve_paths(options)
    request, frames = request_of(options), options.frames
    scene = open_scene(options.scene, choice_of(options))
    return explain(scene, request, frames_of(scene, frames, options.animation))


def _plan_lines(result: dict[str, Any]) -> list[str]:
    lines = [
        f"{_decision_line(decision)}: {decision['reason']}"
        for decision in result["decisions"]
    ]
    notes = [f"note: {x}" for x in result["remarks"]]
    return [_expected_line(result), *result["summary"], *lines, *notes]


def _expected_line(plan: dict[str, Any]) -> str:
    """Frames, memory and seconds in a line."""
    memory, seconds = plan["memory"], plan["seconds"]
    window = f", {memory / 1e6:.0f} MB for neighbours beside Cycles" if memory else ""
    time = "seconds are known after a first render, or give --time-budget or --deadline"
    if seconds is not None:
        time = f"about {duration(seconds)} each"
    return f"{counted(plan['frames'], 'frame')}{window}; {time}"


def _decision_line(decision: dict[str, Any]) -> str:
    saving = decision["saving_seconds"]
    estimate = f" (saves about {saving:.1f} s)" if saving else ""
    return f"{decision['decision']}: {decision['value']}{estimate}"


def _lines(result: dict[str, Any]) -> list[str]:
    if "decisions" in result:
        return _plan_lines(result)
    lines = [f"frame {number}: skipped, complete" for number in result["kept"]]
    if samples := result["samples"]:
        lines.append(
            f"{samples['folder']}: samples of {len(samples['rendered'])} frames "
            f"rendered, {len(samples['read'])} were there"
        )
    lines += [
        f"{frame['output']}: {frame['seconds']['total']:.1f} s"
        for frame in result["frames"]
    ]
    return lines + [f"  {_outcome_line(decision)}" for decision in result["plan"]]


def _outcome_line(decision: dict[str, Any]) -> str:
    """A decision after a render: with its reason where this says what was found."""
    line = _decision_line(decision)
    explains = decision["decision"] in (GUIDE_CACHE, SAME_PICTURE, DEADLINE)
    return f"{line}: {decision['reason']}" if explains else line
