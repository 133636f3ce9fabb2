"""`xrds evaluate`: the standard measure, the product beside every rival.

Error on windows of real scenes against their references, seconds of whole frames.
"""

from __future__ import annotations

import os
import sys
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from xrds_core import exr, metrics
from xrds_core.atomic import write_json
from xrds_core.errors import UsageError

from . import table
from .contenders import Contenders, Settings
from .frames import FrameSeconds
from .inputs import Folder, silent
from .sheets import Sheet
from .timing import ROUNDS
from .windows import find_shots

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from .contenders import Case
    from .inputs import Say
    from .windows import Shot


def evaluate(
    scenes: Sequence[Path],
    *,
    windows: Path,
    references: Path,
    cache: Path | None = None,
    scales: Sequence[int] = (2, 4),
    presets: Sequence[str] = ("fast",),
    guides: Sequence[str] = ("fast",),
    timing: bool = False,
    out: Path | None = None,
    sheets: Path | None = None,
    weights: Path | None = None,
    progress: Say | None = None,
    timing_scenes: Sequence[str] | None = None,
    timing_rounds: int = ROUNDS,
    **settings: Any,
) -> dict[str, Any]:
    """Measure the product and its rivals on scene files; returns the JSON's content.

    ``windows`` is a windows file, ``references`` a folder of NAME.exr, ``cache`` a
    folder for rendered inputs: with it, new weights cost no rendering. ``timing``
    adds whole frames' seconds and OIDN at equal time, for the scenes named in
    ``timing_scenes`` or for all. Presets without weights stand in the table without
    the product. ``progress`` is given lines of text; ``settings`` are further fields
    of Settings. The table is printed on stderr; ``out`` gets results.json, ``sheets``
    a JPEG of enlarged crops for each scene.
    Raises UsageError for missing files and unknown names.
    """
    chosen = Settings(tuple(scales), tuple(presets), tuple(guides), **settings)
    contenders = Contenders(chosen, Folder(cache), weights, progress or silent)
    records: list[dict[str, Any]] = []
    shots = find_shots(scenes, windows, references)
    absent = set(timing_scenes or ()) - {shot.name for shot in shots}
    if absent:
        raise UsageError(f"{sorted(absent)} cannot be timed: not among the scenes")
    for shot in shots:
        timed = timing and (timing_scenes is None or shot.name in timing_scenes)
        frame = FrameSeconds(shot, contenders, timing_rounds) if timed else None
        sheet = Sheet()
        for case in chosen.cases:
            records.append(_record(shot, case, contenders, frame, sheet))
            contenders.say(table.line(records[-1]))
        if sheets is not None:
            sheet.write(sheets / f"{shot.name}.jpg")
    report = {
        "settings": _settings(chosen, timing),
        "scenes": records,
        "mean": table.means(records),
        "worst": table.worst(records),
    }
    print(table.text(report), file=sys.stderr)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        write_json(out / "results.json", report)
    return report


def _record(
    shot: Shot,
    case: Case,
    contenders: Contenders,
    frame: FrameSeconds | None,
    sheet: Sheet,
) -> dict[str, Any]:
    """One entry of ``scenes``; its pictures go into the sheet."""
    record = {
        "scene": shot.name,
        "scale": case.scale,
        "preset": case.preset,
        "guides": case.guides,
    }
    pictures, stops = contenders.pictures(shot, case)
    stages = {} if frame is None else frame.methods(case)
    if frame is not None and "xrds" in pictures:
        samples = frame.equal_time_samples(case)
        pictures["oidn_equal_time"] = contenders.plain(shot, samples)
        stages["oidn_equal_time"] = frame.plain(samples)
    reference = exr.read_beauty(shot.reference).radiance[..., :3]
    sheet.add(f"{shot.name} x{case.scale} {case.label}", pictures, reference, stops)
    methods = {
        name: metrics.all_metrics(picture, reference, stops)
        | {"seconds": stages.get(name, {}).get("total")}
        for name, picture in pictures.items()
    }
    record |= {"methods": methods, "gain": table.gain(methods)}
    record |= {"reference_psnr_floor": shot.window.floor_psnr}
    return record | ({} if frame is None else {"frame_seconds": stages})


def _settings(chosen: Settings, timing: bool) -> dict[str, Any]:
    import bpy

    fields = {
        key: list(value) if isinstance(value, tuple) else value
        for key, value in asdict(chosen).items()
    }
    return fields | {
        "timing": timing,
        "blender": bpy.app.version_string,
        "cpu_count": os.cpu_count(),
    }
