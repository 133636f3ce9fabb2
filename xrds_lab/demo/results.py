"""What the demo leaves: figures, pictures, crops side by side and a film."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from xrds_blender.command.picture_file import save
from xrds_core.files import write_json

from .. import metrics
from ..bench import machine
from . import comparison
from .contest import PAIR
from .scene import MIDDLE, SHOT

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from .comparison import Column
    from .contest import Entry, Reference

    Row = dict[str, Any]

PICTURES = ("comparison.png", "shot.webp", "ways.png")


@dataclass(frozen=True)
class Outcome:
    """All that was rendered: two shots, Cycles' quicker mode, stills, references."""

    rival: Entry
    quick: Entry
    shot: Entry
    stills: tuple[Entry, ...]
    reference: Reference

    @property
    def entries(self) -> tuple[Entry, ...]:
        """What is measured."""
        return self.rival, self.quick, *self.stills, self.shot


def write(out: Path, scene: Any, outcome: Outcome) -> list[Row]:
    """Write everything into the folder `out`; returns the rows of results.json."""
    rows = [_row(entry, outcome.reference) for entry in outcome.entries]
    for entry in (*outcome.entries, outcome.reference.picture):
        picture = entry.frames[MIDDLE]
        opaque = np.ones(picture.shape[:2], np.float32)
        for suffix in (".exr", ".png"):
            save(out / f"{entry.way.name}{suffix}", picture, opaque, scene)
    _write_comparisons(out, outcome, rows)
    settings = {
        "resolution": [scene.render.resolution_x, scene.render.resolution_y],
        "frames": len(SHOT),
        "reference_samples": outcome.reference.picture.samples,
    }
    report = {"settings": settings, "machine": machine.describe(), "ways": rows}
    write_json(out / "results.json", report)
    return rows


def line(row: Row) -> str:
    """A row to read."""
    flickers = "" if row["flicker"] is None else f"  flicker {row['flicker']:.4f}"
    return (
        f"{row['label']:46} {row['seconds_per_frame']:6.2f} s per frame  "
        f"PSNR {row['psnr']:5.2f} dB{flickers}"
    )


def _row(entry: Entry, reference: Reference) -> Row:
    picture, truth = entry.frames[MIDDLE], reference.picture.frames[MIDDLE]
    return {
        "label": entry.label,
        "way": entry.way.name,
        "samples": entry.samples,
        "seconds_per_frame": round(entry.seconds, 2),
        "psnr": round(metrics.psnr(picture, truth), 2),
        "relmse": round(metrics.relmse(picture, truth), 5),
        "flicker": _flicker(entry, reference),
    }


def _flicker(entry: Entry, reference: Reference) -> float | None:
    """How errors change from frame to frame; None for a still."""
    if not set(PAIR) <= set(entry.frames):
        return None
    shown = entry.frames[PAIR[0]], entry.frames[PAIR[1]]
    return round(reference.truth.flicker(shown, 0.0), 5)


def _write_comparisons(out: Path, outcome: Outcome, rows: Sequence[Row]) -> None:
    known = {row["way"]: row for row in rows}
    true = outcome.reference.picture

    def columns(*entries: Entry) -> list[Column]:
        shown = [(_label(known[x.way.name]), x.frames[MIDDLE]) for x in entries]
        return [*shown, (true.label, true.frames[MIDDLE])]

    first, *others = PICTURES
    rival, shot = outcome.rival, outcome.shot
    heading = "A frame of a shot with a moving camera; the same seconds for both"
    comparison.compare(heading, columns(rival, shot), out / first)
    film = [[entry.frames[n] for n in SHOT] for entry in (rival, shot)]
    names = tuple(_label(known[x.way.name]) for x in (rival, shot))
    comparison.move(film, names, out / others[0])
    stills = (*outcome.stills, rival, outcome.quick)
    ordered = sorted(stills, key=lambda x: known[x.way.name]["psnr"])
    heading = "A still; the same seconds for all, the least decibels first"
    comparison.compare(heading, columns(*ordered), out / others[1])


def _label(row: Row) -> str:
    figures = f"{row['seconds_per_frame']:.1f} s, {row['psnr']:.1f} dB"
    return f"{row['label']}\n{figures}"
