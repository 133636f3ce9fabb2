"""What docs/results holds, as rows that figures and tables are made of."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from statistics import mean
from typing import TYPE_CHECKING, Any

from ..shots.frames import REACH
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
MEDIAN = -1
_UNLIT = 90.0  # dB: the PSNR of a part without light
_NAMES = {"bmw27": "car", "crystal-cave": "cave"}


def scene_name(scene: str) -> str:
    """Return a scene as pages call it."""
    return _NAMES.get(scene, scene.replace("-", " "))


def only(rows: Iterable[dict[str, Any]], **values: Any) -> Rows:
    """Return the rows that hold these values."""
    return [x for x in rows if all(x[key] == value for key, value in values.items())]


def beside_cycles(rows: Rows, radius: int) -> Rows:
    """Return XRDS' rows of one shot with their `gain` and `flicker_ratio`.

    `rows` hold those of Cycles + OIDN, too; `radius` is as in `shot_rows`.
    """
    method = "median_of_three" if radius == MEDIAN else "xrds"
    usual = {x["scene"]: x for x in only(rows, method="cycles_oidn_default")}
    chosen = only(rows, method=method)
    if radius != MEDIAN:
        chosen = only(chosen, radius=radius)
    return [
        {
            **x,
            "gain": x["psnr"] - usual[x["scene"]]["psnr"],
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
    def by_samples(self) -> Rows:
        """Shots of the seven scenes over the frame alone, by samples; a camera pans."""
        rows = self.read("shots/by-samples.json")["rows"]
        return [x for x in rows if x.get("motion") == "pan" and "flicker_along" in x]

    @cached_property
    def held_out(self) -> Rows:
        """Shots on which no constant was chosen: all methods."""
        return self.read("held-out/results.json")["shots"]

    @cached_property
    def installs(self) -> Rows:
        """Sizes and seconds of installs, the smallest first."""
        return self.read("install.json")["rows"]

    @cached_property
    def same_picture(self) -> Rows:
        """*Same Picture*: seconds and errors."""
        return self.read("shots/same-picture.json")["shots"]

    @cached_property
    def gallery(self) -> Rows:
        """Small shots of what films hold."""
        return self.read("gallery/results.json")["shots"]

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

    def shot_rows(self, motion: str, samples: int, radius: int) -> Rows:
        """Return XRDS' rows of `shots` with their `gain` and `flicker_ratio`.

        Those of a median of three denoised frames for `MEDIAN` in place of a radius.
        """
        rows = only(self.shots["shots"], motion=motion, samples=samples)
        return beside_cycles(rows, radius)

    def gains(self, motion: str, samples: int) -> dict[str, float]:
        """Return what shots of radius 4 gain over Cycles + OIDN, by scene."""
        rows = self.shot_rows(motion, samples, REACH)
        if not rows:  # measured, but kept in the notebook alone
            typed = self.read("shots/gains.json")["gains"]
            rows = only(typed, motion=motion, samples=samples)
        return {x["scene"]: x["gain"] for x in rows}

    def shot_seconds(self, samples: int) -> dict[str, tuple[float, float]]:
        """Return a frame's seconds by scene: Cycles + OIDN, and XRDS at radius 4."""
        rows = only(self.shots["shots"], motion="pan", samples=samples)
        found = {}
        for scene in SCENES:
            of = [x for x in rows if x["scene"] == scene and x["seconds_per_frame"]]
            seconds = {(x["method"], x["radius"]): x["seconds_per_frame"] for x in of}
            found[scene] = (seconds["cycles_oidn_default", 0], seconds["xrds", REACH])
        return found

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
