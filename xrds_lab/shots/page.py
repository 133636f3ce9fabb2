"""report.html: errors of shots against seconds, in one file that needs no other.

All figures are worked out here; the page's script draws them and shows crops.
"""

from __future__ import annotations

import base64
import json
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING, Any

import numpy as np

from xrds_core.files import replacing

from ..bench.plots import MEASURES as LABELS
from .crops import REFERENCE, crop_key
from .methods import BEST, DEFAULT, MEDIAN, NL_MEANS, XRDS
from .motions import MOTIONS
from .plot import LINES, PERCENTILES
from .seeds import over_seeds

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from .crops import Key

    Point = dict[str, Any]

PAGE = Path(__file__).with_name("page.html")
LARGEST = 2_400_000  # bytes of crops in a page
MEASURES = {
    "psnr": LABELS["psnr"],
    "flip": "FLIP (sRGB)",
    "relmse_trimmed": LABELS["relmse_trimmed"],
    "flicker": "flicker (sRGB)",
}
_ORDER = [DEFAULT, BEST, MEDIAN, NL_MEANS, XRDS]
_DIGITS = 5


def write(path: Path, results: Mapping[str, Any], crops: Mapping[Key, Path]) -> None:
    """Write the page of `results.json`.

    `crops` are WebP files by scene, motion, method, samples and radius; all of a
    motion's are left out where the page would become too large.
    """
    packed = json.dumps(content(results, crops), separators=(",", ":"))
    page = Template(PAGE.read_text("utf-8")).substitute(
        data=packed.replace("<", "\\u003c")  # ends no script, begins no comment
    )
    with replacing(path) as part:
        part.write_text(page, "utf-8")


def content(results: Mapping[str, Any], crops: Mapping[Key, Path]) -> dict[str, Any]:
    """What the page's script draws.

    `points` hold figures of one scene, `summaries` those of all: of each measure the
    PERCENTILES over scenes. Both name their series and crop by number; `references`
    give the crops of references by scene and motion.
    """
    points = over_seeds(results["shots"])
    series = sorted(
        {(p["method"], p["radius"]) for p in points},
        key=lambda s: (_ORDER.index(s[0]), s[1]),
    )
    pool = _Pool(crops)
    shots = dict.fromkeys((p["scene"], p["motion"]) for p in points)
    motions = {motion for _, motion in shots}
    return {
        "measures": MEASURES,
        "motions": {name: told for name, told in MOTIONS.items() if name in motions},
        "scenes": list(dict.fromkeys(p["scene"] for p in points)),
        "series": [_style(*each) for each in series],
        "default": series.index((DEFAULT, 0)) if (DEFAULT, 0) in series else None,
        "points": [
            {
                "scene": p["scene"],
                **_shot(p, series),
                "seconds": _short(p["seconds_per_frame"]),
                **{name: _short(p[name]) for name in MEASURES},
                "crop": pool.number(crop_key(p)),
            }
            for p in points
        ],
        "summaries": [
            _summary(group, results["differences"]) | _shot(group[0], series)
            for group in _over_scenes(points)
        ],
        "references": {
            f"{scene} {motion}": pool.number((scene, motion, *REFERENCE))
            for scene, motion in shots
        },
        "crops": pool.uris,
    }


def _shot(point: Point, series: Sequence[tuple[str, int]]) -> dict[str, Any]:
    return {
        "motion": point["motion"],
        "series": series.index((point["method"], point["radius"])),
        "samples": point["samples"],
    }


def _style(method: str, radius: int) -> dict[str, str]:
    other = (f"XRDS, radius {radius}", "#882255", ":", "o")
    name, colour, dash, mark = LINES.get((method, radius), other)
    return {"name": name, "colour": colour, "dash": dash, "mark": mark}


def _short(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.{_DIGITS}g}")


# --- over scenes ----------------------------------------------------------------------


def _over_scenes(points: Iterable[Point]) -> list[list[Point]]:
    """The points of each motion, method, number of samples and radius.

    Only those that all scenes of the motion have: others are no medians of the same.
    """
    groups: dict[tuple[Any, ...], list[Point]] = {}
    scenes: dict[str, set[str]] = {}
    for p in points:
        case = p["motion"], p["method"], p["samples"], p["radius"]
        groups.setdefault(case, []).append(p)
        scenes.setdefault(p["motion"], set()).add(p["scene"])
    return [g for g in groups.values() if len(g) == len(scenes[g[0]["motion"]])]


def _summary(group: Sequence[Point], differences: Iterable[Point]) -> dict[str, Any]:
    """Percentiles of the measures, the median of seconds, and the worst scene.

    None where a scene of the group lacks it. `gain` is in PSNR over Cycles + OIDN.
    """
    seconds = _known(group, "seconds_per_frame")
    summary: dict[str, Any] = {
        "scenes": len(group),
        "seconds": None if seconds is None else _short(float(np.median(seconds))),
    }
    for name in MEASURES:
        values = _known(group, name)
        summary[name] = values and [
            _short(float(x)) for x in np.percentile(values, PERCENTILES)
        ]
    names = ("motion", "method", "samples", "radius")
    asked = {name: group[0][name] for name in names} | {"measure": "psnr"}
    own = next((d for d in differences if asked.items() <= d.items()), None)
    told = ("mean", "low", "high", "worst", "worst_scene")
    return summary | {"gain": own and {name: own[name] for name in told}}


def _known(group: Sequence[Point], name: str) -> list[float] | None:
    values = [p[name] for p in group]
    return None if None in values else values


# --- crops ----------------------------------------------------------------------------


class _Pool:
    """The crops of a page, each picture once, by number."""

    def __init__(self, files: Mapping[Key, Path]) -> None:
        self.uris: list[str] = []
        self._numbers: dict[Key, int] = {}
        self._size = 0
        for motion in MOTIONS:
            here = {key: path for key, path in files.items() if key[1] == motion}
            self._add({key: _uri(path) for key, path in here.items()})

    def _add(self, uris: Mapping[Key, str]) -> None:
        new = dict.fromkeys(uris.values())  # two methods may make the same picture
        size = sum(map(len, new))
        if self._size + size > LARGEST:
            return
        numbers = {uri: len(self.uris) + i for i, uri in enumerate(new)}
        self._numbers |= {key: numbers[uri] for key, uri in uris.items()}
        self.uris += new
        self._size += size

    def number(self, key: Key) -> int | None:
        """The number of a crop; None where the page has none."""
        return self._numbers.get(key)


def _uri(path: Path) -> str:
    return "data:image/webp;base64," + base64.b64encode(path.read_bytes()).decode()
