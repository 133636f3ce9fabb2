"""`xrds stability`: every check over every shipped preset, scale and precision."""

from __future__ import annotations

import json
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import xrds_core
from xrds_blender.command import console
from xrds_core.errors import UsageError
from xrds_core.files import read_json, write_json
from xrds_core.progress import Clock

from ..checksum import checksum
from ..progress import silent
from . import hues, lies, light, sameness, shapes, spoilt
from .bounds import STIFF, is_bound, judge

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from ..progress import Progress
    from .accumulation import FullSize
    from .bounds import Check
    from .measured import Measured
    from .subject import Subject

    Judged = Subject | FullSize
    Work = Callable[[Any], Iterator[Measured]]
    Key = tuple[str, str]  # of a value and a subject

GROUPS: dict[str, tuple[Work, ...]] = {
    "light": light.CHECKS,
    "spoilt": spoilt.CHECKS,
    "hues": hues.CHECKS,
    "lies": lies.CHECKS,
    "shapes": shapes.CHECKS,
    "sameness": sameness.CHECKS,
}
# Arrays alone; 8192 x 8192; scenes, shots and a long shot that Blender renders; frames
# at full size that lend each other their samples.
PARTS = ("arrays", "large", "scenes", "shots", "load", "accumulation")
SIDE = 256  # pixels of rendered scenes along one side; shots are half as wide
ARRAY_SIDE = 128
_QUICK = ("fast", 2)  # the preset and scale that are judged alone, in single precision


def checks(subject: Judged, work: Work) -> Iterator[tuple[Check, Measured]]:
    """Yield every value of one check with its verdict."""
    for measured in work(subject):
        verdict = judge(
            measured.name,
            measured.value,
            subject.preset,
            subject.scale,
            subject.precision,
        )
        yield verdict, measured


def stability(
    out: Path,
    *,
    parts: Sequence[str] = PARTS,
    cache: Path | None = None,
    device: str = "auto",
    weights: Path | None = None,
    quick: bool = False,
    resume: bool = False,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Measure all, write the report into `out` and return the JSON's content.

    Args:
        out: folder for results.json, report.md and plots; made if need be.
        parts: of `PARTS`.
        cache: folder that keeps rendered pictures; `out`/rendered by default.
        device: as `Upscaler`'s.
        weights: a folder of presets in place of the shipped.
        quick: of the networks `fast` x2 in single precision alone.
        resume: leave out what the same code and weights have measured into `out`.
        progress: gets a line of text, with the time left, after every check. What is
            printed on stdout goes to `out`/blender.log.

    Values of the same weights that `out` holds from an earlier run, as of other
    parts, stay in the report. Raises UsageError for unknown parts, WeightsError for
    damaged weights.
    """
    from xrds_core.superres.weights_header import available

    from . import report

    unknown = set(parts) - set(PARTS)
    if unknown:
        raise UsageError(f"{sorted(unknown)} is none of {', '.join(PARTS)}")
    out.mkdir(parents=True, exist_ok=True)
    records = available(weights)
    verdicts, curves = _earlier(out / "results.json", records)
    rendered = cache or out / "rendered"
    done = _Done(out / "done.json", records, resume)
    todo = [
        (subject, name, work)
        for subject, works in _subjects(
            parts, rendered, device, weights, quick, progress
        )
        for name, work in works
        if not done.holds(subject.name, name)
    ]

    def told(device: object) -> dict[str, Any]:
        return {
            "checks": [vars(check) for check in verdicts.values()],
            "curves": [
                {"name": name, "subject": of, "points": [*map(list, curve.items())]}
                for (name, of), curve in curves.items()
            ],
            "machine": _machine(device),
            "weights": records,
            "passed": all(check.holds for check in verdicts.values()),
        }

    clock = Clock()
    for number, (subject, name, work) in enumerate(todo, start=1):
        with console.stdout_to(out / "blender.log"):  # it prints every sample
            judged = list(checks(subject, work))
        for check, measured in judged:
            verdicts[check.name, subject.name] = check
            if measured.curve:
                curves[check.name, subject.name] = measured.curve
            if not check.passed:
                progress(f"{subject.name}: {check.name} is {check.value:.3g}")
        # after each of them: what an interrupt leaves holds those before
        write_json(out / "results.json", told(subject.device))
        done.add(subject.name, name)
        progress(f"{subject.name}: {name} done, {clock.lap(len(todo) - number)}")
    result = told(todo[-1][0].device if todo else device)
    report.write(out, result, list(verdicts.values()))
    return result


class _Done:
    """What is measured, in a file; it holds for the same code and weights."""

    def __init__(self, path: Path, weights: list[dict[str, Any]], resume: bool) -> None:
        sources = Path(xrds_core.__file__).parent.rglob("*.py")
        code = checksum([*sources, *Path(__file__).parent.glob("*.py")])
        self._path, self._of = path, {"code": code, "weights": weights}
        self._names: list[list[str]] = []
        try:
            found = read_json(path)
            if resume and found["of"] == self._of:
                self._names = found["done"]
        except (OSError, ValueError, KeyError, TypeError):
            pass

    def holds(self, subject: str, work: str) -> bool:
        """Whether it is done."""
        return [subject, work] in self._names

    def add(self, subject: str, work: str) -> None:
        """Note that it is done."""
        self._names.append([subject, work])
        write_json(self._path, {"of": self._of, "done": self._names})


def _earlier(
    path: Path, weights: list[dict[str, Any]]
) -> tuple[dict[Key, Check], dict[Key, dict[float, float]]]:
    """Return the results of an earlier run with the same weights."""
    try:
        result = json.loads(path.read_text())
        if result["weights"] != weights:
            return {}, {}
        verdicts = [
            judge(*(x[k] for k in ("name", "value", "preset", "scale", "precision")))
            for x in result["checks"]
            if is_bound(x["name"])  # not of a check that is no more
        ]
        curves = {
            (x["name"], x["subject"]): dict(x["points"]) for x in result["curves"]
        }
    except (OSError, ValueError, KeyError, TypeError):
        return {}, {}
    return {
        (c.name, f"{c.preset} x{c.scale} {c.precision}"): c for c in verdicts
    }, curves


def _subjects(
    parts: Sequence[str],
    folder: Path,
    device: str,
    weights: Path | None,
    quick: bool,
    progress: Progress,
) -> Iterator[tuple[Judged, list[tuple[str, Work]]]]:
    """Yield what is judged, each with its checks."""
    from .subject import PRECISIONS, shipped

    if "accumulation" in parts:
        from .accumulation import FullSize

        yield FullSize(), list(_accumulation())
    works = list(_works(parts, folder, weights, progress))
    if works:
        for subject in shipped(
            PRECISIONS[:1] if quick else PRECISIONS,
            directory=weights,
            device=device,
            side=ARRAY_SIDE,
            thorough=True,
            only=_QUICK if quick else None,
        ):
            yield subject, works


def _accumulation() -> Iterator[tuple[str, Work]]:
    from . import accumulation, broken_shots
    from .moving_scenes import SHOTS

    for name in SHOTS:
        yield name, lambda _, name=name: accumulation.shot(name)
    yield "fisheye", lambda _: accumulation.fisheye()
    yield "broken shots", lambda _: broken_shots.shots()


def _works(
    parts: Sequence[str], folder: Path, weights: Path | None, progress: Progress
) -> Iterator[tuple[str, Work]]:
    if "arrays" in parts:
        for group in GROUPS.values():
            yield from ((work.__name__, work) for work in group)
    if "large" in parts:
        from .large import large

        yield "large", large
    if "scenes" in parts:
        yield from _scenes(folder, progress)
    if "shots" in parts:
        yield from _shots(folder, progress)
    if "load" in parts:
        from .load import load

        yield "load", partial(load, weights=weights)


def _scenes(folder: Path, progress: Progress) -> Iterator[tuple[str, Work]]:
    from . import stiff

    gallery = stiff.Gallery(folder, SIDE, progress)
    for name in STIFF:
        yield (
            name,
            lambda subject, name=name: stiff.scene(subject, name, gallery.arrays(name)),
        )
    yield "rising", lambda subject: stiff.rising(subject, gallery.arrays("caustics"))


def _shots(folder: Path, progress: Progress) -> Iterator[tuple[str, Work]]:
    from . import shots

    load = partial(shots.frames, folder, side=SIDE // 2, progress=progress)
    for name in shots.SHOTS:
        yield (
            name,
            lambda subject, name=name: shots.shot(subject, name, load(name=name)),
        )
    yield "held", lambda subject: shots.held(subject, load(name="flickering"))


def _machine(device: object) -> dict[str, Any]:
    import torch

    blender = sys.modules.get("bpy")
    return {
        "torch": torch.__version__,
        "blender": blender.app.version_string if blender else None,
        "device": str(device),
    }
