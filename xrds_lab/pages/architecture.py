"""Draws docs/images/architecture.svg from the imports: who imports whom."""

from __future__ import annotations

import ast
import html
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from xrds_core.files import replacing

from .walks import ROOT, SHIPPED

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
    found: dict[str, set[str]] = {part_of(module): set() for module in _sources()}
    for module, path in _sources().items():
        for target in _imported(module, path):
            own, other = part_of(module), part_of(target)
            if own != other:
                found[own].add(other)
    for top in SHIPPED:  # errors, files and arrays, which everything imports
        found.pop(top, None)
    return {part: lower & found.keys() for part, lower in found.items()}


def part_of(module: str) -> str:
    """The folder that a module lies in, or itself where it is a part."""
    if module in _PARTS:
        return module
    folders = module.split(".")
    if _sources()[module].stem != "__init__":
        folders.pop()
    return ".".join(folders[:2])


@cache
def _sources() -> dict[str, Path]:
    found = {}
    for path in sorted(p for name in SHIPPED for p in (ROOT / name).rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        name = parts[:-1] if parts[-1] == "__init__" else parts
        if "shipped" not in parts:
            found[".".join(name)] = path
    return found


def _imported(module: str, path: Path) -> set[str]:
    """The modules that a module imports, wherever in it."""
    package = module.split(".")
    if path.stem != "__init__":
        package.pop()
    found = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if not isinstance(node, ast.ImportFrom):
            continue
        above = package[: len(package) - node.level + 1] if node.level else []
        base = ".".join([*above, *([node.module] if node.module else [])])
        for alias in node.names:
            full = f"{base}.{alias.name}"
            found |= {full if full in _sources() else base} & _sources().keys()
    return found


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
    path = _sources()[name]
    lines = sum(
        len(p.read_text("utf-8").splitlines())
        for module, p in _sources().items()
        if part_of(module) == name
    )
    told = (ast.get_docstring(ast.parse(path.read_text("utf-8"))) or "").partition("\n")
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
