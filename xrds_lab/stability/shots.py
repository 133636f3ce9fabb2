"""Two shots of 24 frames: a turntable, and a lamp that flickers.

Needs Blender. Flicker is the mean absolute second difference over time, in sRGB, of
pixels where nothing moves; beside it that of Cycles + OIDN with as many samples.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from xrds_blender.planning.settings import DEFAULT_DENOISING
from xrds_core.files import replacing

from .. import metrics
from .measured import Measured
from .stiff import GUIDE_SAMPLES, SAMPLES, SCALES, before_denoising, equal_samples

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from xrds_core.arrays import Array

    from ..progress import Progress
    from .subject import Subject

    Arrays = dict[str, Array]

GENERATION = 2
FRAMES = 24
SHOTS = ("turntable", "flickering")
_STILL = 0.03  # of guides: pixels that change more are taken for moving
_MARGIN = 4  # pixels around moving ones that are left out with them


def frames(folder: Path, name: str, side: int, progress: Progress) -> Arrays:
    """Return the rendered frames of a shot, (frames, height, width, 3) each."""
    path = folder / f"shot-{name}-{side}-{FRAMES}-v{GENERATION}.npz"
    if not path.is_file():
        progress(f"rendering {FRAMES} frames of the {name} shot")
        made = _rendered(name, side)
        folder.mkdir(parents=True, exist_ok=True)
        with replacing(path) as part, part.open("wb") as file:
            np.savez(file, **made)
    with np.load(path) as file:
        return dict(file)


def _rendered(name: str, side: int) -> Arrays:
    from xrds_blender import run_job

    from .stiff_scenes import build

    scene = build("one_sample", side)
    things = {thing.name: thing for thing in scene.objects}
    lamp = next(x for x in scene.objects if x.type == "LIGHT")
    kept: dict[str, list[Array]] = {}
    watts = lamp.data.energy
    for frame in range(FRAMES):
        if name == "turntable":
            things["steel"].rotation_euler[0] = 0.6
            things["steel"].rotation_euler[2] = 2 * math.pi * frame / FRAMES
        else:
            lamp.data.energy = watts * (1.0 + 0.5 * math.sin(2.1 * frame))
        for key, array in run_job(scene, lambda p, f=frame: _frame(p, f)).items():
            kept.setdefault(key, []).append(array)
    return {key: np.stack(arrays) for key, arrays in kept.items()}


def _frame(passes: Any, frame: int) -> Arrays:
    """One frame's renders; every frame has noise of its own."""
    arrays: Arrays = {}
    for scale in SCALES:
        low = passes.beauty(scale, SAMPLES, seed=100 + frame)
        arrays |= {f"low{scale}": low.radiance, f"noisy{scale}": before_denoising(low)}
    guides = passes.guides(GUIDE_SAMPLES, seed=200 + frame)
    arrays |= {"albedo": guides.albedo, "normal": guides.normal}
    for scale in SCALES:
        count = equal_samples(scale)
        picture = passes.beauty(1, count, seed=300 + frame, denoiser=DEFAULT_DENOISING)
        arrays[f"plain{scale}"] = picture.radiance
    return arrays


def still_pixels(arrays: Arrays) -> Array:
    """Return (H, W): where neither albedo nor normal changes but by noise."""
    import torch
    from torch.nn import functional

    change = np.zeros(arrays["albedo"].shape[1:3], np.float32)
    for name in ("albedo", "normal"):
        clip = arrays[name].clip(-1.0, 1.0)
        early, late = clip[: FRAMES // 4], clip[FRAMES // 2 : 3 * FRAMES // 4]
        change = np.maximum(change, np.abs(early.mean(0) - late.mean(0)).max(-1))
    planes = torch.from_numpy(change)[None, None]
    near = functional.max_pool2d(planes, 2 * _MARGIN + 1, 1, _MARGIN)
    return near[0, 0].numpy() < _STILL * 4


def flicker(clip: Array, still: Array) -> float:
    """Return the mean absolute second difference over time of still pixels."""
    shown = metrics.to_srgb(clip)
    second = shown[2:] - 2 * shown[1:-1] + shown[:-2]
    return float(np.abs(second)[:, still].mean())


def shot(subject: Subject, name: str, arrays: Arrays) -> Iterator[Measured]:
    """Flicker of one shot over OIDN's, and how far its exposure wanders."""
    results = [
        subject.upscaler(*inputs, noisy=noisy)
        for *inputs, noisy in _frames(subject, arrays)
    ]
    clip = np.stack([x.radiance for x in results])
    exposures = np.log2([x.exposure for x in results])
    still = still_pixels(arrays)
    plain = flicker(arrays[f"plain{subject.scale}"], still)
    curve = dict(enumerate(map(float, exposures - exposures.mean())))
    yield Measured(f"shot.{name}.flicker", flicker(clip, still) / max(plain, 1e-9))
    yield Measured(f"shot.{name}.exposure", float(np.ptp(exposures)), curve)


def _frames(subject: Subject, arrays: Arrays) -> Iterator[tuple[Array, ...]]:
    """Yield radiance, albedo, normal and noisy radiance of each frame."""
    names = (f"low{subject.scale}", "albedo", "normal", f"noisy{subject.scale}")
    return zip(*(arrays[name] for name in names), strict=True)


def held(subject: Subject, arrays: Arrays) -> Iterator[Measured]:
    """The flickering shot with one exposure, as an animation is rendered."""
    first = None
    clip = []
    for *inputs, noisy in _frames(subject, arrays):
        result = subject.upscaler(*inputs, noisy=noisy, exposure=first)
        first = result.exposure
        clip.append(result.radiance)
    still = still_pixels(arrays)
    plain = flicker(arrays[f"plain{subject.scale}"], still)
    yield Measured("shot.held.flicker", flicker(np.stack(clip), still) / plain)
