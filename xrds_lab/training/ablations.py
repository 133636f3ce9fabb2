"""Tables of short runs that differ in one thing, as in the paper's ablations.

Every run of a table has the same windows, steps and seeds; the figures are those of the
averaged weights after the last step, on the validation windows as they were rendered.
The variants are of the paper's kind, without the base of the small presets, but for
`base` itself.
"""

from __future__ import annotations

import re
import statistics
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from xrds_core.errors import UsageError
from xrds_core.files import write_json

from ..operations import PAPER_OUTPUT, count
from .config import read_config
from .run_folder import RunFolder
from .train import train

Changes = tuple[str, ...]

NO_BASE = "network.base = false"
NO_XM = "network.cross_attention = false"
NO_LOSS = "loss = { charbonnier = 0.0, gradient = 0.0 }"
TABLES: dict[str, dict[str, Changes]] = {
    "base": {
        "pixels, as the paper": (NO_BASE,),
        "kernels over demodulated radiance": (),
    },
    "guides": {
        "none": (NO_BASE, 'hidden = "guides"'),
        "normal": (NO_BASE, 'hidden = "albedo"'),
        "albedo": (NO_BASE, 'hidden = "normal"'),
        "albedo and normal": (NO_BASE,),
    },
    "blocks": {
        "RDB": (NO_BASE, NO_XM, 'network.block = "rdb"'),
        "RSTB": (NO_BASE, NO_XM, 'network.block = "rstb"'),
        "RDST": (NO_BASE, NO_XM),
        "RDST and XM": (NO_BASE,),
    },
    "depth": {
        "one XDG of one RDST": (NO_BASE,),
        "one XDG of two": (NO_BASE, "network.blocks = 2"),
        "two XDGs of one": (NO_BASE, "network.groups = 2"),
    },
    "rival": {
        "SwinIR's blocks without guides": (
            NO_BASE,
            NO_XM,
            'network.block = "rstb"',
            'hidden = "guides"',
        ),
        "XRDS, albedo and normal": (NO_BASE,),
    },
    "loss": {
        "Charbonnier and gradient": (),
        "Charbonnier": ("loss.gradient = 0.0",),
        "robust": (NO_LOSS, "loss.robust = 1.0"),
        "SMAPE": (NO_LOSS, "loss.smape = 1.0"),
        "L1": (NO_LOSS, "loss.l1 = 1.0"),
    },
    "input": {
        "denoised": ("variation.noisy = 0.0", "variation.denoised_only = 1.0"),
        "noisy": ("variation.noisy = 1.0",),
        "both": ("variation.noisy = 0.0", "variation.denoised_only = 0.0"),
    },
    "variation": {
        "as configured": (),
        "nothing lit anew": ("variation.shaded = 0.0",),
        "no tints": ("variation.tint_stops = 0.0",),
        "no symmetries": ("variation.symmetries = false",),
    },
}


def ablate(
    config: Path,
    table: str,
    out: Path,
    *,
    seeds: int = 3,
    changes: Sequence[str] = (),
) -> dict[str, Any]:
    """Train every variant of a table and write OUT/TABLE.json, which is returned.

    `changes` are those of `read_config`, for all runs. Runs lie in OUT/runs, named by
    what they change, so that tables share them; they go on where they were interrupted,
    and those that are done are only read.

    Raises:
        UsageError: there is no such table, or the configuration is wrong.
        Cancelled: the user wishes to stop.
    """
    if table not in TABLES:
        raise UsageError(f"there is no table {table!r}; there are {', '.join(TABLES)}")
    rows = {
        name: _row(config, out / "runs" / _run_name(own), (*changes, *own), seeds)
        for name, own in TABLES[table].items()
    }
    common = read_config(config, changes)
    result = {"table": table, "scale": common.scale, "steps": common.steps}
    result |= {"seeds": seeds, "rows": rows}
    write_json(out / f"{table}.json", result)
    return result


def _run_name(changes: Changes) -> str:
    return re.sub(r"[^a-z\d.]+", "_", " ".join(changes)).strip("_") or "unchanged"


def _row(config: Path, run: Path, changes: Sequence[str], seeds: int) -> dict[str, Any]:
    """One variant: its size, and PSNR (dB) by seed with mean and spread."""
    psnrs: list[float] = []
    for seed in range(seeds):
        chosen = read_config(config, (*changes, f"seed = {seed}"))
        folder = run.with_name(f"{run.name}_seed_{seed}")
        train(chosen, folder)
        psnrs.append(RunFolder(folder).records()[-1]["psnr"]["rendered"]["xrds"])
    operations = count(chosen.network_config)
    return {
        "parameters": operations.parameters,
        "macs_per_pixel": operations.macs / PAPER_OUTPUT**2,
        "psnr": psnrs,
        "mean": statistics.fmean(psnrs),
        "spread": max(psnrs) - min(psnrs),
    }


def lines(result: dict[str, Any]) -> list[str]:
    """The table and its path, as lines of text."""
    head = f"x{result['scale']}, {result['steps']} steps, {result['seeds']} seeds"
    figures = "dB of validation, spread, parameters, MACs a pixel"
    rows = [f"{result['table']}: {head}; {figures}"]
    for name, row in result["rows"].items():
        figures = f"{row['mean']:6.2f} {row['spread']:5.2f} {row['parameters']:9}"
        rows.append(f"  {name:<34}{figures} {row['macs_per_pixel']:9.0f}")
    return rows
