"""The training-set generator: random scenes rendered into small windows.

Every window is rendered by the code the product renders with, at the pixel density of
a whole frame. One `.npz` file per window holds, in half precision and row 0 on top,

- `reference` (H, W, 3): radiance at full resolution, denoised;
- `low{S}_{i}`, `low{S}_{i}_noisy` (H / S, W / S, 3): radiance at 1 / S of the size
  through a box filter, denoised and as rendered, for two sample counts i = 0, 1;
- `guides_a`, `guides_b` (H, W, 6): albedo and camera-space normal, two seeds;
- `meta`: a JSON string with seeds, window, sample counts, seconds and assets.
"""

from __future__ import annotations

import json
import random
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from tqdm import tqdm

from xrds_blender import run_job
from xrds_blender.cycles.passes import CyclesPasses
from xrds_blender.planning.settings import DEFAULT_DENOISING
from xrds_core.arrays import Array
from xrds_core.files import replacing

from . import framing, scenes
from .framing import Window
from .stage import Stage, View

Arrays = dict[str, Array]
HALF_MAX = 65504.0  # the largest half-precision number
VALIDATION_EVERY = 10
JOURNAL = "scenes.jsonl"


@dataclass(frozen=True)
class Recipe:
    """How windows are made. Sizes are pixels, samples are per pixel."""

    out: Path
    scales: tuple[int, ...] = (2, 4, 8)
    assets: Path | None = None
    window: int = 256
    views: int = 2
    windows: int = 2  # of each view
    reference_samples: int = 24  # in the training split

    def reference(self, seed: int) -> int:
        """Samples of a reference; twice as many where checkpoints are compared."""
        return self.reference_samples * (1 if self.split(seed) == "train" else 2)

    def split(self, seed: int) -> str:
        """`train` or `validation`, by the scene's number alone."""
        return "validation" if seed % VALIDATION_EVERY == 9 else "train"

    def path(self, seed: int, index: int) -> Path:
        """Where window `index` of scene `seed` is written."""
        return self.out / self.split(seed) / f"{seed:06d}_{index:02d}.npz"


@dataclass(frozen=True)
class Samples:
    """The sample counts of one window, and the dice for the seeds of its renders."""

    rng: random.Random
    low: dict[tuple[int, int], int]  # by scale and quality, 0 or 1
    guides: tuple[int, int]
    reference: int

    LOW = ((4, 16), (16, 32))
    GUIDES = (1, 8)

    @classmethod
    def drawn(
        cls, rng: random.Random, scales: Sequence[int], reference: int
    ) -> Samples:
        """Log-uniform counts for each scale and each of the two qualities."""
        pairs = [(scale, i) for scale in scales for i in (0, 1)]
        low = {(scale, i): _log_uniform(rng, *cls.LOW[i]) for scale, i in pairs}
        guides = (_log_uniform(rng, *cls.GUIDES), _log_uniform(rng, *cls.GUIDES))
        return cls(rng, low, guides, reference)


def _log_uniform(rng: random.Random, low: int, high: int) -> int:
    return round(low * (high / low) ** rng.random())


def generate(
    out: str | Path,
    seed: int = 0,
    count: int = 1,
    scales: Sequence[int] = (2, 4, 8),
    assets: str | Path | None = None,
    **options: Any,
) -> int:
    """Render `count` scenes from number `seed` on; returns the windows written.

    Finished scenes and windows are skipped, so the same call resumes an interrupted
    run. `options` are further fields of Recipe.
    """
    assets = Path(assets) if assets is not None else None
    recipe = Recipe(Path(out), tuple(scales), assets, **options)
    for split in ("train", "validation"):
        (recipe.out / split).mkdir(parents=True, exist_ok=True)
    done = _finished(recipe.out / JOURNAL)
    todo = [number for number in range(seed, seed + count) if number not in done]
    written = 0
    with tqdm(todo, unit="scene", file=sys.stderr) as bar:
        for number in bar:
            written += _scene(recipe, number)
            bar.set_postfix(windows=written)
    return written


def _finished(journal: Path) -> set[int]:
    if not journal.exists():
        return set()
    lines = journal.read_text().splitlines()
    return {json.loads(line)["seed"] for line in lines if line.endswith("}")}


def _scene(recipe: Recipe, seed: int) -> int:
    start = time.perf_counter()
    stage = scenes.build_scene(seed, recipe.assets)
    built = time.perf_counter() - start
    written = index = 0
    for view, window, exposure in _windows(recipe, stage, seed):
        path = recipe.path(seed, index)
        if not path.exists():
            scenes.show(stage, view)
            framing.set_border(stage.scene, window)
            meta = {
                "seed": seed,
                "index": index,
                "kind": stage.kind,
                "build": built,
                "exposure": exposure,
                "view": view.__dict__,
            }
            _write(recipe, stage, path, window, meta)
            written += 1
        index += 1
    record = {
        "seed": seed,
        "kind": stage.kind,
        "windows": index,
        "seconds": round(time.perf_counter() - start, 2),
    }
    with (recipe.out / JOURNAL).open("a") as journal:
        journal.write(json.dumps(record) + "\n")
    return written


def _windows(
    recipe: Recipe, stage: Stage, seed: int
) -> Iterator[tuple[View, Window, float]]:
    """Views and windows worth rendering, with the exposure of the whole frame."""
    from xrds_core.superres.front_end import auto_exposure

    rng = random.Random(f"{seed} windows")
    used = 0
    for view in stage.views:
        radiance, albedo, normal = _probe(stage, view, seed)
        if not framing.lit(radiance):
            continue
        frame = (stage.scene.render.resolution_x, stage.scene.render.resolution_y)
        detail = framing.interest(radiance, albedo, normal)
        windows = framing.choose(
            rng, frame, recipe.window, recipe.windows, detail, radiance.mean(-1)
        )
        for window in windows:
            yield view, window, float(auto_exposure(radiance))
        used += bool(windows)
        if used == recipe.views:
            return


def _probe(stage: Stage, view: View, seed: int) -> tuple[Array, ...]:
    """A tiny, noisy picture of the whole frame: radiance, albedo, normal."""
    scenes.show(stage, view)
    framing.set_border(stage.scene, None)
    stage.scene.render.resolution_percentage = framing.PROBE_PERCENT
    try:
        (low,) = run_job(
            stage.scene, lambda passes: passes.low_samples(1, 2, seed=seed)
        ).values()
    finally:
        stage.scene.render.resolution_percentage = 100
    probe = low.samples
    return probe.picture[..., :3], probe.albedo, probe.normal


def _write(
    recipe: Recipe, stage: Stage, path: Path, window: Window, meta: dict[str, Any]
) -> None:
    rng = random.Random(f"{meta['seed']} {meta['index']} samples")
    samples = Samples.drawn(rng, recipe.scales, recipe.reference(meta["seed"]))
    start = time.perf_counter()
    arrays, seconds = run_job(stage.scene, lambda passes: _arrays(passes, samples))
    render = stage.scene.render
    used = stage.library.used if stage.library else []
    meta |= {
        "window": [window.x, window.y, window.size, window.size],
        "frame": [render.resolution_x, render.resolution_y],
        "low_spp": {f"{scale}_{i}": n for (scale, i), n in samples.low.items()},
        "guide_spp": list(samples.guides),
        "reference_spp": samples.reference,
        "seconds": seconds | {"total": round(time.perf_counter() - start, 3)},
        "blender_series": "{}.{}".format(*bpy.app.version),
        "recipes": scenes.VERSION,
        "motion_blur": render.use_motion_blur,
        "assets": used,
    }
    halves = {name: _half(array) for name, array in arrays.items()}
    with replacing(path) as unfinished, unfinished.open("wb") as file:
        np.savez_compressed(file, meta=np.array(json.dumps(meta)), **halves)


def _half(array: Array) -> Array:
    clean = np.nan_to_num(array, nan=0.0, posinf=HALF_MAX, neginf=-HALF_MAX)
    return np.clip(clean, -HALF_MAX, HALF_MAX).astype(np.float16)


def _arrays(passes: CyclesPasses, samples: Samples) -> tuple[Arrays, dict[str, float]]:
    """All renders of one window; every one has noise of its own."""
    arrays: Arrays = {}
    seconds: dict[str, float] = {}

    def timed(stage: str, call: Any) -> Any:
        clocks = {stage: time.perf_counter, f"{stage}_cpu": time.process_time}
        starts = {name: clock() for name, clock in clocks.items()}
        result = call(seed=samples.rng.randrange(2**31))
        for name, clock in clocks.items():
            spent = clock() - starts[name]
            seconds[name] = round(seconds.get(name, 0.0) + spent, 3)
        return result

    for (scale, i), count in samples.low.items():
        low = timed(
            f"low{scale}", lambda seed, s=scale, n=count: passes.beauty(s, n, seed=seed)
        )
        arrays[f"low{scale}_{i}"] = low.radiance
        arrays[f"low{scale}_{i}_noisy"] = low.noisy
    for name, count in zip("ab", samples.guides, strict=True):
        guides = timed("guides", lambda seed, n=count: passes.guides(n, seed=seed))
        arrays[f"guides_{name}"] = np.concatenate([guides.albedo, guides.normal], -1)
    reference = timed(
        "reference",
        lambda seed: passes.beauty(
            1, samples.reference, denoiser=DEFAULT_DENOISING, seed=seed
        ),
    )
    arrays["reference"] = reference.radiance
    return arrays, seconds
