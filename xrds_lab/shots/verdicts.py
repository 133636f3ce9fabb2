"""Who wins by each measure: XRDS or Cycles + OIDN, and where measures disagree."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .frames import REACH
from .methods import DEFAULT, XRDS
from .paired import MEASURES

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from .paired import Difference

    Verdict = dict[str, Any]

NAMES = {XRDS: "XRDS", DEFAULT: "Cycles + OIDN"}
_COUNTS = {2: "both", 3: "all three", 4: "all four"}


def verdicts(found: Iterable[Difference]) -> list[Verdict]:
    """Who has the smaller error by each measure: XRDS or Cycles + OIDN, of each shot.

    `wins` says by measure whether XRDS does on the mean; `scenes` the same of those
    scenes where a measure says otherwise.
    """
    shots: dict[tuple[str, int], list[Difference]] = {}
    for entry in found:
        if (entry["method"], entry["radius"]) == (XRDS, REACH):
            shots.setdefault((entry["motion"], entry["samples"]), []).append(entry)
    return [
        {"motion": motion, "samples": samples, **_verdict(entries)}
        for (motion, samples), entries in shots.items()
    ]


def _verdict(entries: Sequence[Difference]) -> Verdict:
    mean = {e["measure"]: better(e["mean"], e["measure"]) for e in entries}
    names = list(dict.fromkeys(scene for e in entries for scene in e["scenes"]))
    scenes = {
        name: {
            e["measure"]: better(e["scenes"][name], e["measure"])
            for e in entries
            if name in e["scenes"]
        }
        for name in names
    }
    others = {
        name: wins for name, wins in scenes.items() if not wins.items() <= mean.items()
    }
    return {"wins": mean, "scenes": others}


def better(difference: float, measure: str) -> bool:
    """Whether a difference is for the method; what is alike is for Cycles + OIDN."""
    return difference > 0.0 if measure == "psnr" else difference < 1.0


def sentence(verdict: Verdict) -> str:
    """What the measures say of one shot, and in which scenes they say otherwise."""
    others = [f"{scene} ({_said(wins)})" for scene, wins in verdict["scenes"].items()]
    where = f"; otherwise in {', '.join(others)}" if others else ", in every scene"
    shot = f"`{verdict['motion']}`, {verdict['samples']}"
    return f"{shot}: {_said(verdict['wins'])}{where}."


def _said(wins: Mapping[str, bool]) -> str:
    sides = {
        NAMES[method]: [MEASURES[x] for x, ours in wins.items() if ours == is_ours]
        for method, is_ours in ((XRDS, True), (DEFAULT, False))
    }
    for name, measures in sides.items():
        if len(measures) == len(wins) > 1:
            return f"{_COUNTS[len(wins)]} agree on {name}"
    told = (f"{_listed(found)} for {name}" for name, found in sides.items() if found)
    return ", ".join(told)


def _listed(words: Sequence[str]) -> str:
    return " and ".join(filter(None, [", ".join(words[:-1]), words[-1]]))
