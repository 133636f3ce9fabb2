"""Writes tables and figures into pages, and finds figures that nobody vouches for.

A table stands below `<!-- table: NAME -->`. Sentences with figures
are listed in docs/figures.toml, as `gains {shots.pan.2.mean:+.1f} dB`: the page holds
the same words, and whatever figure stands there is replaced by the named one. Numbers
that were not measured, as sizes and settings, are listed there as well.
"""

from __future__ import annotations

import re
import tomllib
from difflib import ndiff
from string import Formatter
from typing import TYPE_CHECKING

from .figures import figures
from .results import Results
from .tables import TABLES

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

_TABLE = re.compile(r"(<!-- table: ([\w ]+) -->\n)(?:\|.*\n)*")
_FIGURE = r"([+-]?\d+(?:\.\d+)?)"
# Code, what links lead to, and comments hold no figures.
_NO_PROSE = re.compile(r"```.*?```|`[^`\n]+`|\]\([^)]*\)|<!--.*?-->", re.DOTALL)
# A number that looks measured: signed, with a decimal point, of two digits and more, or
# with a unit.
_MEASURED = re.compile(
    r"(?<![\w.])(?:[+-]\d[\d.]*|\d+\.\d+|\d{2,}|\d+(?= ?(?:dB|%|s|GB|MB|seconds)\b))"
)


class PageError(Exception):
    """A page and docs/figures.toml do not fit each other."""


class Pages:
    """The pages of a project that hold figures."""

    def __init__(self, root: Path) -> None:
        self._root = root
        listed = tomllib.loads((root / "docs/figures.toml").read_text("utf-8"))
        self._listed: Mapping[str, Mapping[str, list[str]]] = listed
        self._results = Results(root / "docs/results")
        self._figures = figures(self._results)

    def write(self) -> None:
        """Write every page anew."""
        for page in self._listed:
            (self._root / page).write_text(self._written(page), "utf-8")

    def faults(self) -> Iterator[str]:
        """Yield how the pages differ from what the results say, as lines - and +."""
        for page in self._listed:
            lines = [x.splitlines() for x in (self._text(page), self._written(page))]
            changes = [x for x in ndiff(*lines) if x[0] in "-+"]
            yield from (f"{page}: {x}" for x in changes)
            yield from (f"{page}: where is {x!r} from?" for x in self._unknown(page))

    def _text(self, page: str) -> str:
        return (self._root / page).read_text("utf-8")

    def _written(self, page: str) -> str:
        text = _TABLE.sub(self._table, self._text(page))
        for sentence in self._listed[page]["sentences"]:
            found = self._find(page, text, sentence)
            values = self._values(sentence)
            for number, value in reversed(list(enumerate(values, 1))):
                start, end = found.span(number)
                text = text[:start] + value + text[end:]
        return text

    def _table(self, marker: re.Match[str]) -> str:
        head, *rows = TABLES[marker[2]](self._results)
        lines = [head, ["---"] * len(head), *rows]
        shown = "\n".join(f"| {' | '.join(cells)} |" for cells in lines)
        return f"{marker[1]}{shown}\n".replace("|  |", "| |")

    def _find(self, page: str, text: str, sentence: str) -> re.Match[str]:
        """Find a sentence, wherever its lines break."""
        pattern = ""
        for words, name, _, _ in Formatter().parse(sentence):
            pattern += re.sub(r"(?:\\ )+", r"\\s+", re.escape(words))
            pattern += _FIGURE if name is not None else ""
        found = list(re.finditer(pattern, text))
        if len(found) != 1:
            raise PageError(f"{page} holds {sentence!r} {len(found)} times, not once")
        return found[0]

    def _values(self, sentence: str) -> list[str]:
        return [
            format(self._figures[name], spec)
            for _, name, spec, _ in Formatter().parse(sentence)
            if name is not None
        ]

    def _unknown(self, page: str) -> list[str]:
        """Return the figures of a page that are neither from results nor settings."""
        text = _TABLE.sub("", self._text(page))
        for sentence in self._listed[page]["sentences"]:
            start, end = self._find(page, text, sentence).span()
            text = text[:start] + text[end:]
        text = " ".join(_NO_PROSE.sub(" ", text).split())
        for words in self._listed[page]["settings"]:
            if words not in text:
                raise PageError(f"{page} does not hold {words!r}")
            text = text.replace(words, "")
        return _MEASURED.findall(text)
