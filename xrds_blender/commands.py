"""What the commands of `cli` share."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from importlib import import_module
from typing import Any

from xrds_core.errors import UsageError


def lines_of(module: str) -> Callable[[dict[str, Any]], Iterable[str]]:
    """A module's `lines`; it is loaded only when there is something to tell."""
    return lambda told: import_module(module, __package__).lines(told)


def need_blender(command: str) -> None:
    """Raise UsageError where Blender is not there."""
    try:
        import bpy  # noqa: F401  # only asked whether it is there
    except ImportError as error:
        raise UsageError(
            f"{command} needs Blender: install the bpy module "
            "(pip install bpy) or run blender --command xrds"
        ) from error
