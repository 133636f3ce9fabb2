"""Which device Cycles renders on, and what memory a card has in use."""

from __future__ import annotations

import shutil
import subprocess
from contextlib import suppress
from typing import Any

# The faster kind first. Metal and HIP are what Apple and AMD have.
_KINDS = ("OPTIX", "CUDA", "HIP", "METAL", "ONEAPI")
_QUERY = ("--query-gpu=memory.used", "--format=csv,noheader,nounits")


def use_card(kinds: tuple[str, ...] = _KINDS) -> str:
    """Let Cycles render on a graphics card; returns its kind and name, or `CPU`."""
    import bpy

    preferences = bpy.context.preferences.addons["cycles"].preferences
    for kind in kinds:
        with suppress(TypeError):  # a kind that this build of Blender does not have
            preferences.compute_device_type = kind
            preferences.refresh_devices()
            cards = [x for x in preferences.devices if x.type == kind]
            for device in preferences.devices:
                device.use = device in cards
            if cards:
                return f"{kind}: {cards[0].name}"
    preferences.compute_device_type = "NONE"
    return "CPU"


def render_on(scene: Any, device: str) -> None:
    """Let a scene's samples and denoiser run on what `use_card` has found."""
    is_card = device != "CPU"
    scene.cycles.device = "GPU" if is_card else "CPU"
    scene.cycles.denoising_use_gpu = is_card


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
