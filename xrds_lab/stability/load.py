"""Two hundred frames in one process: memory, data-blocks and seconds of each.

Needs Blender. Every frame is another one, so that no guides serve twice, and is written
as a file. The memory for guides of before is made small: it is soon full, as that of a
long shot is.
"""

from __future__ import annotations

import sys
import tempfile
import time
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .measured import Measured

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from .subject import Subject

FRAMES = 200
SIDE = 64  # pixels along one side
_GUIDE_MEMORY = 1 << 20  # bytes


@dataclass(frozen=True)
class FrameLoad:
    """What the process holds after a frame, and what it took."""

    memory: int
    """Resident, in bytes; 0 where the system does not report it."""
    data_blocks: int
    cpu_seconds: float


def drive(scene: Any, count: int, **choices: Any) -> list[FrameLoad]:
    """Render frames 1 to `count` and write them as PNG and EXR in turn.

    `choices` are those of `xrds_blender.render`.
    """
    from xrds_blender import render
    from xrds_blender.command import picture_file

    frames = []
    with tempfile.TemporaryDirectory() as folder, _small_guide_cache():
        for number in range(1, count + 1):
            start = time.process_time()
            scene.frame_set(number)
            picture = render(scene, **choices)
            target = Path(folder) / f"frame.{('exr', 'png')[number % 2]}"
            picture_file.save(target, picture.radiance, picture.alpha, scene)
            seconds = time.process_time() - start
            frames.append(FrameLoad(resident(), _data_blocks(), seconds))
    return frames


def growth(values: Sequence[float]) -> float:
    """Return the median slope over all pairs of values (Theil and Sen), per frame."""
    y = np.asarray(values, np.float64)
    early, late = np.triu_indices(len(y), 1)
    return float(np.median((y[late] - y[early]) / (late - early)))


def settled(frames: list[FrameLoad]) -> list[FrameLoad]:
    """Leave out the first third: caches fill and allocators settle there."""
    return frames[len(frames) // 3 :]


def load(subject: Subject, weights: Path | None) -> Iterator[Measured]:
    """Growth over a shot; only in fp32, for its network is the same for Blender."""
    if subject.precision != "fp32":
        return
    from .stiff_scenes import build

    scene = build("one_sample", SIDE)
    thing = scene.objects["steel"]
    for frame, angle in ((1, 0.0), (FRAMES, 6.0)):
        thing.rotation_euler[2] = angle
        thing.keyframe_insert("rotation_euler", frame=frame)
    frames = drive(
        scene,
        FRAMES,
        scale=subject.scale,
        samples=2,
        preset=subject.preset,
        device=subject.device,
        weights=weights,
    )
    frames = settled(frames)
    memory = [frame.memory / 2**10 for frame in frames]
    numbers = range(FRAMES - len(frames) + 1, FRAMES + 1)
    above = dict(zip(numbers, (x - memory[0] for x in memory), strict=True))
    yield Measured("load.memory", growth(memory), above)
    blocks = [frame.data_blocks for frame in frames]
    yield Measured("load.data_blocks", max(blocks) - min(blocks))
    seconds = [frame.cpu_seconds for frame in frames]
    half = len(seconds) // 2
    slower = np.median(seconds[half:]) / np.median(seconds[:half])
    yield Measured("load.slowing", float(slower))


@contextmanager
def _small_guide_cache() -> Iterator[None]:
    from xrds_blender.rendering import guide_cache

    usual = guide_cache.CACHE
    guide_cache.CACHE = guide_cache.GuideCache(_GUIDE_MEMORY)
    try:
        yield
    finally:
        guide_cache.CACHE = usual


def resident() -> int:
    """Return the bytes of memory this process holds; 0 where they are not told."""
    if sys.platform != "linux":
        return 0
    import resource

    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize()


def _data_blocks() -> int:
    import bpy

    kinds = [x for x in bpy.data.bl_rna.properties if x.type == "COLLECTION"]
    return sum(len(getattr(bpy.data, kind.identifier)) for kind in kinds)
