"""`make demo`: a still life as a shot and as a still, by every way in the same seconds.

Writes comparison.png, ways.png, shot.webp, results.json, the pictures and the scene.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import bpy

from xrds_blender.command import arguments, console
from xrds_blender.interface.registration import ensure_registered

from . import results
from .contest import CYCLES, ENLARGED, FULL_SIZE, QUICK, Contest
from .countdown import Countdown
from .results import Outcome
from .scene import build, orbit

SECONDS = 450.0  # of the whole demo; the reference takes what the rest leaves
SAMPLES = 3  # of XRDS's shot: all others get its seconds


def main(argv: Sequence[str] | None = None) -> int:
    """Run the demo and return its exit status."""
    options = _parser().parse_args(argv)
    return console.status_of(lambda: _demo(options), lambda lines: lines)


def _demo(options: argparse.Namespace) -> list[str]:
    """Render, compare and write; returns what is printed."""
    out = options.out
    out.mkdir(parents=True, exist_ok=True)
    log = out / "blender.log"
    with Countdown(options.seconds) as countdown, console.stdout_to(log):
        ensure_registered()
        scene = build(*options.resolution)
        orbit(scene)
        scene.cycles.samples = options.samples
        file = str((out / "still_life.blend").resolve())
        bpy.ops.wm.save_as_mainfile(filepath=file, copy=True)
        outcome = _measured(Contest(scene, countdown), options.samples)
        countdown.say("writing")
        rows = results.write(out, scene, outcome)
    look = ", ".join(str(out / name) for name in results.PICTURES)
    return [*map(results.line, rows), f"look at {look}"]


def _measured(contest: Contest, samples: int) -> Outcome:
    """All ways in the seconds that XRDS takes for a shot of so many samples."""
    contest.warm_up((CYCLES, FULL_SIZE, ENLARGED))
    shot = contest.shot(samples)
    seconds = shot.seconds
    return Outcome(
        rival=contest.plain_shot(seconds),
        quick=contest.pair(QUICK, seconds),
        shot=shot,
        stills=tuple(contest.still(way, seconds) for way in (ENLARGED, FULL_SIZE)),
        reference=contest.references(),
    )


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="make demo", description="A still life by every way, in the same seconds."
    )
    add = parser.add_argument
    add("-o", "--out", type=Path, default=Path("demo"), help="folder; demo")
    add(
        "--seconds",
        type=arguments.factor,
        default=SECONDS,
        help=f"of the whole demo, about; {SECONDS:g}",
    )
    add(
        "--samples",
        type=arguments.positive,
        default=SAMPLES,
        help=f"per pixel of XRDS's shot; {SAMPLES}",
    )
    add(
        "--resolution",
        type=arguments.size,
        default=(720, 405),
        metavar="WxH",
        help="720x405",
    )
    return parser


if __name__ == "__main__":
    console.prepare()
    console.leave(main())
