"""`xrds bench light-parts`: the parts of the light, denoised with the picture.

Each scene is made a shot. Its middle frame's parts are judged: as rendered, each
denoised by itself, and finished with the picture, by themselves and in the shot. A lamp
beside the camera makes a light group of its own where the file has none.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from xrds_blender.command import console
from xrds_core.accumulation.accumulate import accumulate
from xrds_core.accumulation.frame import store
from xrds_core.accumulation.object_motion import Movement
from xrds_core.denoising import Denoiser
from xrds_core.files import read_json, write_json
from xrds_core.finish import finish_frame

from .. import metrics
from ..bench import machine
from ..bench.folder_of_report import make_folder
from ..bench.inputs import Folder, open_scene
from ..bench.journal import Journal
from ..bench.windows import find_shots
from ..csv_table import write_table
from ..progress import report_line
from .frames import MIDDLE
from .motions import animate

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from xrds_core.accumulation.frame import Frame
    from xrds_core.arrays import Array
    from xrds_core.denoising.light_passes import LightPart

    from ..bench.windows import Shot

    Row = dict[str, Any]

RAW, ONE_BY_ONE, STILL, SHOT = "raw", "one_by_one", "still", "shot"
METHODS = (RAW, ONE_BY_ONE, STILL, SHOT)
_REACH = 4  # frames to each side that lend to the middle one
_SEEDS = (2_000_003, 2_000_029)  # of references; no noisy frame's is near
_BRIGHTNESS = 0.1  # of a white surface in the middle, by the lamp that is added
_TINY = 1e-9
_LOBES = ("diffuse", "glossy", "transmission")


@dataclass(frozen=True)
class _Rendered:
    """Noisy frames by number, two references of the middle one, and its exposure."""

    frames: Mapping[int, Frame]
    references: Sequence[Frame]
    parts: Sequence[LightPart]
    stops: float


def bench_light_parts(
    scenes: Sequence[Path],
    out: Path,
    samples: Sequence[int] = (4,),
    *,
    windows: Path | None = None,
    references: Path | None = None,
    resolution: tuple[int, int] | None = None,
    cache: Path | None = None,
    reference_samples: int = 128,
) -> dict[str, Any]:
    """Measure what is missing, write the report into `out` and return it.

    PSNR is of each part as light, in sRGB at the scene's exposure, against two renders
    of `reference_samples` without their noise. Raises UsageError for missing files.
    """
    make_folder(out)
    folder = Folder(cache or out / "cache")
    journal = Journal(folder.directory / "journal-light-parts.json", report_line)
    rows: list[Row] = []
    with console.stdout_to(folder.directory / "blender.log"):
        for shot in find_shots(scenes, windows, references, resolution):
            for count in samples:
                name = f"{shot.identity}-{shot.window.label}-{count}-light-parts.json"
                path = folder.directory / name
                with journal.attempt(f"{shot.name}: {count} samples"):
                    if not path.is_file():
                        report_line(f"{shot.name}: parts of {count} samples")
                        made = _render(shot, count, reference_samples)
                        write_json(path, _judged(shot.name, count, made))
                    rows += read_json(path)
                _write(rows, journal, out)
    return _write(rows, journal, out)


def _render(shot: Shot, samples: int, reference_samples: int) -> _Rendered:
    from xrds_blender.planning.request import render_request
    from xrds_blender.rendering.blender_job import call_engine
    from xrds_blender.rendering.sampling import noisy_frame, parts_of_layer

    scene = open_scene(shot.path, shot.window)
    animate(scene, shot.window, "pan", MIDDLE, _REACH)
    _add_passes(scene)
    scene.render.use_persistent_data = True
    job = render_request(
        scale=1, samples=samples, temporal_radius=_REACH, passes=("all",)
    )

    def sampled(number: int, **choices: Any) -> Frame:
        scene.frame_set(number)
        place = number - (MIDDLE - _REACH)
        own = job.with_settings(samples=choices.pop("samples", samples))
        found, _ = call_engine(
            scene,
            lambda *given: noisy_frame(*given, replace(own, **choices), place),
        )
        return next(iter(found.values()))

    numbers = range(MIDDLE - _REACH, MIDDLE + _REACH + 1)
    frames = {number: sampled(number) for number in numbers}
    truth = [sampled(MIDDLE, samples=reference_samples, seed=seed) for seed in _SEEDS]
    parts = call_engine(scene, lambda *given: parts_of_layer(*given, job))
    return _Rendered(frames, truth, parts, float(scene.view_settings.exposure))


def _add_passes(scene: Any) -> None:
    """Switch on all lobes, and light groups where the file has none."""
    layer = scene.view_layers[0]
    for lobe in _LOBES:
        for kind in ("direct", "indirect", "color"):
            setattr(layer, f"use_pass_{lobe}_{kind}", True)
    layer.use_pass_emit = layer.use_pass_environment = True
    layer.cycles.use_pass_volume_direct = layer.cycles.use_pass_volume_indirect = True
    if len(layer.lightgroups):
        return
    for name in ("scene", "lamp"):
        layer.lightgroups.add(name=name)
    for item in scene.objects:
        item.lightgroup = "scene"
    if scene.world is not None:
        scene.world.lightgroup = "scene"
    _lamp(scene).lightgroup = "lamp"


def _lamp(scene: Any) -> Any:
    """A lamp at the camera that lights what is in the middle of the picture."""
    import bpy
    from mathutils import Vector

    view = scene.camera.matrix_world
    graph = bpy.context.evaluated_depsgraph_get()
    towards = view.to_3x3() @ Vector((0.0, 0.0, -1.0))
    hit, place, *_ = scene.ray_cast(graph, view.translation, towards)
    distance = (place - view.translation).length if hit else 10.0
    lamp = bpy.data.lights.new("lamp", "POINT")
    brightness = _BRIGHTNESS * 2.0**-scene.view_settings.exposure
    # a white surface at a distance d has the radiance energy / (4 pi^2 d^2)
    lamp.energy = brightness * 4.0 * np.pi**2 * distance**2
    lamp.shadow_soft_size = 0.02 * distance
    item = bpy.data.objects.new("lamp", lamp)
    beside = view.to_3x3() @ Vector((0.3, 0.2, 0.0)).normalized()
    item.location = view.translation + beside * (0.2 * distance)
    scene.collection.objects.link(item)
    return item


def _judged(name: str, samples: int, made: _Rendered) -> list[Row]:
    """A row for each part of the middle frame, and one for each sum."""
    stored = {n: store(frame) for n, frame in made.frames.items()}
    own = stored.pop(MIDDLE)
    lenders = sorted(stored.values(), key=lambda x: abs(x.number - MIDDLE))
    denoiser, alone = Denoiser("high", "cpu"), accumulate(own, [])
    found: dict[str, Mapping[str, Array]] = {RAW: alone.parts}
    seconds, pictures = {RAW: 0.0}, {}
    started = time.perf_counter()
    clean = denoiser.guides(alone.albedo, alone.normal)
    found[ONE_BY_ONE] = {
        part.name: denoiser(
            alone.parts[part.name], *clean, guides_are_clean=True
        ).radiance
        for part in made.parts
    }
    seconds[ONE_BY_ONE] = time.perf_counter() - started
    for method, others in ((STILL, []), (SHOT, lenders)):
        started = time.perf_counter()
        finished = finish_frame(own, others, denoiser, Movement(), light=made.parts)
        seconds[method] = time.perf_counter() - started
        found[method] = finished.parts
        pictures[method] = finished.picture[..., :3]
    rows = []
    for part in made.parts:
        truth = [reference.parts[part.name] for reference in made.references]
        if not any(x.any() for x in truth):
            continue
        rows.append(
            {"scene": name, "samples": samples, "sum": part.sum, "part": part.name}
            | {
                method: round(_psnr(found[method][part.name], truth, made.stops), 3)
                for method in METHODS
            }
        )
    return (
        rows
        + [
            {
                "scene": name,
                "samples": samples,
                "sum": kind,
                "part": "deviation of the sum",
            }
            | {
                method: _deviation(found[method], made.parts, kind, pictures[method])
                for method in (STILL, SHOT)
            }
            for kind in dict.fromkeys(part.sum for part in made.parts if part.sum)
        ]
        + [
            {"scene": name, "samples": samples, "sum": "", "part": "seconds"}
            | {method: round(x, 3) for method, x in seconds.items()}
        ]
    )


def _psnr(light: Array, truth: Sequence[Array], stops: float) -> float:
    """In dB, without the noise of two references."""
    shown, *references = (
        metrics.to_srgb(np.maximum(x, 0.0), stops) for x in (light, *truth)
    )
    one, two = (shown - reference for reference in references)
    return float(-10.0 * np.log10(max(float((one * two).mean()), _TINY)))


def _deviation(
    light: Mapping[str, Array], parts: Sequence[LightPart], kind: str, picture: Array
) -> float:
    """Of the sum from the picture, relative to its mean."""
    whole = sum(light[part.name] for part in parts if part.sum == kind)
    apart = float(np.abs(whole - picture).mean())
    return float(f"{apart / max(float(picture.mean()), _TINY):.3g}")


def _write(rows: Sequence[Row], journal: Journal, out: Path) -> dict[str, Any]:
    results = {
        "machine": machine.describe(),
        "parts": list(rows),
        "failures": journal.failures,
    }
    write_json(out / "results.json", results)
    write_table(out / "results.csv", rows)
    return results
