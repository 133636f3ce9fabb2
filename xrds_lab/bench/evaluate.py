"""`xrds evaluate`: the standard measure, the product beside every rival.

Error on windows of real scenes against their references, seconds of whole frames.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import sys
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, Any

from xrds_blender.planning.settings import Network
from xrds_core.errors import UsageError
from xrds_core.files import write_json

from .. import metrics
from ..progress import silent
from . import table
from .inputs import GENERATION, kept
from .journal import Strict
from .pictures import Networks, Pictures
from .rivals import ENLARGEMENTS
from .sheets import Sheet
from .stages import ROUNDS, StageTimes, Stopwatch
from .sweep import Config, anchors
from .tasks import tasks
from .windows import find_shots

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from ..progress import Progress
    from .windows import Shot

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
    timing: bool = False,
    timing_scenes: Sequence[str] | None = None,
    timing_rounds: int = ROUNDS,
    out: Path | None = None,
    sheets: Path | None = None,
    weights: Path | None = None,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Measure the product and its rivals on scene files; returns the JSON's content.

    `windows` is a windows file, `references` a folder of NAME.exr, `cache` a folder
    for rendered inputs: with it, new weights cost no rendering. `timing` adds whole
    frames' seconds and OIDN at equal time, for the scenes named in `timing_scenes` or
    for all. Presets without weights stand in the table without the product. `progress`
    gets lines of text. The table is printed on stderr; `out` gets results.json,
    `sheets` a JPEG of enlarged crops for each scene.
    Raises UsageError for missing files and unknown names.
    """
    networks = Networks(weights, "auto")
    rows = {
        network: _configurations(network, networks, samples, guide_samples, progress)
        for network in (
            Network(preset, scale) for scale, preset in product(scales, presets)
        )
    }
    shots = find_shots(scenes, windows, references)
    timed = _timed(shots, timing, timing_scenes)
    records: list[Record] = []
    with kept(cache) as folder:
        for shot in shots:
            rounds = timing_rounds if shot.name in timed else 0
            scene = _Scene(Pictures(shot, folder, networks), rows, rounds, progress)
            records += scene.records()
            if sheets is not None:
                scene.sheet.write(sheets / f"{shot.name}.jpg")
    report = {
        "settings": {
            "scales": list(scales),
            "presets": list(presets),
            "samples": samples,
            "guide_samples": guide_samples,
            "device": networks.device,
            "timing": timing,
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


def _timed(
    shots: Sequence[Shot], timing: bool, names: Sequence[str] | None
) -> set[str]:
    """Names of the scenes whose frames are timed."""
    known = {shot.name for shot in shots}
    absent = set(names or ()) - known
    if absent:
        raise UsageError(
            f"cannot time {', '.join(sorted(absent))}: not among the scenes"
        )
    return (known if names is None else set(names)) if timing else set()


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


class _Scene:
    """One scene's part of the table."""

    def __init__(
        self,
        pictures: Pictures,
        rows: dict[Network, Configs],
        rounds: int,
        progress: Progress,
    ) -> None:
        self.pictures, self.rows, self.progress = pictures, rows, progress
        self.sheet = Sheet()
        self._configs = [c for configs in rows.values() for c in configs.values()]
        pictures.render_missing(self._configs, progress)
        self.times = self._measured_times(rounds) if rounds else None

    def records(self) -> list[Record]:
        """Entries of `scenes`; their pictures go into the sheet."""
        records = []
        for network, configs in self.rows.items():
            records.append(self._record(network, dict(configs)))
            self.progress(table.line(records[-1]))
        return records

    def _record(self, network: Network, configs: Configs) -> Record:
        if self.times is not None and "xrds" in configs:
            configs["oidn_equal_time"] = _equal_time(self.times, configs)
            self.pictures.render_missing([configs["oidn_equal_time"]], self.progress)
        stages = {} if self.times is None else _seconds(self.times, configs)
        made = {name: self.pictures.picture(c) for name, c in configs.items()}
        shot, reference = self.pictures.shot, self.pictures.reference()
        stops = self.pictures.exposure(configs["bicubic"])
        self.sheet.add(f"{shot.name} {table.case(network)}", made, reference, stops)
        methods = {
            name: metrics.all_metrics(picture, reference, stops)
            | {"seconds": stages.get(name, {}).get("total")}
            for name, picture in made.items()
        }
        record: Record = {
            "scene": shot.name,
            "scale": network.scale,
            "preset": network.preset,
            "methods": methods,
            "gain": table.gain(methods),
            "reference_psnr_floor": shot.window.floor_psnr,
        }
        return record | ({} if self.times is None else {"frame_seconds": stages})

    def _measured_times(self, rounds: int) -> StageTimes:
        """Seconds of the stages of whole frames; runs in the folder are not repeated.

        They are kept for each machine and size of the networks: weights alone do not
        change them.
        """
        shot, networks = self.pictures.shot, self.pictures.networks
        sizes = [
            networks[network].network.config.to_dict()
            for network in self.rows
            if network in networks.records
        ]
        digest = hashlib.sha256(json.dumps(sizes, sort_keys=True).encode()).hexdigest()
        machine = f"{platform.machine()}-{os.cpu_count()}cpu"
        version = f"v{GENERATION}-blender{_blender_version().replace(' ', '')}"
        name = f"{shot.identity}-seconds-{machine}-{version}-{digest[:8]}.json"
        times = StageTimes(self.pictures.folder.directory / name)
        timed = tasks(shot, self._configs, networks)
        watch = Stopwatch(shot, times, anchors(self._configs), timed, Strict())
        watch.measure(rounds, lambda n: self.progress(f"{shot.name}: timed {n}"))
        return times


def _equal_time(times: StageTimes, configs: Configs) -> Config:
    """OIDN with as many samples as it takes in the product's time."""
    plain = configs["oidn_equal_spp"]
    left = times.cost(configs["xrds"]).total - times.cost(plain).total
    samples = plain.samples + round(left / times.line("plain")[1])
    return replace(plain, samples=max(1, samples))


def _seconds(times: StageTimes, configs: Configs) -> dict[str, dict[str, float]]:
    """Seconds of a whole frame by method, the product's by stage."""
    seconds: dict[str, dict[str, float]] = {}
    for name, config in configs.items():
        cost = times.cost(config)
        seconds[name] = {"total": cost.total}
        if config.method == "oidn":
            seconds[name]["samples"] = config.samples
        if config.method == "xrds":
            stages = {k: s for k, s in cost.seconds.items() if k != "other"}
            seconds[name] = stages | {"cpu": cost.cpu_seconds}
    return seconds


def _blender_version() -> str:
    import bpy

    return str(bpy.app.version_string)
