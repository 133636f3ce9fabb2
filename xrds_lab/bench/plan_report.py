"""`xrds plan-report`: what every saving is worth, and what it does to the picture.

Each run is a process of its own, timed from outside. Runs with and without take turns,
so that a busy machine slows both.
"""

from __future__ import annotations

import json
import statistics
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from xrds_blender.planning.plan import GUIDE_CACHE, SAVINGS
from xrds_core.children import run_python
from xrds_core.errors import SceneError, UsageError, XRDSError
from xrds_core.files import check_input, check_output, read_json, replacing, write_json

from .. import metrics

if TYPE_CHECKING:
    from collections.abc import Sequence

    from xrds_core.arrays import Array

    from ..progress import Progress

# Stages of a render; loading Python, Blender and torch is in the wall time alone.
OVERHEAD = ("sync", "denoise", "guides", "network", "write")
# Seeds of the pair whose difference is the noise of the settings.
SEEDS = (1, 101)


@dataclass(frozen=True)
class Setting:
    """The settings that all runs of a report share."""

    scale: int = 2
    samples: int = 16
    guide_samples: int = 4
    width: int = 960
    height: int = 540
    rounds: int = 1


@dataclass
class Run:
    """One process: wall seconds, and the record of each of its frames."""

    wall: float
    frames: list[dict[str, Any]] = field(default_factory=list)
    pictures: list[Array] = field(default_factory=list)

    @property
    def overhead(self) -> float:
        """Seconds of all stages but the low-resolution render."""
        return sum(self.stage(name) for name in OVERHEAD)

    def stage(self, name: str) -> float:
        """Seconds of one stage over all frames."""
        return sum(frame["seconds"][name] for frame in self.frames)


def run(
    scene: str, kind: str, setting: Setting, savings: Sequence[str], seed: int
) -> Run:
    """Render in a process of its own; `kind` is still, animation or look-dev."""
    with tempfile.TemporaryDirectory() as folder:
        request = {
            "scene": scene,
            "kind": kind,
            "setting": vars(setting),
            "savings": list(savings),
            "seed": seed,
            "out": folder,
        }
        start = time.perf_counter()
        done = run_python("-m", f"{__package__}.plan_run", json.dumps(request))
        wall = time.perf_counter() - start
        answer = Path(folder) / "frames.json"
        if done.returncode or not answer.is_file():
            reason = (done.stderr.strip().splitlines() or ["it was killed"])[-1]
            raise XRDSError(f"{scene} {kind} failed: {reason}")
        frames = json.loads(answer.read_text("utf-8"))
        pictures = [np.load(Path(folder) / f"{i}.npy") for i in range(len(frames))]
    return Run(wall, frames, pictures)


def measure(
    scene: str, kind: str, setting: Setting, progress: Progress
) -> dict[str, Any]:
    """Pairs of runs with and without the plan: one record of the report."""
    kept: list[Run] = []
    planned: list[Run] = []
    for turn in range(setting.rounds):
        kept.append(run(scene, kind, setting, (), SEEDS[0]))
        planned.append(run(scene, kind, setting, SAVINGS, SEEDS[0]))
        progress(
            f"{scene} {kind} {turn + 1}: overhead {kept[-1].overhead:.2f} s with all, "
            f"{planned[-1].overhead:.2f} s with the plan"
        )
    other = run(scene, kind, setting, (), SEEDS[1])
    record = {"scene": Path(scene).stem, "kind": kind} | _seconds(kept, planned)
    last = kept[0].pictures[-1]
    record |= _difference("plan", planned[0].pictures[-1], last)
    record |= _difference("seed", other.pictures[-1], last)
    record["plan"] = planned[0].frames[-1]["plan"]
    return record


def _seconds(kept: list[Run], planned: list[Run]) -> dict[str, Any]:
    """Medians, and the share of overhead saved by the median pair."""
    pairs = list(zip(kept, planned, strict=True))
    shares = [1 - less.overhead / most.overhead for most, less in pairs]
    record: dict[str, Any] = {"saved_share": statistics.median(shares)}
    for name, runs in (("all", kept), ("plan", planned)):
        record[f"wall_{name}"] = statistics.median(each.wall for each in runs)
        record[f"overhead_{name}"] = statistics.median(each.overhead for each in runs)
        for stage in ("sync", "beauty", "guides", "network"):
            seconds = statistics.median(each.stage(stage) for each in runs)
            record[f"{stage}_{name}"] = seconds
    return record


def _difference(name: str, picture: Array, other: Array) -> dict[str, float]:
    same = np.array_equal(picture, other)
    return {
        f"{name}_psnr": 99.0 if same else metrics.psnr(picture, other),
        f"{name}_flip": metrics.flip(picture, other),
    }


def report(
    scenes: Sequence[str],
    kinds: Sequence[str],
    setting: Setting,
    out: Path,
    progress: Progress,
) -> dict[str, Any]:
    """Measure every scene and write `out`.json and `out`.md.

    Records already in the JSON are kept, so that a report can be made in parts.
    """
    _check_scenes(scenes)
    path = out.with_suffix(".json")
    check_output(path)
    records = _records(path)
    for kind in kinds:
        for scene in scenes:
            record = measure(scene, kind, setting, progress) | {
                "setting": vars(setting)
            }
            key = record["scene"], record["kind"]
            records = [r for r in records if (r["scene"], r["kind"]) != key]
            records.append(record)
            out.parent.mkdir(parents=True, exist_ok=True)
            write_json(path, {"records": records})
            with replacing(out.with_suffix(".md")) as part:
                part.write_text(text(records), "utf-8")
    return {"records": records}


def _records(path: Path) -> list[dict[str, Any]]:
    """Those of an earlier report; raises XRDSError if the file holds none."""
    kept = read_json(path) if path.is_file() else {"records": []}
    if not isinstance(kept, dict) or not isinstance(kept.get("records"), list):
        raise XRDSError(f"{path} is no report of the plan; name another with --out")
    return kept["records"]


def _check_scenes(scenes: Sequence[str]) -> None:
    """Raise XRDSError for a scene that is neither a file nor a small one's name."""
    from ..studio.traps import TRAPS

    for scene in scenes:
        if scene.endswith(".blend"):
            check_input(Path(scene), SceneError)
        elif scene not in TRAPS:
            raise UsageError(
                f"scene {scene!r} is neither a .blend file nor one of "
                f"{', '.join(TRAPS)}"
            )


def text(records: Sequence[dict[str, Any]]) -> str:
    """The report as Markdown."""
    lines = [
        "# What the plan saves",
        "",
        "Written by `xrds plan-report`. Every run is a process of its own; runs with",
        "all kept and with the plan take turns. *Wall* is the whole process as its",
        "caller sees it, with a tiny render first that loads Cycles, OIDN and torch.",
        "*Overhead* is what the stages take but for the low-resolution picture (its",
        "samples and denoiser): sync, guides, network, write. Plan against all, with",
        "the same seed, is to differ by less than two seeds with all kept do: PSNR",
        "above the noise's, FLIP below. 99 dB: not one bit differs.",
        "",
    ]
    for kind in dict.fromkeys(record["kind"] for record in records):
        chosen = [record for record in records if record["kind"] == kind]
        lines += [f"## {kind.capitalize()}", "", *_table(chosen), ""]
        lines += [*_by_decision(chosen), ""]
    lines += ["## Decisions", "", *_decisions(records), ""]
    return "\n".join(lines)


def _table(records: Sequence[dict[str, Any]]) -> list[str]:
    lines = [
        "| scene | wall all, plan (s) | overhead (s) | saved | guides (s) | "
        "network (s) | PSNR plan, noise | FLIP plan, noise |",
        "|---|---|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {r['scene']} | {r['wall_all']:.1f}, {r['wall_plan']:.1f} "
        f"| {r['overhead_all']:.2f}, {r['overhead_plan']:.2f} "
        f"| {r['saved_share']:.0%} "
        f"| {r['guides_all']:.2f}, {r['guides_plan']:.2f} "
        f"| {r['network_all']:.2f}, {r['network_plan']:.2f} "
        f"| {r['plan_psnr']:.1f}, {r['seed_psnr']:.1f} "
        f"| {r['plan_flip']:.4f}, {r['seed_flip']:.4f} |"
        for r in records
    ]
    mean = statistics.mean(r["saved_share"] for r in records)
    below = sum(
        r["plan_psnr"] > r["seed_psnr"] and r["plan_flip"] <= r["seed_flip"]
        for r in records
    )
    size = records[0]["setting"]
    return [
        *lines,
        "",
        f"Mean saving of overhead: {mean:.0%}. Below the noise: {below} of "
        f"{len(records)}. {size['width']}x{size['height']}, x{size['scale']}, "
        f"{size['samples']} samples, {size['guide_samples']} guide samples, "
        f"{size['rounds']} pairs.",
    ]


def _decided(record: dict[str, Any]) -> dict[str, str]:
    """Every decision's value."""
    return {each["decision"]: each["value"] for each in record["plan"]}


def _by_decision(records: Sequence[dict[str, Any]]) -> list[str]:
    """What each way of rendering guides saved of their seconds."""
    names = ("guide samples", "guide bounces", "guide lights", GUIDE_CACHE)
    groups: dict[tuple[str, ...], list[dict[str, Any]]] = {}
    for record in records:
        decisions = _decided(record)
        groups.setdefault(tuple(decisions.get(n, "") for n in names), []).append(record)
    lines = [
        f"| {' | '.join(names)} | scenes | guides' seconds saved | of the overhead |",
        "|---" * (len(names) + 3) + "|",
    ]
    for values, chosen in groups.items():
        saved, share = (
            statistics.mean(
                (r["guides_all"] - r["guides_plan"]) / r[of] for r in chosen
            )
            for of in ("guides_all", "overhead_all")
        )
        scenes = ", ".join(record["scene"] for record in chosen)
        lines.append(f"| {' | '.join(values)} | {scenes} | {saved:.0%} | {share:.0%} |")
    return lines


def _decisions(records: Sequence[dict[str, Any]]) -> list[str]:
    names = dict.fromkeys(d["decision"] for r in records for d in r["plan"])
    names = [n for n in names if n not in {"low frame", "sessions"}]
    lines = ["| scene | " + " | ".join(names) + " |", "|---" * (len(names) + 1) + "|"]
    for record in records:
        decisions = _decided(record)
        cells = [decisions.get(name, "") for name in names]
        lines.append(f"| {record['scene']}, {record['kind']} | {' | '.join(cells)} |")
    return lines
