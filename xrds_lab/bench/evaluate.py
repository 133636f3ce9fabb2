"""`xrds evaluate`: the standard measure, the product beside every rival.

Error on windows of real scenes against their references.
"""

from __future__ import annotations

import os
import sys
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, Any

from xrds_blender.planning.settings import Network
from xrds_core.files import write_json

from .. import metrics
from ..progress import silent
from . import table
from .inputs import kept
from .pictures import Networks, Pictures
from .rivals import ENLARGEMENTS
from .sweep import Config
from .windows import find_shots

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from ..progress import Progress

    Configs = dict[str, Config]
    Record = dict[str, Any]


def evaluate(
    scenes: Sequence[Path],
    *,
    windows: Path,
    references: Path,
    cache: Path | None = None,
    scales: Sequence[int] = (2, 4),
    presets: Sequence[str] = ("fast",),
    samples: int = 16,
    guide_samples: int = 4,
    out: Path | None = None,
    weights: Path | None = None,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Measure the product and its rivals on scene files; returns the JSON's content.

    `windows` is a windows file, `references` a folder of NAME.exr, `cache` a folder
    for rendered inputs: with it, new weights cost no rendering. Presets without weights
    stand in the table without the product. `progress` gets lines of text. The table is
    printed on stderr; `out` gets results.json. Raises UsageError for missing files.
    """
    networks = Networks(weights, "auto")
    rows = {
        network: _configurations(network, networks, samples, guide_samples, progress)
        for network in (
            Network(preset, scale) for scale, preset in product(scales, presets)
        )
    }
    shots = find_shots(scenes, windows, references)
    records: list[Record] = []
    with kept(cache) as folder:
        for shot in shots:
            records += _records(Pictures(shot, folder, networks), rows, progress)
    report = {
        "settings": {
            "scales": list(scales),
            "presets": list(presets),
            "samples": samples,
            "guide_samples": guide_samples,
            "device": networks.device,
            "blender": _blender_version(),
            "cpu_count": os.cpu_count(),
        },
        "scenes": records,
        "mean": table.means(records),
        "worst": table.worst(records),
    }
    print(table.text(report), file=sys.stderr)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        write_json(out / "results.json", report)
    return report


def _configurations(
    network: Network,
    networks: Networks,
    samples: int,
    guide_samples: int,
    progress: Progress,
) -> Configs:
    """One block of the table by method: the product first, if there are weights."""
    preset, scale = network
    xrds = Config("xrds", samples, None, scale, preset, guide_samples)
    configs = {"xrds": xrds}
    configs |= {name: replace(xrds, method=name, preset="") for name in ENLARGEMENTS}
    configs["bicubic"] = Config("bicubic", samples, None, scale)
    equal_rays = max(1, round(samples / scale**2 + guide_samples))
    configs["oidn_equal_spp"] = Config("oidn", equal_rays, None)
    if network not in networks.records:
        progress(f"{table.case(network)} has no weights yet: rivals alone")
        del configs["xrds"]
    return configs


def _records(
    pictures: Pictures, rows: dict[Network, Configs], progress: Progress
) -> list[Record]:
    """One scene's entries of `scenes`."""
    needed = [config for configs in rows.values() for config in configs.values()]
    pictures.render_missing(needed, progress)
    records = []
    for network, configs in rows.items():
        records.append(_record(pictures, network, configs))
        progress(table.line(records[-1]))
    return records


def _record(pictures: Pictures, network: Network, configs: Configs) -> Record:
    shot, reference = pictures.shot, pictures.reference()
    stops = pictures.exposure(configs["bicubic"])
    methods = {
        name: metrics.all_metrics(pictures.picture(config), reference, stops)
        for name, config in configs.items()
    }
    return {
        "scene": shot.name,
        "scale": network.scale,
        "preset": network.preset,
        "methods": methods,
        "gain": table.gain(methods),
        "reference_psnr_floor": shot.window.floor_psnr,
    }


def _blender_version() -> str:
    import bpy

    return str(bpy.app.version_string)
