"""The preferences as plain values: torch, device, memory and weights."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy

MEBIBYTE = 1 << 20

package = "xrds_blender"
"""The add-on's module name, under which Blender keeps its preferences."""


@dataclass(frozen=True)
class PreferenceValues:
    """The preferences as plain values; the defaults hold where there is no add-on."""

    device: str = "auto"
    memory_limit: int | None = None
    """Bytes that the network may add; None leaves it to the device."""
    weights: Path | None = None
    """Folder of weights files; None means the shipped ones."""
    threads: int | None = None
    """Of the network on the processor; None leaves it to PyTorch."""
    finish_stopped: bool = True
    """Whether a render that the user stops leaves the picture so far, denoised."""
    torch: Path | None = None
    """Folder that PyTorch is taken from; None means the one that Python finds."""


def preference_values() -> PreferenceValues:
    """The preferences of the enabled add-on, or the defaults."""
    entry = bpy.context.preferences.addons.get(package)
    stored: Any = entry and entry.preferences
    if stored is None:
        return PreferenceValues()
    return PreferenceValues(
        device=stored.device or "auto",
        memory_limit=stored.memory_limit * MEBIBYTE or None,
        weights=folder(stored.weights),
        threads=stored.threads or None,
        finish_stopped=stored.finish_stopped,
        torch=folder(stored.torch),
    )


def folder(text: str) -> Path | None:
    """A folder as the preferences hold it; None where the field is empty."""
    return Path(bpy.path.abspath(text)) if text else None
