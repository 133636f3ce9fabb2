"""Our denoiser in the model that time budgets go by: errors and seconds.

    python -m xrds_lab.bench.ours SCENE-SEED... --assets FOLDER --model budget.json

measures our qualities beside Blender's default on a window of studio scenes and puts
what they differ by into the model. None of the scenes of the report is used.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from xrds_blender.command import console
from xrds_blender.planning.budget import Curve, ErrorModel, Model
from xrds_blender.planning.settings import (
    DEFAULT_DENOISING,
    OUR_DENOISING,
    Denoising,
    Mode,
    Settings,
)
from xrds_core.files import read_json, write_json

from .. import metrics

COUNTS = (1, 2, 3, 4, 5, 6, 8, 12, 16, 24, 32, 64)
# Blue noise of other counts is laid out less well: five samples are hardly better than
# four. Between these the default's errors are a line.
EVEN_COUNTS = (1, 2, 4, 8, 16, 32, 64)
REFERENCE_SAMPLES, REFERENCE_SEEDS, SEED = 64, (11, 12), 404
BORDER = (0.4, 0.6, 0.35, 0.6)  # of the frame: left, right, bottom, top
TIMED = (1920, 1080)
ROUNDS = 3
Row = dict[str, float]


def main() -> None:
    """Measure, and write the model."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="+", metavar="KIND-SEED")
    parser.add_argument("--assets", type=Path)
    parser.add_argument("--model", type=Path, required=True, help="read and written")
    parser.add_argument("--measured", type=Path, required=True, help="JSON; resumes")
    options = parser.parse_args()
    model = Model.read(options.model)
    measured = _read(options.measured)
    for name in options.scenes:
        if name not in measured:
            measured[name] = measure(name, options.assets)
            write_json(options.measured, measured)
            print(name, file=sys.stderr, flush=True)
    write_json(options.model, joined(model, measured).to_json())


def _read(path: Path) -> dict[str, Any]:
    return read_json(path) if path.is_file() else {}


def measure(name: str, assets: Path | None) -> dict[str, Row]:
    """PSNR in dB by samples and denoiser on a window of a studio scene.

    And under `seconds` those of denoising a picture of 1920 x 1080 pixels.
    """
    from xrds_blender import run_job
    from xrds_blender.interface.registration import ensure_registered

    from ..studio.scenes import build_scene

    kind, _, seed = name.partition("-")
    scene = build_scene(int(seed), assets, kind).scene
    ensure_registered()
    render = scene.render
    render.use_border = render.use_crop_to_border = True
    render.border_min_x, render.border_max_x = BORDER[:2]
    render.border_min_y, render.border_max_y = BORDER[2:]
    scene.cycles.use_adaptive_sampling = False
    exposure = 2.0**scene.view_settings.exposure
    return run_job(scene, lambda passes: _errors(passes, exposure))


def _errors(passes: Any, exposure: float) -> dict[str, Row]:
    halves = [
        passes.beauty(1, REFERENCE_SAMPLES, denoiser=DEFAULT_DENOISING, seed=seed)
        for seed in REFERENCE_SEEDS
    ]
    reference = sum(half.radiance for half in halves) / len(halves) * exposure
    return {str(n): _row(passes, n, reference, exposure) for n in COUNTS}


def _row(passes: Any, count: int, reference: Any, exposure: float) -> Row:
    from xrds_core.denoising import Denoiser as OurDenoiser

    row = {}
    if count in EVEN_COUNTS:
        rival = passes.beauty(1, count, denoiser=DEFAULT_DENOISING, seed=SEED)
        row[str(DEFAULT_DENOISING)] = metrics.psnr(rival.radiance * exposure, reference)
    noisy = passes.low_samples(1, count, seed=SEED)[passes.views[0]].samples
    for mode in OUR_DENOISING:
        denoise = OurDenoiser(mode.quality)
        ours = denoise(noisy.picture[..., :3], noisy.albedo, noisy.normal).radiance
        row[str(mode)] = metrics.psnr(ours * exposure, reference)
    return row


def joined(model: Model, measured: dict[str, dict[str, Row]]) -> Model:
    """The model with our denoiser: the default's curve and what ours differ by."""
    base = model.errors.curves[
        Settings(Mode.CYCLES_ONLY, None, DEFAULT_DENOISING).family
    ]
    curves = dict(model.errors.curves)
    for mode in OUR_DENOISING:
        psnr = {
            count: base.at(count) + _difference(measured, mode, count)
            for count in COUNTS
        }
        curves[Settings(Mode.FULL_SIZE, None, mode).family] = Curve.of(psnr)
    speeds = {**model.denoiser_speed, **_speeds()}
    return replace(model, errors=ErrorModel(curves), denoiser_speed=speeds)


def _difference(
    measured: dict[str, dict[str, Row]], mode: Denoising, count: int
) -> float:
    """Of a denoiser from the default's line through the even counts.

    The median over the scenes: one whose reference is poor would sway a mean.
    """
    return statistics.median(
        scene[str(count)][mode] - _line(scene).at(count) for scene in measured.values()
    )


def _line(scene: dict[str, Row]) -> Curve:
    return Curve.of({n: scene[str(n)][DEFAULT_DENOISING] for n in EVEN_COUNTS})


def _speeds() -> dict[Denoising, float]:
    """Processor seconds of ours as multiples of the default's in Blender.

    Processor seconds, because wall time is the machine's as much as the denoiser's;
    both use every core. The default's networks are run by the same library: two
    prefilters by the large network, and the picture.
    """
    random = np.random.default_rng(0)
    width, height = TIMED
    images = [random.random((height, width, 3), np.float32) for _ in range(3)]
    unit = statistics.median(_seconds(lambda: _default(*images)) for _ in range(ROUNDS))
    return {mode: round(_our_seconds(mode, images) / unit, 4) for mode in OUR_DENOISING}


def _our_seconds(mode: Denoising, images: list[Any]) -> float:
    from xrds_core.denoising import Denoiser as OurDenoiser

    denoiser = OurDenoiser(mode.quality)
    denoiser(*images)
    return statistics.median(_seconds(lambda: denoiser(*images)) for _ in range(ROUNDS))


def _default(radiance: Any, albedo: Any, normal: Any) -> None:
    """What Blender's default does: both guides by the large network, then the rest."""
    import mitsuba_oidn as oidn

    device = oidn.Device(oidn.DeviceType.CPU)
    device.commit()
    images = {"albedo": albedo, "normal": normal}
    for name, image in images.items():
        task = device.new_filter("RT")
        task.set_image(name, image)
        task.set_image("output", np.empty_like(image))
        task.quality = oidn.Quality.High
        task.execute()
    oidn.denoise(radiance, albedo, normal, hdr=True, clean_aux=True)


def _seconds(work: Callable[[], object]) -> float:
    started = time.process_time()
    work()
    return time.process_time() - started


if __name__ == "__main__":
    main()
    console.leave(console.DONE)
