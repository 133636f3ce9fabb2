"""Pictures of a run: how validation went, and what some windows look like."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from xrds_core.arrays import Array
from xrds_core.files import replacing

from ..metrics import psnr, to_srgb

COLOURS = {"xrds": "tab:red", "bicubic": "tab:gray", "demodulated": "tab:blue"}
INCH = 100  # pixels
PICTURE = 256  # pixels of a sample's side
LABEL = 24  # pixels above it

Pictures = Mapping[str, Array]


def write_curve(records: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Draw loss, gain and the PSNR of both validation sets over steps."""
    steps = [line["step"] for line in records]
    figure = Figure(figsize=(12, 7), layout="constrained")
    loss, gain, *sets = figure.subplots(2, 2).flat
    loss.plot(steps, [line["loss"] or np.nan for line in records], color="black")
    loss.set(title="training loss", yscale="log")
    gain.plot(
        steps, [line["gain"] for line in records], color="black", label="chosen by"
    )
    for name in records[-1]["psnr"]:
        gain.plot(steps, [line["gains"][name] for line in records], label=name)
    gain.axhline(0, color="tab:gray", linewidth=0.8)
    gain.set(title="gain over the better of bicubic and demodulated, dB")
    for axes, name in zip(sets, records[-1]["psnr"], strict=True):
        for method, colour in COLOURS.items():
            values = [line["psnr"][name][method] for line in records]
            axes.plot(steps, values, color=colour, label=method)
        axes.set(title=f"PSNR of {name} windows, dB")
    for axes in (loss, gain, *sets):
        axes.set_xlabel("step")
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.grid(alpha=0.3)
        if axes is not loss:
            axes.legend()
    write(figure, path)


def write_samples(rows: Sequence[Pictures], path: Path) -> None:
    """Draw pictures (H, W, 3), linear, one window a row, with their PSNR.

    Each row has the `reference`, which the others are measured against.
    """
    columns = len(rows[0])
    size = (columns * PICTURE / INCH, len(rows) * (PICTURE + LABEL) / INCH)
    figure = Figure(figsize=size, dpi=INCH)
    height = 1 / len(rows)
    for i, row in enumerate(rows):
        for j, (name, picture) in enumerate(row.items()):
            share = height * PICTURE / (PICTURE + LABEL)
            axes = figure.add_axes(
                (j / columns, 1 - (i + 1) * height, 1 / columns, share)
            )
            axes.imshow(to_srgb(picture), interpolation="nearest")
            axes.set_axis_off()
            axes.set_title(label(name, picture, row["reference"]), size=8, pad=4)
    write(figure, path)


def label(name: str, picture: Array, reference: Array) -> str:
    """The name, with the PSNR where it can be measured."""
    if picture is reference or picture.shape != reference.shape:
        return name
    return f"{name} {psnr(picture, reference):.2f} dB"


def write(figure: Figure, path: Path) -> None:
    """Write a PNG, whole or not at all."""
    with replacing(path) as part:
        figure.savefig(part, format="png")
