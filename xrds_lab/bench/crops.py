"""Crops of the best pictures at equal time, shown side by side in the report."""

from __future__ import annotations

import base64
import io
import json
from typing import TYPE_CHECKING, Any

import numpy as np

from xrds_core.errors import XRDSError

from ..metrics import to_srgb
from .sweep import Config

if TYPE_CHECKING:
    from xrds_core.arrays import Array

    from .measure import SceneBench

    Report = dict[str, Any]
    Box = tuple[slice, slice]

CROP = (480, 320)  # pixels of the part that is shown, at most
SHOWN = ("OIDN, default", "OIDN, best mode", "XRDS", "demodulated bilinear")
QUALITY = 92  # of the pictures in the page; they are to be looked at, not measured


def viewer(report: Report, scene: SceneBench) -> str:
    """HTML of a scene's crops; the page's script zooms and moves them together.

    Empty where all inputs are gone from the cache.
    """
    exposure = _exposure(scene)
    if exposure is None:
        return ""
    reference = scene.pictures.reference()
    place = _place(reference)
    shown: dict[str, str] = {}
    budgets = []
    for entry in (e for e in report["budgets"] if e["scene"] == scene.name):
        columns: list[dict[str, str]] = []
        for name in SHOWN:
            best = entry["best"].get(name)
            if best is None or best["label"] in {c["label"] for c in columns}:
                continue
            key = best["label"]
            if key not in shown:
                picture = _crop(scene, report, key, place)
                if picture is None:
                    continue
                shown[key] = picture
            figures = f"{best['psnr']:.2f} dB, {best['seconds']:.1f} s"
            columns.append({"label": key, "name": name, "figures": figures})
        title = f"{entry['budget']:g} x = {entry['seconds']:.1f} s"
        budgets.append({"title": title, "columns": columns})
    data = {
        "reference": _encoded(reference[place], exposure),
        "pictures": shown,
        "budgets": budgets,
    }
    packed = json.dumps(data).replace("</", "<\\/")
    return (
        '<div class="viewer"></div>'
        f'<script type="application/json" class="crops">{packed}</script>'
    )


def _crop(scene: SceneBench, report: Report, label: str, place: Box) -> str | None:
    if label in scene.crops:
        return scene.crops[label]
    point = next(
        p for p in report["points"] if p["label"] == label and p["scene"] == scene.name
    )
    config = Config(method=point["method"], **point["settings"])
    try:
        picture = scene.pictures.picture(config)
    except XRDSError:  # its inputs are gone from the cache
        return None
    scene.crops[label] = _encoded(picture[place], scene.pictures.exposure(config))
    return scene.crops[label]


def _exposure(scene: SceneBench) -> float | None:
    """Stops of the scene's view, which every rendered input holds."""
    there = (c for c in scene.configs if not scene.pictures.missing([c]))
    config = next(there, None)
    return None if config is None else scene.pictures.exposure(config)


def _place(reference: Array) -> Box:
    """The part of the picture with most detail, of CROP's size at most."""
    shown = to_srgb(reference).mean(-1)
    detail = np.abs(np.diff(shown, axis=0, append=shown[-1:]))
    detail += np.abs(np.diff(shown, axis=1, append=shown[:, -1:]))
    return largest(detail, *CROP)


def largest(plane: Array, width: int, height: int, step: int = 1) -> Box:
    """The place of this size at most, every `step` pixels, with the largest sum."""
    height, width = min(height, plane.shape[0]), min(width, plane.shape[1])
    total = np.pad(plane, ((1, 0), (1, 0))).cumsum(0).cumsum(1)
    inside = (
        total[height:, width:]
        - total[:-height, width:]
        - total[height:, :-width]
        + total[:-height, :-width]
    )[::step, ::step]
    y, x = (int(i) * step for i in np.unravel_index(inside.argmax(), inside.shape))
    return slice(y, y + height), slice(x, x + width)


def _encoded(linear: Array, stops: float) -> str:
    """A data URI of the picture in sRGB."""
    from PIL import Image

    pixels = np.round(to_srgb(linear, stops) * 255).astype(np.uint8)
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "WEBP", quality=QUALITY)
    return "data:image/webp;base64," + base64.b64encode(buffer.getvalue()).decode()
