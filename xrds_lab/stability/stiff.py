"""The stiff scenes, rendered and enlarged, beside Cycles + OIDN with as many samples.

Needs Blender. Rendered pictures are kept in a folder, so that new weights cost nothing.
"""

from __future__ import annotations

import time
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from xrds_blender.planning.settings import DEFAULT_DENOISING
from xrds_core.files import replacing
from xrds_core.superres import front_end

from .. import baselines, metrics
from .measured import Measured, faults

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from xrds_core.arrays import Array

    from ..progress import Progress
    from .subject import Subject

    Arrays = dict[str, Array]

GENERATION = 2  # counts up whenever scenes or settings change
SAMPLES, GUIDE_SAMPLES, REFERENCE_SAMPLES = 16, 4, 64
SCALES = (2, 4, 8)
RISING = (1, 4, 16, 64)  # samples over which the error must fall
_SEEDS = {"low": 11, "guides": 22, "plain": 33, "reference": 44}


def equal_samples(scale: int, samples: int = SAMPLES) -> int:
    """Return the samples of plain Cycles that cost as many rays as the product."""
    return max(1, round(samples / scale**2 + GUIDE_SAMPLES))


def samples_of(name: str) -> int:
    """Return the low-resolution samples of a scene."""
    return 1 if name == "one_sample" else SAMPLES


class Gallery:
    """Rendered inputs, rivals and references of the scenes, by scene."""

    def __init__(self, folder: Path, side: int, progress: Progress) -> None:
        self.folder, self.side, self.progress = folder, side, progress

    def arrays(self, name: str) -> Arrays:
        """Return the renders of a scene; renders them if they are missing."""
        path = self.folder / f"{name}-{self.side}-v{GENERATION}.npz"
        if not path.is_file():
            self.progress(f"rendering {name}")
            made = render(name, self.side)
            self.folder.mkdir(parents=True, exist_ok=True)
            with replacing(path) as part, part.open("wb") as file:
                np.savez(file, **made)
        with np.load(path) as file:
            return dict(file)


def render(name: str, side: int) -> Arrays:
    """Render one scene in every way that it is needed."""
    from xrds_blender import run_job

    from .stiff_scenes import build

    scene, samples = build(name, side), samples_of(name)

    def job(passes: Any) -> Arrays:
        arrays: Arrays = {}
        for scale in SCALES:
            low = passes.beauty(scale, samples, seed=_SEEDS["low"])
            arrays[f"low{scale}"] = np.dstack((low.radiance, low.alpha))
            arrays[f"noisy{scale}"] = before_denoising(low)
            arrays[f"low{scale}_seconds"] = sum(low.seconds.values())
        for count in RISING if name == "caustics" else ():
            low = passes.beauty(2, count, seed=_SEEDS["low"])
            arrays[f"rising{count}"] = low.radiance
            arrays[f"rising{count}_noisy"] = before_denoising(low)
        guides = passes.guides(GUIDE_SAMPLES, seed=_SEEDS["guides"])
        arrays |= {"albedo": guides.albedo, "normal": guides.normal}
        arrays["alpha"] = guides.alpha
        arrays["guides_seconds"] = sum(guides.seconds.values())
        plain = {f"plain{s}": equal_samples(s, samples) for s in SCALES}
        for key, count in (plain | {"reference": REFERENCE_SAMPLES}).items():
            seed = _SEEDS["reference" if key == "reference" else "plain"]
            picture = passes.beauty(1, count, seed=seed, denoiser=DEFAULT_DENOISING)
            arrays[key] = picture.radiance
            arrays[f"{key}_seconds"] = sum(picture.seconds.values())
        return {key: np.asarray(x, np.float32) for key, x in arrays.items()}

    return run_job(scene, job)


def before_denoising(beauty: Any) -> Array:
    """Return the noisy radiance (h, w, 3); without OIDN the radiance itself."""
    return beauty.radiance if beauty.noisy is None else beauty.noisy


def enlarged(subject: Subject, arrays: Arrays) -> Array:
    """Return the product's picture (H, W, 4) of a scene."""
    low = arrays[f"low{subject.scale}"]
    cover = arrays["alpha"] if low[..., 3].min() < 1.0 else None
    low = low if cover is not None else low[..., :3]
    return subject.upscaler(
        low,
        arrays["albedo"],
        arrays["normal"],
        noisy=arrays[f"noisy{subject.scale}"],
        guide_alpha=cover,
    ).radiance


def stops(reference: Array) -> float:
    """Return the view exposure that shows a picture at middle grey."""
    clean, _ = front_end.clean_radiance(reference)
    return float(np.log2(front_end.auto_exposure(clean)))


def scene(subject: Subject, name: str, arrays: Arrays) -> Iterator[Measured]:
    """PSNR of one scene against bicubic's and OIDN's with as many samples."""
    low = front_end.clean_radiance(arrays[f"low{subject.scale}"][..., :3])[0]
    truth, _ = front_end.clean_radiance(arrays["reference"])
    plain, _ = front_end.clean_radiance(arrays[f"plain{subject.scale}"])
    shown = stops(truth)
    start = time.perf_counter()
    picture = enlarged(subject, arrays)
    network = time.perf_counter() - start
    light = np.nan_to_num(picture[..., :3])
    rival = baselines.bicubic(low, subject.scale)
    ours, bicubic, oidn = (metrics.psnr(x, truth, shown) for x in (light, rival, plain))
    yield Measured(f"stiff.{name}.faults", faults(picture))
    yield Measured(f"stiff.{name}.below_bicubic", bicubic - ours)
    yield Measured(f"stiff.{name}.below_oidn", oidn - ours)
    seconds = arrays[f"low{subject.scale}_seconds"] + arrays["guides_seconds"]
    spent = arrays[f"plain{subject.scale}_seconds"]
    yield Measured(f"stiff.{name}.seconds", float((seconds + network) / spent))
    yield Measured(
        f"stiff.{name}.brightest", float(light.max() / max(low.max(), 1e-30))
    )


def rising(subject: Subject, arrays: Arrays) -> Iterator[Measured]:
    """The error falls with samples: decibels lost at the worst step."""
    if subject.scale != 2:
        return
    truth, _ = front_end.clean_radiance(arrays["reference"])
    curve = {}
    for count in RISING:
        picture = subject.upscaler(
            arrays[f"rising{count}"],
            arrays["albedo"],
            arrays["normal"],
            noisy=arrays[f"rising{count}_noisy"],
        ).radiance
        curve[count] = metrics.psnr(picture, truth, stops(truth))
    values = list(curve.values())
    steps = [a - b for a, b in pairwise(values)]
    yield Measured("samples.falling_psnr", max(steps), curve)
