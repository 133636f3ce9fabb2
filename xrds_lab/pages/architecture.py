"""Draws docs/images/architecture.svg from the imports: who imports whom."""

from __future__ import annotations

import ast
import html
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from xrds_core.files import replacing

from .walks import SHIPPED, modules

# Files at the top of xrds_core that are a part of their own.
_PARTS = ("xrds_core.finish", "xrds_core.shot")
_WIDTH, _HEIGHT, _ACROSS, _DOWN = 236, 86, 22, 40  # of a box, and between boxes
_LETTERS = 40  # of a line in a box
_STYLE = (
    "text{font-family:sans-serif;fill:#222}.n{font-size:13px;font-weight:bold}"
    ".d{font-size:10px}.b{fill:#eef3f8;stroke:#2266aa}.c{fill:#fdf3ea;stroke:#cc5500}"
    "path{stroke:#888;fill:none;marker-end:url(#e)}"
)


def draw(path: Path) -> None:
    """Write the picture; the same source gives the same file."""
    with replacing(path) as part:
        part.write_text(svg(), "utf-8")


def svg() -> str:
    """The folders in rows, each above all that it imports."""
    edges = _reduced(imports())
    rows = _rows(edges)
    widest = max(map(len, rows))
    width = widest * (_WIDTH + _ACROSS) + _ACROSS
    height = len(rows) * (_HEIGHT + _DOWN) + _DOWN
    places: dict[str, tuple[float, float]] = {}
    for down, row in enumerate(rows):
        left = (width - len(row) * (_WIDTH + _ACROSS) + _ACROSS) / 2
        for across, name in enumerate(row):
            y = down * (_HEIGHT + _DOWN) + _DOWN / 2
            places[name] = left + across * (_WIDTH + _ACROSS), y
    arrows = "".join(
        _arrow(places[one], places[two])
        for one, lower in sorted(edges.items())
        for two in sorted(lower)
    )
    boxes = "".join(_box(name, *place) for name, place in places.items())
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}">'
        f"<style>{_STYLE}</style>"
        '<defs><marker id="e" orient="auto" markerWidth="8" markerHeight="8" refX="7" '
        'refY="3"><path d="M0 0 7 3 0 6" style="marker-end:none"/></marker></defs>'
        f"{arrows}{boxes}</svg>\n"
    )


def imports() -> dict[str, set[str]]:
    """The parts that each part imports."""
    parts = {part_of(module) for module in modules()}
    found: dict[str, set[str]] = {part: set() for part in parts - set(SHIPPED)}
    for module in modules().values():
        for full in module.imported:
            target = full if full in modules() else full.rpartition(".")[0]
            own, other = part_of(module.name), part_of(target)
            # not errors, files and arrays, which everything imports
            if own != other and {own, other} <= found.keys():
                found[own].add(other)
    return found


def part_of(module: str) -> str:
    """The folder that a module lies in, or itself where it is a part."""
    if module in _PARTS or module not in modules():
        return module
    folders = module.split(".")
    if modules()[module].path.stem != "__init__":
        folders.pop()
    return ".".join(folders[:2])


def _reduced(edges: Mapping[str, set[str]]) -> dict[str, set[str]]:
    """Without arrows that a longer way says as well."""

    @cache
    def below(part: str) -> frozenset[str]:
        lower = edges[part]
        return frozenset(lower).union(*(below(x) for x in lower))

    return {
        part: {x for x in lower if not any(x in below(y) for y in lower - {x})}
        for part, lower in edges.items()
    }


def _rows(edges: Mapping[str, set[str]]) -> list[list[str]]:
    """Each part as low as can be, below all that import it."""

    @cache
    def depth(part: str) -> int:
        above = [one for one, lower in edges.items() if part in lower]
        return 1 + max((depth(one) for one in above), default=-1)

    rows: list[list[str]] = [[] for _ in range(1 + max(map(depth, edges)))]
    for part in sorted(edges):
        rows[depth(part)].append(part)
    return rows


def _arrow(start: tuple[float, float], end: tuple[float, float]) -> str:
    x, y = start[0] + _WIDTH / 2, start[1] + _HEIGHT
    to_x, to_y = end[0] + _WIDTH / 2, end[1]
    middle = (y + to_y) / 2
    return f'<path d="M{x} {y}C{x} {middle} {to_x} {middle} {to_x} {to_y - 2}"/>'


def _box(name: str, x: float, y: float) -> str:
    lines = sum(
        len(module.path.read_text("utf-8").splitlines())
        for module in modules().values()
        if part_of(module.name) == name and "shipped" not in module.path.parts
    )
    source = ast.parse(modules()[name].path.read_text("utf-8"))
    told = (ast.get_docstring(source) or "").partition("\n")
    kind = "b" if name.startswith("xrds_blender") else "c"
    words = "".join(
        f'<tspan x="{x + 10}" dy="13">{html.escape(line)}</tspan>'
        for line in _wrapped(told[0])
    )
    return (
        f'<rect class="{kind}" x="{x}" y="{y}" width="{_WIDTH}" height="{_HEIGHT}" '
        f'rx="5"/><text class="n" x="{x + 10}" y="{y + 19}">'
        f"{name.replace('.', ' / ')}</text>"
        f'<text class="d" x="{x + 10}" y="{y + 22}">{words}'
        f'<tspan x="{x + 10}" dy="13">{lines:,} lines</tspan></text>'
    )


def _wrapped(sentence: str) -> list[str]:
    lines = [""]
    for word in sentence.split():
        if len(lines[-1]) + len(word) >= _LETTERS:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return lines[:3]
