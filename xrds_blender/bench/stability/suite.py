"""`xrds stability`: every check over every shipped preset, scale and precision."""

from __future__ import annotations

import sys
from functools import partial
from typing import TYPE_CHECKING, Any

from xrds_core.errors import UsageError

from . import hues, lies, light, sameness, shapes, spoilt
from .bounds import STIFF, judge

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from .bounds import Check
    from .measured import Measured
    from .subject import Subject

    Work = Callable[[Subject], Iterator[Measured]]
    Say = Callable[[str], object]

GROUPS: dict[str, tuple[Work, ...]] = {
    "light": light.CHECKS,
    "spoilt": spoilt.CHECKS,
    "hues": hues.CHECKS,
    "lies": lies.CHECKS,
    "shapes": shapes.CHECKS,
    "sameness": sameness.CHECKS,
}
# Arrays alone; 8192 x 8192; scenes and shots that Blender renders.
PARTS = ("arrays", "large", "scenes", "shots")
SIDE = 256  # pixels of rendered scenes along one side; shots are half as wide
ARRAY_SIDE = 128


def checks(subject: Subject, work: Work) -> Iterator[tuple[Check, Measured]]:
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
    side: int = SIDE,
    device: str = "auto",
    weights: Path | None = None,
    progress: Say | None = None,
) -> dict[str, Any]:
    """Measure all, write the report into ``out`` and return the JSON's content.

    Args:
        out: folder for results.json, report.md and plots; made if need be.
        parts: of `PARTS`.
        cache: folder that keeps rendered pictures; ``out``/rendered by default.
        side: pixels of the rendered scenes along one side.
        device: as `Upscaler`'s.
        weights: a folder of presets in place of the shipped.
        progress: given one line of text after every check.

    Raises UsageError for unknown parts, WeightsError for damaged weights.
    """
    from xrds_core.weights import available

    from . import report
    from .subject import shipped

    unknown = set(parts) - set(PARTS)
    if unknown:
        raise UsageError(f"{sorted(unknown)} is none of {', '.join(PARTS)}")
    out.mkdir(parents=True, exist_ok=True)
    say = progress or (lambda _: None)
    works = list(_works(parts, cache or out / "rendered", side, say))
    found: list[tuple[Check, Measured]] = []
    told: dict[str, Any] = {}
    subjects = shipped(directory=weights, device=device, side=ARRAY_SIDE, thorough=True)
    for subject in subjects:
        for name, work in works:
            for check, measured in checks(subject, work):
                found.append((check, measured))
                if not check.passed:
                    say(f"{subject.name}: {check.name} is {check.value:.3g}")
            say(f"{subject.name}: {name} done")
        # after each of them: what an interrupt leaves is a report of those before
        told = _told(found, subject.upscaler.device, available(weights))
        report.write(out, told, [check for check, _ in found])
    return told


def _told(
    found: list[tuple[Check, Measured]], device: object, weights: list[dict[str, Any]]
) -> dict[str, Any]:
    return {
        "checks": [vars(check) for check, _ in found],
        "curves": [_curve(*pair) for pair in found if pair[1].curve],
        "machine": _machine(device),
        "weights": weights,
        "passed": all(check.holds for check, _ in found),
    }


def _works(
    parts: Sequence[str], folder: Path, side: int, say: Say
) -> Iterator[tuple[str, Work]]:
    if "arrays" in parts:
        for group in GROUPS.values():
            yield from ((work.__name__, work) for work in group)
    if "large" in parts:
        from .large import large

        yield "large", large
    if "scenes" in parts:
        yield from _scenes(folder, side, say)
    if "shots" in parts:
        yield from _shots(folder, side, say)


def _scenes(folder: Path, side: int, say: Say) -> Iterator[tuple[str, Work]]:
    from . import stiff

    gallery = stiff.Gallery(folder, side, say)
    for name in STIFF:
        yield (
            name,
            lambda subject, name=name: stiff.scene(subject, name, gallery.arrays(name)),
        )
    yield "rising", lambda subject: stiff.rising(subject, gallery.arrays("caustics"))


def _shots(folder: Path, side: int, say: Say) -> Iterator[tuple[str, Work]]:
    from . import shots

    load = partial(shots.frames, folder, side=side // 2, say=say)
    for name in shots.SHOTS:
        yield (
            name,
            lambda subject, name=name: shots.shot(subject, name, load(name=name)),
        )
    yield "held", lambda subject: shots.held(subject, load(name="flickering"))


def _curve(check: Check, measured: Measured) -> dict[str, Any]:
    subject = f"{check.preset} x{check.scale} {check.precision}"
    points = [[x, y] for x, y in (measured.curve or {}).items()]
    return {"name": check.name, "subject": subject, "points": points}


def _machine(device: object) -> dict[str, Any]:
    import torch

    blender = sys.modules.get("bpy")
    return {
        "torch": torch.__version__,
        "blender": blender.app.version_string if blender else None,
        "device": str(device),
    }
