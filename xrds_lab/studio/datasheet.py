"""Contents of a training set: counts, bytes, render seconds, a contact sheet."""

from __future__ import annotations

import json
import math
import statistics
import zipfile
import zlib
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from xrds_core.errors import PictureError, UsageError
from xrds_core.files import replacing

from ..metrics import to_srgb

COLUMNS, SIDE, MOST = 12, 128, 96  # of the sheet: cells a row, their pixels, cells
QUALITY = 85  # of the JPEG


@dataclass(frozen=True)
class File:
    """One window's file and its metadata."""

    path: Path
    meta: dict[str, Any]


def files(folder: Path) -> list[File]:
    """All windows of a set, in the order of their names.

    Raises PictureError for a damaged one.
    """
    return [File(path, _meta(path)) for path in sorted(folder.glob("*/*.npz"))]


def _meta(path: Path) -> dict[str, Any]:
    try:
        with np.load(path, allow_pickle=False) as file:
            return dict(json.loads(str(file["meta"])))
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error):
        raise PictureError(
            f"{path} is no whole training window: delete it, and its scene's line in "
            "scenes.jsonl to render it again"
        ) from None


def datasheet(windows: list[File]) -> dict[str, Any]:
    """Windows by split and kind, scenes, assets, bytes and CPU seconds of a window."""
    stages = Counter[str]()
    for file in windows:
        for name, seconds in file.meta["seconds"].items():
            if name.endswith("_cpu"):
                stages[name.removesuffix("_cpu")] += seconds
    return {
        "windows": dict(Counter(file.path.parent.name for file in windows)),
        "kinds": dict(Counter(file.meta["kind"] for file in windows)),
        "scenes": len({file.meta["seed"] for file in windows}),
        "assets": len({name for file in windows for name in file.meta["assets"]}),
        "mean_bytes": statistics.fmean(f.path.stat().st_size for f in windows)
        if windows
        else 0.0,
        "mean_cpu_seconds": {name: s / len(windows) for name, s in stages.items()},
    }


def contact_sheet(windows: list[File], path: Path) -> None:
    """Write a JPEG of the references, one window a scene, drawn evenly if many.

    Raises UsageError where there is no window.
    """
    from PIL import Image

    scenes = list({file.meta["seed"]: file for file in windows}.values())
    if not scenes:
        raise UsageError(f"no window to show in {path.name}: render some first")
    shown = scenes[:: math.ceil(len(scenes) / MOST)]
    rows = math.ceil(len(shown) / COLUMNS)
    sheet = Image.new("RGB", (COLUMNS * SIDE, rows * SIDE))
    for i, file in enumerate(shown):
        with np.load(file.path, allow_pickle=False) as arrays:
            reference = arrays["reference"].astype(np.float32)
        pixels = to_srgb(reference, math.log2(file.meta["exposure"]))
        cell = Image.fromarray(np.round(pixels * 255).astype(np.uint8))
        row, column = divmod(i, COLUMNS)
        sheet.paste(
            cell.resize((SIDE, SIDE), Image.Resampling.BOX), (column * SIDE, row * SIDE)
        )
    with replacing(path) as part:
        sheet.save(part, "JPEG", quality=QUALITY)


def lines(sheet: dict[str, Any]) -> list[str]:
    """The datasheet as lines of text."""
    stages = ", ".join(f"{k} {s:.1f}" for k, s in sheet["mean_cpu_seconds"].items())
    return [
        f"windows: {_counts(sheet['windows'])}; {_counts(sheet['kinds'])}",
        f"{sheet['scenes']} scenes, {sheet['assets']} files of assets",
        f"a window: {sheet['mean_bytes'] / 1e6:.2f} MB; "
        f"CPU seconds: {stages or 'none'}",
    ]


def _counts(counts: dict[str, int]) -> str:
    return ", ".join(f"{count} {name}" for name, count in counts.items()) or "none"
