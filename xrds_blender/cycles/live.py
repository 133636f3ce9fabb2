"""What the image editor shows while the engine works.

Blender shows nothing of the render result until the engine has returned: it asks the
engine to draw. Cycles draws the samples that it takes, at the size at which it takes
them, into the lower left corner; between its renders it draws nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..internals.lifetimes import RENDER_JOB

if TYPE_CHECKING:
    from xrds_core.arrays import Array


@dataclass(frozen=True)
class Live:
    """What is drawn over the frame.

    `picture` (h, w, 4), row 0 on top, is drawn with pixels of `scale` x `scale`, its
    top left one `offset` (dy, dx) above and left of the frame's corner. Without it
    Cycles' own drawing is, with such pixels.
    """

    picture: Array | None = None
    scale: int = 1
    offset: tuple[int, int] = (0, 0)


@dataclass
class _Now:
    """What is drawn now."""

    live: Live = Live()


def now() -> Live:
    """What is to be drawn."""
    return RENDER_JOB.of(_Now).live


def _draw(live: Live) -> None:
    RENDER_JOB.of(_Now).live = live


def samples(scale: int = 1) -> None:
    """From now on Cycles draws its samples, of a picture to come."""
    _draw(Live(scale=scale))


def guides() -> None:
    """From now on Cycles renders guides, which are drawn where there is no picture."""
    if now().picture is None:
        samples()


def show(picture: Array, scale: int = 1, offset: tuple[int, int] = (0, 0)) -> None:
    """From now on a picture is drawn; it must not be changed any more."""
    _draw(Live(picture, scale, offset))


def clear() -> None:
    """Show nothing of what was before."""
    _draw(Live())
