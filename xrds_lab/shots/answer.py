"""Should this scene be rendered as a shot? One picture that says so, and shows why."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from xrds_core.files import replacing

from .crops import REFERENCE, SIZE, crop_key
from .frames import REACH
from .methods import DEFAULT, XRDS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from .crops import Key

    Point = dict[str, Any]

LITTLE = 0.5
"""Decibels; a smaller difference does not decide how a shot is rendered."""
_ZOOM, _GAP, _LINE = 2, 6, 22
_PAPER, _INK = (24, 24, 26), (235, 235, 230)
_QUALITY = 85  # of WebP


def write(
    folder: Path,
    points: Sequence[Point],
    at_equal_seconds: Sequence[Mapping[str, Any]],
    crops: Mapping[Key, Path],
) -> None:
    """Write `answer-SCENE.webp` for each scene with crops, of its first motion.

    `points` are means over seeds; `at_equal_seconds` those of `equal_seconds`. A row
    for each number of samples: Cycles + OIDN, XRDS, the reference.
    """
    for scene in dict.fromkeys(p["scene"] for p in points):
        motion = next(p["motion"] for p in points if p["scene"] == scene)
        shot = {"scene": scene, "motion": motion}.items()
        pairs = _pairs([p for p in points if shot <= p.items()])
        reference = crops.get((scene, motion, *REFERENCE))
        pairs = [x for x in pairs if all(crop_key(p) in crops for p in x)]
        if pairs and reference:
            equal = [x for x in at_equal_seconds if shot <= x.items()]
            lines = [sentence(*pair, equal) for pair in pairs]
            true = "Reference", reference
            rows = [
                [*((_label(p), crops[crop_key(p)]) for p in pair), true]
                for pair in pairs
            ]
            _draw(folder / f"answer-{scene}.webp", lines, rows)


def sentence(
    cycles: Point, xrds: Point, at_equal_seconds: Sequence[Mapping[str, Any]] = ()
) -> str:
    """Whether a shot pays at a number of samples, in one sentence.

    In equal seconds where these are known, else with the same samples.
    """
    samples = xrds["samples"]
    gain, reason = xrds["psnr"] - cycles["psnr"], "with the same samples"
    for entry in at_equal_seconds:
        is_this = (entry["at"], entry["samples"]) == (XRDS, samples)
        if is_this and entry["gain"] is not None:
            gain, reason = entry["gain"], "in the same seconds"
    if abs(gain) < LITTLE:
        verdict = "A shot changes little"
    else:
        verdict = "Render it as a shot" if gain > 0.0 else "Render frames alone"
    plural = "" if samples == 1 else "s"
    return f"{samples} sample{plural} a frame: {verdict}. {gain:+.1f} dB {reason}."


def _pairs(points: Sequence[Point]) -> list[tuple[Point, Point]]:
    """Cycles + OIDN and XRDS, of each number of samples that both have."""
    found = []
    for samples in sorted({p["samples"] for p in points}):
        of = {(p["method"], p["radius"]): p for p in points if p["samples"] == samples}
        if (DEFAULT, 0) in of and (XRDS, REACH) in of:
            found.append((of[DEFAULT, 0], of[XRDS, REACH]))
    return found


def _label(point: Point) -> str:
    name = "XRDS, a shot" if point["method"] == XRDS else "Cycles + OIDN"
    seconds = point["seconds_per_frame"]
    taken = "" if seconds is None else f", {seconds:.1f} s"
    return f"{name}: {point['psnr']:.1f} dB{taken}"


def _draw(
    path: Path, lines: Sequence[str], rows: Sequence[Sequence[tuple[str, Path]]]
) -> None:
    from PIL import Image, ImageDraw, ImageFont

    side, font = SIZE * _ZOOM, ImageFont.load_default(size=15)
    height = 2 * _LINE + side + 2 * _GAP
    size = _GAP + len(rows[0]) * (side + _GAP), len(rows) * height
    sheet = Image.new("RGB", size, _PAPER)
    draw = ImageDraw.Draw(sheet)
    for number, (line, row) in enumerate(zip(lines, rows, strict=True)):
        top = number * height + _GAP
        draw.text((_GAP, top), line, fill=_INK, font=font)
        for column, (label, crop) in enumerate(row):
            left = _GAP + column * (side + _GAP)
            draw.text((left, top + _LINE), label, fill=_INK, font=font)
            with Image.open(crop) as picture:
                shape = picture.width * _ZOOM, picture.height * _ZOOM
                shown = picture.resize(shape, Image.Resampling.NEAREST)
            sheet.paste(shown, (left, top + 2 * _LINE))
    with replacing(path) as part:
        sheet.save(part, "WEBP", quality=_QUALITY)
