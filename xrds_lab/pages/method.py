"""Draws the figure of docs/method.md: what is gathered and judged, when it fails."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from xrds_core.accumulation.weighted_sums import penalties
from xrds_core.files import replacing

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes

    from xrds_core.arrays import Array

INK, BLUE, ORANGE, GREY = "#222222", "#2266aa", "#cc5500", "#aaaaaa"
SAMPLES = 2
_SEED, _PIXELS, _NEIGHBOURS = 5, 120, 8
_NOISE, _LIT, _SHADOW = 0.16, 0.9, 0.3
_AVERAGED = 9  # pixels over which errors are averaged


def draw(path: Path) -> None:
    """Write the figure as SVG; the same source gives the same file."""
    style = {"svg.fonttype": "none", "svg.hashsalt": "xrds", "font.size": 9}
    with mpl.rc_context(style), replacing(path) as part:
        figure = Figure(figsize=(11, 3.4), layout="constrained")
        gathered, judged, failing = figure.subplots(1, 3)
        _draw_gathered(gathered)
        _draw_judged(judged)
        _draw_failing(failing)
        figure.savefig(part, format="svg", metadata={"Date": None})


def _draw_gathered(axes: Axes) -> None:
    """Draw three frames; one place on a surface lies in another pixel of each."""
    axes.set_title("What is gathered")
    for number, name in enumerate(("frame n - 1", "frame n", "frame n + 1")):
        left, own = 6.0 * number, number == 1
        for at in range(6):
            axes.plot([left, left + 5], [at, at], color=GREY, lw=0.6)
            axes.plot([left + at, left + at], [0, 5], color=GREY, lw=0.6)
        # the camera moves: the place wanders through the frames, between the pixels
        place = np.array([left + 3.8 - 1.3 * number, 3.3 - 0.8 * number])
        column, row = np.floor(place)
        colour = ORANGE if own else BLUE
        axes.add_patch(Rectangle((column, row), 1, 1, fc=colour, alpha=0.45))
        axes.plot(*place, "o", color=INK, ms=4)
        axes.text(left + 2.5, -1.1, name, ha="center", color=INK)
        arrow = {"arrowstyle": "->", "color": colour, "lw": 1}
        end, start = (7.5 + number, 8.2), (column + 0.5, row + 1.05)
        axes.annotate("", end, start, arrowprops=arrow)
    told = "dot: where the surface was\nsquare: the nearest pixel, as it is"
    axes.text(8.5, 8.5, "a mean of noisy samples", ha="center", color=INK)
    axes.text(8.5, -4, told, ha="center", color=INK)
    axes.set(xlim=(-0.5, 17.5), ylim=(-4.2, 9.8))
    axes.set_aspect("equal")
    axes.axis("off")


def _draw_judged(axes: Axes) -> None:
    """Draw a row of pixels over which the edge of a shadow has moved."""
    x = np.arange(_PIXELS)
    truth = np.where(x < 60, _LIT, _SHADOW)
    edges = 60 + 6 * np.delete(np.arange(-4, 5), 4)
    others = np.mean([np.where(x < edge, _LIT, _SHADOW) for edge in edges], axis=0)
    random = np.random.default_rng(_SEED)
    own = truth + _NOISE * random.standard_normal(_PIXELS)
    others = others + _NOISE / np.sqrt(_NEIGHBOURS) * random.standard_normal(_PIXELS)
    weight = _weights(own, others)
    share = _NEIGHBOURS * weight
    result = (own + share * others) / (1.0 + share)
    axes.set_title("What judges it")
    axes.fill_between(x, 0, 0.2 * weight, color=ORANGE, alpha=0.4, lw=0)
    axes.plot(x, own, ".", color=GREY, ms=3, label="the frame's own samples")
    axes.plot(x, others, color=BLUE, lw=1, label="mean of the neighbours")
    axes.plot(x, result, color=ORANGE, lw=1.2, label="what is denoised")
    axes.plot(x, truth, color=INK, lw=0.8, ls="--", label="truth")
    axes.text(2, 0.21, "weight of the neighbours", color=ORANGE, va="bottom")
    axes.set(xlabel="a row of pixels; a shadow's edge moves", ylabel="radiance")
    axes.set(xlim=(0, _PIXELS - 1), ylim=(0, 1.75), yticks=[], xticks=[])
    axes.legend(loc="upper right", frameon=False, fontsize=8)


def _weights(own: Array, others: Array) -> Array:
    """Weigh neighbours as `xrds_core.accumulation.weighted_sums` does, for one row."""
    kernel = np.ones(_AVERAGED) / _AVERAGED
    apart = np.convolve(own - others, kernel, "same")
    chance = _NOISE**2 * (1 + 1 / _NEIGHBOURS) / _AVERAGED
    error = np.maximum(apart**2 - 6 * chance, 0.0)  # what noise could explain
    return _NOISE**2 / (_NOISE**2 + penalties(SAMPLES)[1] * error)


def _draw_failing(axes: Axes) -> None:
    """Draw how much a neighbour counts whose mean is off."""
    error = np.logspace(-3, 1, 200)
    guides, changes = penalties(SAMPLES)
    axes.set_title("When it fails")
    for penalty, colour, name in (
        (guides, BLUE, "seen in albedo and normal"),
        (changes, ORANGE, "light that changes among neighbours"),
    ):
        axes.plot(error, 1 / (1 + penalty * error**2), color=colour, label=name)
    axes.axvspan(error[0], 0.02, color=GREY, alpha=0.25, lw=0)
    axes.text(0.0012, 0.03, "too small to be found:\nbelieved", color=INK, va="bottom")
    axes.text(0.35, 0.14, "rejected:\nthe frame alone", color=INK)
    axes.set(xscale="log", xlim=(error[0], error[-1]), ylim=(0, 1.4))
    axes.set(
        xlabel="error of the neighbours / noise of the frame",
        ylabel=f"weight, {SAMPLES} samples per pixel",
        yticks=[0, 0.5, 1],
    )
    axes.legend(loc="upper right", frameon=False, fontsize=8)
