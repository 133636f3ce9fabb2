"""`xrds evaluate --table samples`: how error falls with samples, beside OIDN.

Low-resolution renders of s * s * n samples cast as many rays as full-resolution ones of
n, guides not counted in; seconds are of the window's renders and network, without the
scene's sync.
"""

from __future__ import annotations

import json
import statistics
import sys
import time
from dataclasses import asdict
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from xrds_blender.planning.settings import DEFAULT_DENOISING, Denoising, Network
from xrds_core.files import write_json

from ..progress import silent
from .inputs import kept
from .pictures import Networks, Pictures
from .sweep import Config, xrds
from .windows import find_shots

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from ..progress import Progress
    from .inputs import Folder

    Record = dict[str, Any]

RATES = (1, 2, 4, 8)
"""Full-resolution samples n of OIDN, and n * scale * scale of the low resolution."""
LOW_SAMPLES = (4, 16, 64)
GUIDE_SAMPLES = 4
OIDN = {"default": DEFAULT_DENOISING, "fast": Denoising.FAST_FAST}


def samples_table(
    scenes: Sequence[Path],
    *,
    windows: Path,
    references: Path,
    cache: Path | None = None,
    scale: int = 2,
    preset: str = "fast",
    out: Path | None = None,
    weights: Path | None = None,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Measure scene files over their samples; returns the JSON's content.

    Arguments as of `evaluate`; `out` gets samples.json, stderr the table. Raises
    UsageError for missing files.
    """
    shots = find_shots(scenes, windows, references)
    networks = Networks(weights, "auto")
    configs = list(configurations(scale, preset))
    records: list[Record] = []
    with kept(cache) as folder:
        for shot in shots:
            records += _measured(Pictures(shot, folder, networks), configs, progress)
    report = {"scale": scale, "preset": preset, "records": records}
    report |= {"summary": summary(records)}
    print(text(report), file=sys.stderr)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        write_json(out / "samples.json", report)
    return report


def configurations(scale: int, preset: str) -> Iterator[Config]:
    """Every configuration of the table, each once."""
    low = sorted({*LOW_SAMPLES, *(n * scale**2 for n in RATES)})
    for n in low:
        yield xrds(Network(preset, scale), n, DEFAULT_DENOISING, GUIDE_SAMPLES)
    for n in RATES:
        for denoiser in OIDN.values():
            yield Config("oidn", n, denoiser)


def _measured(
    pictures: Pictures, configs: list[Config], progress: Progress
) -> list[Record]:
    """One record per configuration."""
    folder, shot = pictures.folder, pictures.shot
    pictures.render_missing(configs, progress)
    records = []
    for config in configs:
        errors = pictures.errors(config)
        start = time.perf_counter()
        pictures.picture(config)  # its inputs are read, its network loaded
        seconds = time.perf_counter() - start if config.method == "xrds" else 0.0
        files = [request.file_name(shot) for request in config.requests()]
        seconds += sum(_render_seconds(folder, name) for name in files)
        records.append(
            asdict(config) | {"scene": shot.name, "seconds": seconds, **errors}
        )
        figures = f"{errors['psnr']:.2f} dB, {seconds:.1f} s"
        progress(f"{shot.name}: {config.label}: {figures}")
    pictures.save()
    return records


def _render_seconds(folder: Folder, name: str) -> float:
    """Seconds of a kept render, without sync."""
    arrays = folder.read(name)
    assert arrays is not None
    stages = json.loads(str(arrays["seconds"]))
    return float(sum(seconds for stage, seconds in stages.items() if stage != "sync"))


def summary(records: list[Record]) -> dict[str, Any]:
    """The table's figures, by scene and on the mean.

    `over_oidn`: dB over OIDN of n samples, and of its seconds the product's share;
    `more_samples`: PSNR over LOW_SAMPLES.
    """
    by_scene: dict[str, dict[tuple[Any, ...], Record]] = {}
    for record in records:
        key: tuple[Any, ...] = (record["method"], record["samples"])
        key += (record["denoiser"],) if record["method"] == "oidn" else ()
        by_scene.setdefault(record["scene"], {})[key] = record
    area = max(record["scale"] for record in records) ** 2
    return {
        "over_oidn": {
            mode: {
                str(n): _against(by_scene, ("xrds", area * n), ("oidn", n, oidn))
                for n in RATES
            }
            for mode, oidn in OIDN.items()
        },
        "more_samples": {
            scene: [by_key["xrds", n]["psnr"] for n in LOW_SAMPLES]
            for scene, by_key in by_scene.items()
        },
    }


def _against(
    by_scene: dict[str, dict[tuple[Any, ...], Record]],
    ours: tuple[Any, ...],
    theirs: tuple[Any, ...],
) -> dict[str, Any]:
    """Gain in dB and share of seconds over the rival: by scene, and the means."""
    gains, shares = {}, {}
    for scene, by_key in by_scene.items():
        gains[scene] = by_key[ours]["psnr"] - by_key[theirs]["psnr"]
        shares[scene] = by_key[ours]["seconds"] / by_key[theirs]["seconds"]
    return {
        "gain": gains,
        "seconds": shares,
        "mean_gain": statistics.fmean(gains.values()),
        "median_seconds": statistics.median(shares.values()),
    }


def text(report: dict[str, Any]) -> str:
    """The summary as text."""
    answers, scale = report["summary"], report["scale"]
    name = f"XRDS {report['preset']} x{scale}"
    title = f"{name}, {scale**2} n spp + {GUIDE_SAMPLES}"
    growth = "\n".join(_growth(name, answers["more_samples"]))
    return f"{_block(title, answers['over_oidn'])}\n\n{growth}"


def _block(title: str, by_mode: dict[str, dict[str, Any]]) -> str:
    columns = [(m, n, cell) for m, row in by_mode.items() for n, cell in row.items()]
    lines = [
        f"{title}: dB over OIDN of n spp (seconds, of OIDN's)",
        _row("", [f"{mode} {n}" for mode, n, _ in columns]),
    ]
    for scene in columns[0][2]["gain"]:
        cells = [
            f"{cell['gain'][scene]:+.2f} ({cell['seconds'][scene]:.2f})"
            for *_, cell in columns
        ]
        lines.append(_row(scene, cells))
    means = [f"{f['mean_gain']:+.2f} ({f['median_seconds']:.2f})" for *_, f in columns]
    return "\n".join([*lines, _row("mean (median)", means)])


def _growth(name: str, by_scene: dict[str, list[float]]) -> Iterator[str]:
    yield f"{name}: PSNR by low-resolution samples, worst step"
    yield _row("", [f"{n} spp" for n in LOW_SAMPLES])
    for scene, values in by_scene.items():
        worst = min(after - before for before, after in pairwise(values))
        yield _row(scene, [*(f"{value:.2f}" for value in values), f"{worst:+.2f}"])


def _row(title: str, cells: list[str]) -> str:
    return (f"{title:<14}" + "".join(f"{cell:>14}" for cell in cells)).rstrip()
