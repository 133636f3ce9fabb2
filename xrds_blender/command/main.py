"""`xrds ...` and `blender --command xrds ...`: parse, call the work, print.

Exit status: 0 done, 1 failed, 2 wrong usage, 130 interrupted. With --json, stdout
holds the JSON alone, of the result or of the error.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from importlib.metadata import entry_points
from typing import Any, NoReturn

from xrds_core.errors import UsageError, finished
from xrds_core.version import package_version

from . import cameras, console, denoise, info, render, try_frame, upscale
from .console import no_lines

EXAMPLES = {
    "render": (
        "xrds render shot.blend -a -o 'frames/####.exr'",
        "xrds render shot.blend --frame 7 --samples 64 -o still.png",
    ),
    "plan": ("xrds plan shot.blend -a", "xrds plan shot.blend --frame 7 --scale 2"),
    "try": (
        "xrds try shot.blend --frame 40 -o try.webp",
        "xrds try shot.blend --resolution 960x540 -o try.png",
    ),
    "denoise": (
        "xrds denoise 'noisy/####.exr' -o 'frames/####.exr'",
        "xrds denoise 'noisy/####.exr' -o 'frames/####.exr' --frames 1-48 --passes all",
    ),
    "cameras": (
        "xrds cameras shot.blend -o cameras.json",
        "xrds cameras shot.blend -o cameras.json --frames 1-48",
    ),
    "upscale": (
        "xrds upscale beauty.exr guides.exr -o large.exr",
        "xrds upscale beauty.exr guides.exr -o large.exr --scale 4 --preset balanced",
    ),
    "info": ("xrds info", "xrds info --json"),
}
_STATUS = """exit status: 0 done, 1 failed, 2 wrong usage, 130 interrupted (Ctrl-C)
--json: docs/farms.md says what it prints"""
AddCommand = Callable[[Any], argparse.ArgumentParser]

# The laboratory's commands join by entry points of this group, each a function that
# adds a parser. Their names stand here for a better error where it is not installed.
GROUP = "xrds.commands"
LABORATORY = (
    "evaluate",
    "stability",
    "bench",
    "dataset",
    "train",
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status."""
    words = sys.argv[1:] if argv is None else list(argv)
    finished.clear()  # of a command before, in one process
    try:
        options = _parser(words).parse_args(words)
    except SystemExit as end:  # --help and --version have been printed
        return int(end.code or 0)
    except UsageError as error:
        as_json = "--json" in words
        options = argparse.Namespace(json=as_json, work=_refusal(error), lines=no_lines)
    check = getattr(options, "check", None)
    if options.json:
        return console.status_with_json(lambda: options.work(options), check)
    return console.status_of(lambda: options.work(options), options.lines, check)


def program() -> NoReturn:
    """Run the console script `xrds`."""
    console.prepare()
    console.leave(main())


def _refusal(error: UsageError) -> Callable[[argparse.Namespace], NoReturn]:
    def work(_: argparse.Namespace) -> NoReturn:
        raise error

    return work


class _Parser(argparse.ArgumentParser):
    """Raises wrong usage, so that it is reported like every other error.

    No option begins with a digit: -3--1 and -1,1 are values, as -1 is.
    """

    def __init__(self, *args: Any, **more: Any) -> None:
        super().__init__(*args, **more)
        self._negative_number_matcher = re.compile(r"-[\d.]")

    def error(self, message: str) -> NoReturn:
        raise UsageError(f"{message}; see {self.prog} --help")


class _Apart:
    """Adds commands that the help lists below the others: those that measure XRDS."""

    def __init__(self, commands: Any) -> None:
        self._commands = commands
        self._lines: list[str] = []

    def add_parser(self, name: str, *, help: str, **more: Any) -> Any:  # noqa: A002  # argparse's
        """As argparse does, without a line in its own list."""
        self._lines.append(f"  {name:<14}{help}")
        return self._commands.add_parser(name, **more)

    def listing(self) -> str | None:
        """The list, None where there are no such commands."""
        heading = "laboratory, for those who develop XRDS:"
        return "\n".join([heading, *self._lines]) if self._lines else None


def _parser(words: Sequence[str]) -> argparse.ArgumentParser:
    parser = _Parser(
        "xrds",
        description="Final frames of Cycles scenes: denoised at full size,\n"
        "accumulated in shots, or enlarged by a network.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(
        dest="command", required=True, metavar="COMMAND", title="commands"
    )
    parser.add_argument(
        "--version", action="version", version=f"XRDS {package_version()}"
    )
    apart = _Apart(commands)
    added = (
        render.add_render,
        render.add_plan,
        try_frame.add_try,
        denoise.add_denoise,
        cameras.add_cameras,
        upscale.add_upscale,
        info.add_info,
    )
    for command in (
        *(add(commands) for add in added),
        *(add(apart) for add in _laboratory()),
    ):
        command.add_argument(
            "--json",
            action="store_true",
            help="print JSON on stdout and everything else on stderr",
        )
        name = command.prog.rpartition(" ")[2]
        examples = "".join(f"  {line}\n" for line in EXAMPLES.get(name, ()))
        command.formatter_class = argparse.RawDescriptionHelpFormatter
        command.epilog = (f"examples:\n{examples}\n" if examples else "") + _STATUS
    parser.epilog = apart.listing()
    name = words[0] if words else ""
    if name in LABORATORY and name not in commands.choices:
        raise UsageError(
            f"{name} belongs to the laboratory, which is not installed: "
            "run pip install ./xrds_lab in a source tree of XRDS"
        )
    return parser


def _laboratory() -> Iterator[AddCommand]:
    """The laboratory's commands that are installed, in the order of their names."""
    installed = {entry.name: entry for entry in entry_points(group=GROUP)}
    for name in LABORATORY:
        if name in installed:
            yield installed[name].load()


if __name__ == "__main__":
    program()
