"""What docs/results holds, as rows that figures and tables are made of."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from statistics import mean
from typing import TYPE_CHECKING, Any

from ..shots import equal_seconds
from ..shots.frames import REACH
from ..shots.methods import CYCLES, DEFAULT, SAME_PICTURE, XRDS
from ..shots.seconds import per_frame
from ..shots.seeds import over_seeds

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    Rows = list[dict[str, Any]]

SCENES = (
    "classroom",
    "living-room",
    "staircase",
    "dining-room",
    "house",
    "crystal-cave",
    "bmw27",
)
OLD_PATTERN = ("bmw27", "crystal-cave")
"""Files with Cycles' classic sampling pattern, which XRDS replaces at full size."""
SAME_CASE = ("scene", "motion", "samples", "noise_threshold", "frames", "size")
"""What rows of *Same Picture* and of what it is compared with have in common."""
LONG_SHOT = {
    "method": SAME_PICTURE,
    "motion": "pan",
    "samples": 16,
    "noise_threshold": None,
    "frames": 49,
    "size": "960x512",
}
"""The rows of *Same Picture* that the first page tells of, and what is left out."""
_LAST = 128  # samples of most references in `by-samples.json`
_UNLIT = 90.0  # dB: the PSNR of a part without light
_NAMES = {"bmw27": "car", "crystal-cave": "cave"}


def longest(rows: Rows) -> Rows:
    """Return of each scene and number of samples the row of the longest shot.

    Of these that of the largest pictures.
    """
    found = {}
    for row in sorted(
        rows, key=lambda x: (x["frames"], int(x["size"].partition("x")[0]))
    ):
        found[row["scene"], row["samples"], row["noise_threshold"]] = row
    return list(found.values())


def of_cycles(rows: Rows, own: dict[str, Any]) -> dict[str, Any]:
    """Return the row that one of *Same Picture* is compared with."""
    (cycles,) = only(rows, method=CYCLES, **{x: own[x] for x in SAME_CASE})
    return cycles


def _compared(entries: Rows) -> Rows:
    """Those at the seconds of Cycles + OIDN that have a gain."""
    found = only(entries, motion="pan", at=DEFAULT)
    return [x for x in found if x["gain"] is not None]


def scene_name(scene: str) -> str:
    """Return a scene as pages call it."""
    return _NAMES.get(scene, scene.replace("-", " "))


def only(rows: Iterable[dict[str, Any]], **values: Any) -> Rows:
    """Return the rows that hold these values."""
    return [x for x in rows if all(x[key] == value for key, value in values.items())]


def beside_cycles(rows: Rows, method: str = XRDS, radius: int = REACH) -> Rows:
    """Return a method's rows with `gain` and the ratios of FLIP and flicker.

    `rows` hold those of Cycles + OIDN, too, of one shot of each scene. The radius is
    that of XRDS alone.
    """
    usual = {x["scene"]: x for x in only(rows, method=DEFAULT)}
    chosen = only(rows, method=method)
    if method == XRDS:
        chosen = only(chosen, radius=radius)
    return [
        {
            **x,
            "gain": x["psnr"] - usual[x["scene"]]["psnr"],
            "flip_ratio": x["flip"] / usual[x["scene"]]["flip"],
            "flicker_ratio": x["flicker"] / usual[x["scene"]]["flicker"],
        }
        for x in chosen
    ]


@dataclass(frozen=True)
class Results:
    """The JSON files below a folder; each is read once."""

    folder: Path

    def read(self, name: str) -> dict[str, Any]:
        """Return what a file below the folder holds."""
        return json.loads((self.folder / name).read_text("utf-8"))

    @cached_property
    def bench(self) -> dict[str, Any]:
        """Stills: errors against seconds."""
        return self.read("bench/results.json")

    @cached_property
    def shots(self) -> dict[str, Any]:
        """Shots of the seven scenes; means over seeds."""
        found = self.read("shots/results.json")
        return found | {"shots": over_seeds(found["shots"])}

    @cached_property
    def equal_seconds(self) -> Rows:
        """Panning shots in the seconds of Cycles + OIDN, where both were timed."""
        return _compared(self.shots["equal_seconds"])

    @cached_property
    def equal_seconds_of_all(self) -> Rows:
        """The same of all scenes, timed in a quarter of the pixels, on a newer machine.

        What a frame takes grows with its pixels.
        """
        known = self.read("shots/seconds.json")["scenes"]

        def priced(point: dict[str, Any]) -> dict[str, Any]:
            what = (point[name] for name in ("method", "samples", "radius"))
            return point | {
                "seconds_per_frame": per_frame(known[point["scene"]], *what)
            }

        return _compared(equal_seconds.entries(map(priced, self.shots["shots"])))

    @cached_property
    def held_out(self) -> Rows:
        """Shots on which no constant was chosen: all methods; means over seeds."""
        return over_seeds(self.read("held-out/results.json")["shots"])

    @cached_property
    def installs(self) -> Rows:
        """Sizes and seconds of installs, the smallest first."""
        return self.read("install.json")["rows"]

    @cached_property
    def same_picture(self) -> Rows:
        """*Same Picture*: seconds and errors."""
        return self.read("same-picture/results.json")["shots"]

    @cached_property
    def left_out(self) -> Rows:
        """Super-resolution: seconds as planned and with nothing left out."""
        return self.read("left-out/results.json")["shots"]

    @cached_property
    def gallery(self) -> Rows:
        """Small shots of what films hold."""
        return self.read("gallery/results.json")["shots"]

    @cached_property
    def later_gallery(self) -> Rows:
        """The same by later code, in smaller pictures, against two references."""
        rows = self.read("shots/by-samples.json")["rows"]
        return [x for x in rows if _LAST in x["reference_samples"]]

    @cached_property
    def parts(self) -> Rows:
        """Parts of the light that are lit; of each the PSNR."""
        rows = self.read("light-parts/results.json")["parts"]
        return [x for x in rows if x["sum"] and x.get("raw", _UNLIT) < _UNLIT]

    @cached_property
    def low_budgets(self) -> Rows:
        """Stills with no time for a sample per pixel."""
        return self.read("low_budgets/low_budgets.json")["rows"]

    @cached_property
    def standard(self) -> dict[str, Any]:
        """Errors of the networks for as many samples."""
        return self.read("standard.json")

    @cached_property
    def card(self) -> dict[str, Any]:
        """Seconds on a graphics card."""
        return self.read("card/h200.json")

    @cached_property
    def card_pans(self) -> Rows:
        """Return pans on a graphics card: real scenes, and shots of the gallery."""
        shots = self.read("card/same-picture.json")["shots"]
        return [*shots, *self.read("card/device-report.json")["pans"]]

    def both(self, samples: int) -> Rows:
        """Return shots where camera and objects move beside Cycles + OIDN."""
        rows = self.read("shots/both.json")["shots"]
        return beside_cycles(only(rows, motion="both", samples=samples))

    def pans(self, samples: int, method: str = XRDS, radius: int = REACH) -> Rows:
        """Return a method's rows of `shots` beside those of Cycles + OIDN."""
        rows = only(self.shots["shots"], motion="pan", samples=samples)
        return beside_cycles(rows, method, radius)

    @property
    def pan_samples(self) -> list[int]:
        """Samples per frame of `shots`, the fewest first."""
        return sorted({x["samples"] for x in self.shots["shots"]})

    def unit(self, units: float) -> Rows:
        """Return what fits a budget, by scene: rows with `default`, `rival`, `xrds`."""
        rows = only(self.bench["budgets"], budget=units)
        names = {"default": "OIDN, default", "rival": "OIDN, best mode", "xrds": "XRDS"}
        return [
            {"scene": x["scene"]}
            | {key: (x["best"][name] or {}).get("psnr") for key, name in names.items()}
            for x in rows
        ]

    def over_rival(self, units: float) -> dict[str, float]:
        """Return by how much XRDS is above the best mode at a budget, by scene."""
        return {
            x["scene"]: x["xrds"] - x["rival"]
            for x in self.unit(units)
            if x["xrds"] is not None and x["rival"] is not None
        }

    def denoiser(self, quality: str, samples: int) -> Rows:
        """Return the points of a denoiser at full size, one for each scene."""
        return [
            x
            for x in self.bench["points"]
            if x["method"] in ("oidn", "full_size")
            and x["settings"]["denoiser"] == quality
            and x["settings"]["samples"] == samples
        ]

    def part_means(self, of: str, samples: int) -> dict[str, float]:
        """Return the PSNR of parts by way of finishing: means over scenes."""
        rows = only(self.parts, sum=of, samples=samples)
        scenes = list(dict.fromkeys(x["scene"] for x in rows))
        return {
            way: mean(mean(x[way] for x in only(rows, scene=s)) for s in scenes)
            for way in ("raw", "one_by_one", "still", "shot")
        }
