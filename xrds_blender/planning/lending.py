"""What frames of a shot can lend to each other, and what is left out by pixel.

Pure functions of facts, as in `plan`.
"""

from __future__ import annotations

from collections.abc import Collection

from .facts import Facts, SceneFacts
from .plan import Decision

_SHOWN = 6  # cuts that are named; more would not help a reader


def lending(
    facts: Facts, radius: int, cuts: Collection[int] = ()
) -> tuple[Decision, ...]:
    """The decisions of a shot whose frames lend up to `radius` frames to each side.

    `cuts` are the frames at which another camera begins.
    """
    name, scene = "accumulation", facts.scene
    if not facts.lends:
        reason = "nothing tells where this panorama shows a place: each frame is alone"
        return (Decision(name, "none", reason),)
    value = f"{radius} frames to each side"
    if not scene.moving:
        reason = "nothing moves: frames differ in noise alone, and every sample counts"
        return (Decision(name, value, reason), *_cuts(cuts))
    reason = "pixels are found again by depth, cameras and motion, if the light agrees"
    return (Decision(name, value, reason), *_in_part(scene), *_cuts(cuts))


def _in_part(scene: SceneFacts) -> tuple[Decision, ...]:
    """What lends less, each thing with its reason."""
    causes = {
        "motion blur": (
            scene.motion_blur,
            "Cycles gives no vectors with motion blur: what moves lends where it fits",
        ),
        "depth of field": (scene.depth_of_field, "blurred pixels mix many depths"),
        "volumes": (
            scene.volumes,
            "volumes have no depth: they lend with the surface behind them",
        ),
        "hair": (scene.hair, "hair, finer than a pixel, is found again by chance"),
        "mirrors and glass": (
            scene.smooth,
            "what mirrors and glass show moves otherwise than they do",
        ),
    }
    found = {what: reason for what, (there, reason) in causes.items() if there}
    if not found:
        return ()
    reason = "; ".join(found.values())
    return (Decision("left out by pixel", ", ".join(found), reason),)


def _cuts(cuts: Collection[int]) -> tuple[Decision, ...]:
    if not cuts:
        return ()
    shown = ", ".join(map(str, sorted(cuts)[:_SHOWN]))
    more = "" if len(cuts) <= _SHOWN else f" and {len(cuts) - _SHOWN} more"
    reason = "a marker binds another camera: nothing is lent across"
    return (Decision("cuts", f"frame {shown}{more}", reason),)
