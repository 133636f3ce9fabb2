"""Whether a shot is worse than its frames alone, block by block, as in the gallery."""

from __future__ import annotations

import statistics
from typing import TYPE_CHECKING, Any

from ..gallery.judge import LOSS, compare
from ..metrics import to_srgb

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from xrds_core.arrays import Array

    Point = dict[str, Any]


def against_alone(
    picture: Array, alone: Array, references: Sequence[Array], stops: float
) -> dict[str, float]:
    """Judge radiance (H, W, 3) against that of the frame alone, seen at `stops`.

    Two references of independent noise tell the error without their own. Gains are
    in dB, of the frame and of its worst block; the share is of the blocks that lose.
    """
    shown, single, *truth = (to_srgb(x, stops) for x in (picture, alone, *references))
    verdict = compare(shown, single, truth)
    return {
        "gain_over_alone": round(verdict.gain, 4),
        "worst_block": round(verdict.worst, 4),
        "share_of_blocks": round(verdict.share, 5),
    }


def section(points: Sequence[Point]) -> Iterator[str]:
    """The part of the report; nothing where no point has these figures."""
    judged = [point for point in points if "worst_block" in point]
    if not judged:
        return
    yield "## Blocks against the frame alone"
    yield (
        "XRDS against itself at radius 0, in blocks of 32x32 pixels. *Losing* is the "
        f"share of a scene's blocks that lose more than {LOSS:g} dB."
    )
    lines = [
        "| camera, samples per frame, radius | scenes | gain | worst scene "
        "| worst block | losing, mean | most |",
        "|---|---|---|---|---|---|---|",
    ]
    keys = ("motion", "samples", "radius")
    for case in dict.fromkeys(tuple(p[k] for k in keys) for p in judged):
        here = [p for p in judged if tuple(p[k] for k in keys) == case]
        cells = [", ".join(map(str, case)), str(len(here))]
        cells.append(f"{statistics.fmean(p['gain_over_alone'] for p in here):+.2f}")
        for key in ("gain_over_alone", "worst_block"):
            least = min(here, key=lambda p: p[key])
            cells.append(f"{least[key]:+.2f} {least['scene']}")
        most = max(here, key=lambda p: p["share_of_blocks"])
        cells.append(f"{statistics.fmean(p['share_of_blocks'] for p in here):.1%}")
        cells.append(f"{most['share_of_blocks']:.1%} {most['scene']}")
        lines.append(f"| {' | '.join(cells)} |")
    yield "\n".join(lines)
