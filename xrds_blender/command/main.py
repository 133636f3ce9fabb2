"""`xrds ...` and `blender --command xrds ...`: parse, call the work, print.

Exit status: 0 done, 1 failed, 2 wrong usage, 130 interrupted. With --json, stdout
holds the JSON alone.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from importlib.metadata import entry_points
from typing import Any, NoReturn

from xrds_core import atomic

from . import console, denoise, info, render, upscale

AddCommand = Callable[[Any], argparse.ArgumentParser]

# The laboratory's commands join by entry points of this group, each a function that
# adds a parser. Their names stand here for a better error where it is not installed.
GROUP = "xrds.commands"
LABORATORY = (
    "evaluate",
    "stability",
    "plan-report",
    "bench",
    "dataset",
    "train",
    "ablate",
    "train-filter",
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status."""
    atomic.sweep()
    words = sys.argv[1:] if argv is None else list(argv)
    try:
        options = _parser(words).parse_args(words)
    except SystemExit as end:  # argparse has printed why
        return int(end.code or 0)
    if not options.json:
        return console.status_of(lambda: _run(options, _print_lines(options)))
    with console.stdout_for_json() as write:
        return console.status_of(lambda: _run(options, write))


def program() -> NoReturn:
    """Run the console script `xrds`."""
    console.end_at_once_by_signals()
    console.leave(main())


def _run(options: argparse.Namespace, show: Callable[[Any], None]) -> None:
    """Do the work and show its result; a command's `check` may then find it wanting."""
    result = options.work(options)
    show(result)
    if "check" in options:
        options.check(result)


def _print_lines(options: argparse.Namespace) -> Callable[[Any], None]:
    def show(result: Any) -> None:
        for line in options.lines(result) if result else ():
            print(line)

    return show


class _Parser(argparse.ArgumentParser):
    """Prints wrong usage in one line, like every other error."""

    def error(self, message: str) -> NoReturn:
        line = f"xrds: {message}; see {self.prog} --help\n"
        self.exit(console.WRONG_USAGE, line)


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
    apart = _Apart(commands)
    added = (
        render.add_render,
        render.add_plan,
        denoise.add_denoise,
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
    parser.epilog = apart.listing()
    asked = words[0] if words else ""
    if asked in LABORATORY and asked not in commands.choices:
        parser.error(
            f"{asked} belongs to the laboratory, which is not installed: "
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
