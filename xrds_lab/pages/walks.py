"""How many files one value passes through: the walks of the source, counted.

A walk follows a parameter of a function, and what is taken out of it, through every
call that it is given to, in the order of the source; each function is entered once for
each parameter. The class of an object is the one that its annotation, or the call that
made it, says, and all that derive from it; where nothing says it, all classes of the
project that have a method of that name are entered. Counted are the files that are
entered, and how often a call leads back into a file that the walk has left. Nothing is
run: imports, definitions and calls are read.

    python -m xrds_lab.pages.walks
    python -m xrds_lab.pages.walks xrds_blender/rendering/shot.py render_shot scene
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SHIPPED = ("xrds_core", "xrds_blender")
WALKS = {
    "a dependency graph through F12": (
        "xrds_blender.interface.engine",
        "XRDSRender.render",
        "depsgraph",
    ),
    "a command's options": ("xrds_blender.command.render", "_render", "options"),
    "a frame's passes to the picture": (
        "xrds_blender.rendering.render",
        "_finish",
        "own",
    ),
}
# Methods of Python's own types, which say nothing about ours.
_COMMON = {
    *("add", "append", "clear", "copy", "get", "items", "keys", "pop", "put", "read"),
    *("update", "values", "write", "close", "mean", "sum", "index", "join", "set"),
}

Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass
class _Module:
    """A module: its functions by qualified name, its classes with what they derive from
    and the classes of their fields, what its names mean, and all that it imports.
    """

    name: str
    path: Path
    functions: dict[str, Function] = field(default_factory=dict)
    classes: dict[str, list[str]] = field(default_factory=dict)
    fields: dict[str, dict[str, ast.expr]] = field(default_factory=dict)
    names: dict[str, str] = field(default_factory=dict)
    imported: set[str] = field(default_factory=set)


@dataclass
class Walk:
    """The files of a walk, in the order in which they are entered, with repetitions."""

    stays: list[str] = field(default_factory=list)

    def enter(self, module: str) -> None:
        """Note that the walk is in a module now."""
        if not self.stays or self.stays[-1] != module:
            self.stays.append(module)

    @property
    def rooms(self) -> int:
        """How many files it enters."""
        return len(set(self.stays))

    @property
    def returns(self) -> int:
        """How often it comes back to a file that it has left."""
        return len(self.stays) - self.rooms


@cache
def modules() -> dict[str, _Module]:
    """All shipped modules."""
    paths = sorted(p for package in SHIPPED for p in (ROOT / package).rglob("*.py"))
    return {module.name: module for module in map(_read, paths)}


def _read(path: Path) -> _Module:
    parts = path.relative_to(ROOT).with_suffix("").parts
    package = parts[:-1]
    module = _Module(".".join(package if parts[-1] == "__init__" else parts), path)
    tree = ast.parse(path.read_text("utf-8"))
    for node in tree.body:
        if isinstance(node, Function):
            module.functions[node.name] = node
        elif isinstance(node, ast.ClassDef):
            module.classes[node.name] = [
                name for base in node.bases for name in _names_in(base)
            ]
            module.fields[node.name] = _fields(node)
            for item in node.body:
                if isinstance(item, Function):
                    module.functions[f"{node.name}.{item.name}"] = item
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                above = package[: len(package) - node.level + 1]
                base = ".".join([*above, *([node.module] if node.module else [])])
            for alias in node.names:
                full = f"{base}.{alias.name}"
                module.names[alias.asname or alias.name] = full
                module.imported.add(full)
    return module


def _fields(node: ast.ClassDef) -> dict[str, ast.expr]:
    """What says the classes of fields: annotations, and calls that make them."""
    fields: dict[str, ast.expr] = {}
    for item in ast.walk(node):
        if isinstance(item, ast.AnnAssign):
            fields[_field_name(item.target)] = item.annotation
        elif isinstance(item, ast.Assign) and isinstance(item.value, ast.Call):
            for target in item.targets:
                fields.setdefault(_field_name(target), item.value.func)
    return fields


def _field_name(target: ast.expr) -> str:
    """The name of a field, or of self.NAME; empty for another target."""
    if isinstance(target, ast.Name):
        return target.id
    return target.attr if isinstance(target, ast.Attribute) else ""


def _names_in(node: ast.AST) -> list[str]:
    """The names in an annotation, also in one that is a string."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        node = ast.parse(node.value, mode="eval")
    return [x.id for x in ast.walk(node) if isinstance(x, ast.Name)]


def walk(module: str, function: str, parameter: str) -> Walk:
    """Follow a parameter of a function of a module."""
    found = Walk()
    _follow(found, set(), module, function, parameter)
    return found


def _follow(
    found: Walk, seen: set[tuple[str, str, str]], place: str, name: str, value: str
) -> None:
    if (place, name, value) in seen:
        return
    seen.add((place, name, value))
    module = modules()[place]
    function = module.functions[name]
    found.enter(place)
    parts = _parts(function, value)
    for call in _calls(function):
        for target, owner in _targets(module, name, call):
            for given in _given(modules()[target].functions[owner], call, parts):
                _follow(found, seen, target, owner, given)


def _calls(function: Function) -> Iterator[ast.Call]:
    """The calls in a function, in the order of the source."""
    calls = [node for node in ast.walk(function) if isinstance(node, ast.Call)]
    yield from sorted(calls, key=lambda call: (call.lineno, call.col_offset))


def _parts(function: Function, value: str) -> set[str]:
    """The names that hold a value, or what is taken out of it, in a function."""
    held = {value}
    for node in ast.walk(function):
        pairs: list[tuple[ast.expr, ast.expr]] = []
        if isinstance(node, ast.Assign):
            pairs = [(target, node.value) for target in node.targets]
        elif isinstance(node, ast.AnnAssign) and node.value is not None:
            pairs = [(node.target, node.value)]
        elif isinstance(node, ast.For | ast.comprehension):
            pairs = [(node.target, node.iter)]
        elif isinstance(node, ast.NamedExpr):
            pairs = [(node.target, node.value)]
        for target, source in pairs:
            if _is_part(source, held):
                held |= {x.id for x in ast.walk(target) if isinstance(x, ast.Name)}
    return held


def _is_part(node: ast.expr, held: set[str]) -> bool:
    """Whether an expression is a held value, or is taken out of one."""
    if isinstance(node, ast.Name):
        return node.id in held
    if isinstance(node, ast.Attribute | ast.Subscript | ast.Starred):
        return _is_part(node.value, held)
    if isinstance(node, ast.Tuple | ast.List):
        return any(_is_part(item, held) for item in node.elts)
    return False


def _targets(module: _Module, within: str, call: ast.Call) -> list[tuple[str, str]]:
    """The functions that a call may enter: (module, qualified name)."""
    called = call.func
    if isinstance(called, ast.Name):
        return _named(module, called.id)
    if not isinstance(called, ast.Attribute):
        return []
    owner = called.value.id if isinstance(called.value, ast.Name) else ""
    if owner in module.names:
        return _imported(f"{module.names[owner]}.{called.attr}")
    own = f"{within.partition('.')[0]}.{called.attr}"
    if owner in {"self", "cls"} and own in module.functions:
        return [(module.name, own)]
    if called.attr in _COMMON or called.attr.startswith("__"):
        return []
    return _methods(called.attr, _classes_told(module, within, called.value))


def _methods(name: str, owners: list[str] | None) -> list[tuple[str, str]]:
    """The methods of a name: of some classes and their kin, or of all classes."""
    kin = None if owners is None else {x for owner in owners for x in _kin(owner)}
    return [
        (module.name, function)
        for module in modules().values()
        for function in module.functions
        if function.endswith(f".{name}")
        and (kin is None or function.partition(".")[0] in kin)
    ]


def _classes_told(module: _Module, within: str, receiver: ast.expr) -> list[str] | None:
    """The classes that the source says an object is of; None where it does not."""
    said = _what_says(module, within, receiver)
    if said is None:
        return None
    names = [module.names.get(x, x).rpartition(".")[2] for x in _names_in(said)]
    if "Any" in names:
        return None
    known = {name for other in modules().values() for name in other.classes}
    told = [name for name in names if name in known]
    # what a function made has a class that only its own annotation would tell
    return told if told or not isinstance(said, ast.Name) else None


def _what_says(module: _Module, within: str, receiver: ast.expr) -> ast.expr | None:
    """The annotation of an object, or what is called to make it."""
    if isinstance(receiver, ast.Name):
        function = module.functions[within]
        for argument in (*function.args.args, *function.args.kwonlyargs):
            if argument.arg == receiver.id:
                return argument.annotation
        for node in ast.walk(function):
            is_made = isinstance(node, ast.Assign) and isinstance(node.value, ast.Call)
            if is_made and receiver.id in map(_field_name, node.targets):
                return node.value.func
    elif isinstance(receiver, ast.Attribute) and _names_in(receiver.value) == ["self"]:
        owner = within.partition(".")[0]
        return module.fields.get(owner, {}).get(receiver.attr)
    return None


@cache
def _kin(name: str) -> frozenset[str]:
    """A class, those that it derives from, and those that derive from it."""
    bases = {k: v for other in modules().values() for k, v in other.classes.items()}
    above, below = {name}, {name}
    for _ in bases:
        above |= {base for kind in above for base in bases.get(kind, [])}
        below |= {kind for kind, over in bases.items() if below & {*over}}
    return frozenset(above | below)


def _named(module: _Module, name: str) -> list[tuple[str, str]]:
    """A function or class of a module, or one that it imports."""
    if name in module.functions:
        return [(module.name, name)]
    if name in module.classes:
        return _made(module.name, name)
    return _imported(module.names.get(name, ""))


def _imported(full: str) -> list[tuple[str, str]]:
    """A function, class or method by its full name, wherever it is imported from."""
    place, _, name = full.rpartition(".")
    if place in modules():
        return _named(modules()[place], name)
    above, _, owner = place.rpartition(".")
    method = f"{owner}.{name}"
    known = above in modules() and method in modules()[above].functions
    return [(above, method)] if known else []


def _made(place: str, name: str) -> list[tuple[str, str]]:
    made = f"{name}.__init__"
    return [(place, made)] if made in modules()[place].functions else []


def _given(function: Function, call: ast.Call, held: set[str]) -> Iterator[str]:
    """The parameters that a call gives held values to."""
    arguments = [*function.args.posonlyargs, *function.args.args]
    if arguments and arguments[0].arg in {"self", "cls"}:
        arguments = arguments[1:]
    for argument, given in zip(arguments, call.args, strict=False):
        if _is_part(given, held):
            yield argument.arg
    known = {x.arg for x in (*arguments, *function.args.kwonlyargs)}
    for keyword in call.keywords:
        if keyword.arg in known and _is_part(keyword.value, held):
            yield keyword.arg


def main() -> None:
    """Print the walks, or one of a function that is named."""
    sys.setrecursionlimit(10_000)
    if given := sys.argv[1:]:
        path, function, parameter = given
        place = ".".join(Path(path).with_suffix("").parts)
        found = walk(place, function, parameter)
        print(f"{found.rooms} files, {found.returns} returns")
        print(*dict.fromkeys(found.stays), sep="\n")
        return
    for name, start in WALKS.items():
        found = walk(*start)
        print(f"{name}: {found.rooms} files, {found.returns} returns")
    print(f"{len(modules())} modules")


if __name__ == "__main__":
    main()
