"""How long a run will take: predicted seconds of its tasks, and a bar."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

from xrds_blender.planning.settings import Denoising

from .inputs import OFF

if TYPE_CHECKING:
    from xrds_blender.planning.budget import Costs

    from .inputs import Request
    from .sweep import Config
    from .windows import Window

# Of the errors of one picture, seconds per megapixel: FLIP above all.
ERRORS_PER_MEGAPIXEL = 6.0


def render_seconds(request: Request, costs: Costs, share: float = 1.0) -> float:
    """Predicted seconds of one render of a `share` of the frame's pixels."""
    sample = costs.guide if request.kind == "guides" else costs.beauty
    seconds = request.samples * sample
    if request.denoiser not in {None, OFF}:
        seconds += costs.denoise[request.denoiser]
    return seconds * share / request.scale**2


def config_seconds(config: Config, costs: Costs) -> float:
    """Predicted seconds of a configuration's whole frame."""
    seconds = costs.fixed
    seconds += sum(render_seconds(request, costs) for request in config.requests())
    if config.method == "xrds":
        seconds += costs.network[config.network]
    elif config.method == "full_size":
        seconds += costs.denoise[Denoising(config.denoiser)]
    return seconds


def picture_seconds(config: Config, costs: Costs, window: Window) -> float:
    """Predicted seconds of making one picture of a window and measuring it."""
    pixels = window.width * window.height
    seconds = ERRORS_PER_MEGAPIXEL * pixels / 1e6
    if config.method == "xrds":
        seconds += costs.network[config.network] * share(window)
    return seconds


def share(window: Window) -> float:
    """The window's part of its frame's pixels."""
    return window.width * window.height / (window.frame_width * window.frame_height)


class Meter:
    """Shows what is done and left on stderr, weighted by predicted seconds."""

    def __init__(self, seconds: float) -> None:
        from tqdm import tqdm

        self._bar: Any = tqdm(
            total=round(seconds, 1),
            file=sys.stderr,
            unit="s",
            bar_format="{percentage:3.0f}%|{bar:20}| {elapsed} gone, {remaining} left "
            "{desc}",
        )

    def done(self, seconds: float, task: str) -> None:
        """Count a task of so many predicted seconds."""
        self._bar.set_description_str(task[:60], refresh=False)
        # a guess that was too low must not end the bar before the work
        self._bar.total = max(self._bar.total, self._bar.n + seconds)
        self._bar.update(seconds)

    def write(self, line: str) -> None:
        """Print a line above the bar."""
        self._bar.write(line, file=sys.stderr)

    def close(self) -> None:
        """End the bar."""
        self._bar.close()
