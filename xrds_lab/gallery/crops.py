"""A sheet of crops: what neighbours do to a picture where nothing judges them.

Of each shot the middle frame: alone, with all samples of its neighbours whatever they
show, by XRDS, and the reference. All but the reference are denoised in the same way.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from xrds_core.accumulation.accumulate import Accumulated, sample_counts
from xrds_core.accumulation.frame import Stored
from xrds_core.accumulation.object_motion import Movement
from xrds_core.accumulation.reprojection import grid, nearest, pair, reproject
from xrds_core.arrays import Array, floats
from xrds_core.files import replacing

from ..bench.crops import largest
from ..metrics import to_srgb
from .frames import Measure, Store
from .pictures import Clip
from .table import Shot

LABELS = (
    "the frame alone",
    "neighbours averaged, unjudged",
    "XRDS",
    "reference",
)
WIDTH, HEIGHT, ZOOM, STEP = 112, 84, 3, 4  # of a crop, in pixels; between places
_CAPTION, _GAP, _FONT = 30, 4, 17
_QUALITY = 82  # of the WebP; it is to be looked at


def write_crops(
    shots: Sequence[Shot], measure: Measure, store: Store, path: Path
) -> None:
    """Write a row for each shot as a WebP, at the fewest samples that it is judged at.

    Shows the part where averaged neighbours are farthest from the reference. Raises
    SceneError where `store` lacks frames of a shot.
    """
    rows = [_row(shot, measure, store) for shot in shots]
    width, height = WIDTH * ZOOM, HEIGHT * ZOOM
    across, down = width + _GAP, height + _GAP
    size = len(LABELS) * across - _GAP, _CAPTION + len(rows) * down - _GAP
    sheet = Image.new("RGB", size, "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(size=_FONT)
    for column, label in enumerate(LABELS):
        draw.text((column * across + 2, 4), label, fill="black", font=font)
    for line, crops in enumerate(rows):
        for column, crop in enumerate(crops):
            shown = Image.fromarray(np.round(crop * 255).astype(np.uint8))
            shown = shown.resize((width, height), Image.Resampling.NEAREST)
            sheet.paste(shown, (column * across, _CAPTION + line * down))
    with replacing(path) as part:
        sheet.save(part, "WEBP", quality=_QUALITY, method=6)


def _row(shot: Shot, measure: Measure, store: Store) -> list[Array]:
    """The crops (h, w, 3) of a shot's middle frame, in the order of the labels."""
    number, samples = shot.judged[0], min(shot.counts(measure.samples))
    requests = measure.noisy(shot, samples)
    clip = Clip(shot, samples, {r.number: store.frames(r) for r in requests})
    own, neighbours = clip.own(number), clip.neighbours(number)
    parts = [part for each in measure.references(shot, number) for part in each]
    pictures = (
        clip.alone(number),
        clip.finished(own, neighbours, averaged(own, neighbours)),
        clip.lent(number),
        store.reference(parts),
    )
    shown = [to_srgb(picture[..., :3]) for picture in pictures]
    error = np.square(shown[1] - shown[-1]).mean(-1)
    place = largest(error, WIDTH, HEIGHT, STEP)
    return [picture[place] for picture in shown]


def averaged(own: Stored, others: Sequence[Stored]) -> Accumulated:
    """The mean of a frame's samples and all that its neighbours have at its places.

    Places follow the camera and the Vector passes, as in the product. Nothing asks
    whether a place is hidden there, or shows other light.
    """
    samples = sample_counts(own)
    sums = floats(own.picture) * samples[:, None]
    spots = grid(own.shape)
    motions = Movement().object_motions(own, others)
    for other, motion in zip(others, motions, strict=True):
        both = pair(own, other)
        x, y, _ = reproject(both.forth, spots.x, spots.y, own.inverse_depth)
        if motion is not None:
            known = np.isfinite(motion.x)
            x[motion.pixels[known]] = motion.x[known]
            y[motion.pixels[known]] = motion.y[known]
        found = nearest(x, y, other.shape)
        weight = sample_counts(other)[found.pixel] * found.seen
        values = floats(other.picture.take(found.pixel, axis=0))
        if both.turn is not None:
            values[:, other.normals] = values[:, other.normals] @ both.turn.T
        sums += values * weight[:, None]
        samples += weight
    means = (sums / samples[:, None]).reshape(*own.shape, -1)
    return Accumulated(
        radiance=means[..., :3],
        albedo=means[..., 3:6],
        normal=means[..., 6:9],
        alpha=means[..., 9] if means.shape[-1] > 9 else None,
        samples=samples.reshape(own.shape),
        rejected=0.0,
        frames=tuple(sorted({own.number, *(other.number for other in others)})),
    )
