"""What XRDS does otherwise than Cycles, as far as a scene asks for it.

Pure questions to a scene; the panel shows the answers, docs/compatibility.md lists all.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

LIGHTS = ("diffuse", "glossy", "transmission")


def notes(scene: Any) -> Iterator[str]:
    """One sentence for each thing that this scene gets otherwise than expected."""
    for asks, sentence in _NOTES:
        if asks(scene):
            yield sentence


def _layers(scene: Any) -> list[Any]:
    return [layer for layer in scene.view_layers if layer.use]


def _uses_light_passes(scene: Any) -> bool:
    names = [f"use_pass_{light}_{bounce}" for light in LIGHTS for bounce in _BOUNCES]
    names += ["use_pass_ambient_occlusion", "use_pass_shadow"]
    own = ("use_pass_volume_direct", "use_pass_volume_indirect")
    own += ("use_pass_shadow_catcher",)
    return any(
        any(getattr(layer, name, False) for name in names)
        or any(getattr(layer.cycles, name, False) for name in own)
        or bool(layer.lightgroups)
        for layer in _layers(scene)
    )


_BOUNCES = ("direct", "indirect")


def _is_panorama(scene: Any) -> bool:
    return scene.camera is not None and scene.camera.data.type == "PANO"


def _has_time_limit(scene: Any) -> bool:
    return bool(scene.cycles.time_limit)


def _has_freestyle(scene: Any) -> bool:
    return bool(scene.render.use_freestyle)


_NOTES: tuple[tuple[Callable[[Any], bool], str], ...] = (
    (
        _uses_light_passes,
        "Light passes are those of the low-resolution picture, enlarged without the "
        "network",
    ),
    (
        _has_time_limit,
        "The time limit covers the low-resolution picture only; guides and network add "
        "to it",
    ),
    (
        _is_panorama,
        "A panorama's low-resolution picture is resampled, so its edges are less sharp",
    ),
    (
        _has_freestyle,
        "Freestyle draws its lines at full size, over the finished picture",
    ),
)
