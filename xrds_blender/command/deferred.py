"""What a command loads only when it runs."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from importlib import import_module
from typing import Any

from xrds_core.errors import UsageError

Lines = Callable[[dict[str, Any]], Iterable[str]]


def lines_of(module: str) -> Lines:
    """The `lines` of a module, which make a result readable."""
    return lambda result: import_module(module).lines(result)


def no_lines(_: dict[str, Any]) -> Iterable[str]:
    """For commands whose work has printed all there is to say."""
    return ()


def need_blender(command: str) -> None:
    """Register the engine; raises UsageError where Blender is not there."""
    try:
        import bpy  # noqa: F401  # only asked whether it is there
    except ImportError as error:
        raise UsageError(
            f"{command} needs Blender: install the bpy module "
            "(pip install bpy) or run blender --command xrds"
        ) from error
    from ..interface.registration import ensure_registered

    ensure_registered()
