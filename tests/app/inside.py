"""Runs inside the Blender under test: answers questions that come as files.

    blender --python inside.py -- FOLDER

A question is a file `N.ask` of Python; its answer `N.json` is the value of its last
expression. They are asked from Blender's own timer, so that also a running render, an
open menu or a dialogue can be asked about.
"""

from __future__ import annotations

import ast
import json
import sys
import time
import traceback
from pathlib import Path
from typing import Any

import bpy

FOLDER = Path(sys.argv[sys.argv.index("--") + 1])
EVENTS: list[tuple[str, float]] = []
"""What Blender's render handlers told, and when."""


def serve() -> float:
    """Answer all that is waiting."""
    for path in sorted(FOLDER.glob("*.ask")):
        text = path.read_text()
        path.unlink()
        answer = FOLDER / f"{path.stem}.json"
        written = answer.with_suffix(".part")
        written.write_text(json.dumps(answer_to(text), default=str))
        written.rename(answer)
    return 0.1


def answer_to(text: str) -> dict[str, Any]:
    """Run statements and give the value of the last one, if it is an expression."""
    names = {"bpy": bpy, "EVENTS": EVENTS, "window": first_window()}
    tree = ast.parse(text)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    try:
        with bpy.context.temp_override(window=first_window()):
            exec(compile(tree, "question", "exec"), names)  # noqa: S102  # our own test asks
            value = None
            if last is not None:
                code = compile(ast.Expression(last.value), "question", "eval")
                value = eval(code, names)  # noqa: S307
    except Exception:
        return {"error": traceback.format_exc()}
    return {"value": value}


def first_window() -> Any:
    return bpy.context.window_manager.windows[0]


def listen(name: str) -> None:
    def tell(*_: Any) -> None:
        EVENTS.append((name, time.time()))

    handlers = getattr(bpy.app.handlers, name)
    handlers.append(bpy.app.handlers.persistent(tell))


for name in ("render_init", "render_complete", "render_cancel", "render_write"):
    listen(name)
bpy.app.timers.register(serve, first_interval=1.0, persistent=True)
