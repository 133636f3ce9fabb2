"""Which device Cycles renders on, and what memory a card has in use."""

from __future__ import annotations

import shutil
import subprocess
from contextlib import suppress
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence

# The faster kind first. Metal and HIP are what Apple and AMD have.
_KINDS = ("OPTIX", "CUDA", "HIP", "METAL", "ONEAPI")
CPU = "CPU"
_QUERY = ("--query-gpu=memory.used", "--format=csv,noheader,nounits")


def find_card(kinds: Sequence[str] = _KINDS) -> str:
    """Return the kind of a graphics card that Cycles can render on, or `CPU`."""
    return next((kind for kind in kinds if _use(kind)), CPU)


def render_on(scene: Any, kind: str) -> str:
    """Let samples and denoiser run on the cards of a kind; returns the first's name.

    To be called for each file that is opened: it may bring preferences of its own.
    """
    names = _use(kind)
    scene.cycles.device = "GPU" if names else "CPU"
    scene.cycles.denoising_use_gpu = bool(names)
    return f"{kind}: {names[0]}" if names else CPU


def _use(kind: str) -> list[str]:
    """Choose the cards of a kind in the preferences; returns their names."""
    import bpy

    preferences = bpy.context.preferences.addons["cycles"].preferences
    try:
        preferences.compute_device_type = "NONE" if kind == CPU else kind
    except TypeError:  # this build of Blender does not have the kind
        return []
    preferences.refresh_devices()
    for device in preferences.devices:
        device.use = device.type == kind
    return [x.name for x in preferences.devices if x.type == kind != CPU]


def memory_in_use() -> int | None:
    """Bytes in use on the first NVIDIA card, by all programs; None without one."""
    tool = shutil.which("nvidia-smi")
    if tool is None:
        return None
    with suppress(OSError, subprocess.SubprocessError, ValueError):
        done = subprocess.run(
            [tool, *_QUERY], capture_output=True, text=True, timeout=20, check=True
        )
        return int(done.stdout.split()[0]) << 20
    return None
