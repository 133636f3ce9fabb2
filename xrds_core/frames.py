"""The files of a sequence: `frames/####.exr` and the numbers of its frames."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from .errors import UsageError

RADIUS = 4
"""The default temporal radius: frames before and after; more add little."""
MOST_RADIUS = 32
"""The largest that a file may recommend: all these frames are in memory."""
# Those of C, Houdini, shells, RenderMan and Maya, and Python.
_OTHER_WAYS = re.compile(
    r"%0?\d*d|\$\{?F\d*\}?|\*|\?+|<(frame|f)\d*>|\{(frame|f)\b[^}]*\}|@+",
    re.IGNORECASE,
)
_MOST_RUNS = 50  # of frame numbers that a line has room for


def frame_path(pattern: str, frame: int) -> Path:
    """Put the frame number in place of the last run of #, which is Blender's way.

    Parameters
    ----------
    pattern : str
        Path in which three # stand for three digits at least; without # it is the path.
    frame : int
        Frame number.

    Returns
    -------
    path : Path
        For a frame below zero, a file named C's way, where the sign counts as a digit,
        if only that exists.
    """
    parts = _split_pattern(pattern)
    if parts is None:
        return Path(pattern)
    before, digits, after = parts
    path, short = (
        Path(pattern).with_name(f"{before}{frame:0{width}d}{after}")
        for width in (digits + (frame < 0), digits)
    )
    return short if frame < 0 and not path.exists() and short.exists() else path


def check_pattern(pattern: str) -> None:
    """Raise UsageError for other programs' ways to write a frame number."""
    name = Path(pattern).name
    other = None if "#" in name else _OTHER_WAYS.search(name)
    if other and not Path(pattern).exists():
        raise UsageError(
            f"{pattern!r}: the frame number is written ####, not {other[0]}; give "
            f"{name[: other.start()]}####{name[other.end() :]}"
        )


def frame_numbers(pattern: str) -> list[int]:
    """Return the numbers of the frames that exist, in order.

    [] where there are none, also of a pattern without #. Such a name may belong to a
    folder: reading it reports that.
    """
    numbered = _find_numbered(pattern)
    names = {name for name, _ in numbered}
    return sorted(
        n for n in {n for _, n in numbered} if frame_path(pattern, n).name in names
    )


def misnamed(pattern: str) -> list[str]:
    """Return files of a pattern whose numbers have other digits than it asks for."""
    return sorted(
        x for x, n in _find_numbered(pattern) if frame_path(pattern, n).name != x
    )


def _find_numbered(pattern: str) -> list[tuple[str, int]]:
    """Return files with a number, of any digits, where a pattern has it."""
    parts = _split_pattern(pattern)
    folder = Path(pattern).parent
    if parts is None or not folder.is_dir():
        return []
    before, _, after = (re.escape(str(part)) for part in parts)
    name = re.compile(f"{before}(-?[0-9]+){after}")
    matches = (name.fullmatch(path.name) for path in folder.iterdir())
    return [(match[0], int(match[1])) for match in matches if match]


def find_sequences(names: Iterable[str]) -> dict[str, list[int]]:
    """Return the patterns of names of files, and the frame numbers of each, in order.

    The last digits of a name are its number. A name without any is its own pattern,
    and has no numbers.
    """
    found: dict[tuple[str, str], list[str]] = {}
    patterns: dict[str, list[int]] = {}
    for name in names:
        path = Path(name)
        match = re.fullmatch(r"(.*?)(\d+)(\D*)", path.stem)
        if match is None:
            patterns[name] = []
        else:
            ends = match[1], match[3] + path.suffix
            found.setdefault(ends, []).append(match[2])
    for (before, after), numbers in found.items():
        pattern = before + "#" * min(map(len, numbers)) + after
        patterns[pattern] = sorted(map(int, numbers))
    return patterns


def in_words(numbers: Sequence[int]) -> str:
    """Format sorted frame numbers as 1-24, 30; only the first of many runs."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and runs[-1][-1] == number - 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    text = [f"{x[0]}-{x[-1]}" if len(x) > 1 else f"{x[0]}" for x in runs[:_MOST_RUNS]]
    more = sum(map(len, runs[_MOST_RUNS:]))
    return ", ".join(text) + (f" and {more} more" if more else "")


def _split_pattern(pattern: str) -> tuple[str, int, str] | None:
    """Return what stands before the last run of #, its length, and what follows."""
    name = Path(pattern).name
    runs = list(re.finditer("#+", name))
    if not runs:
        return None
    first, last = runs[-1].span()
    return name[:first], last - first, name[last:]
