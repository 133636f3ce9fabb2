"""A scene whose light lies in parts."""

from __future__ import annotations

from typing import Any


def with_light_passes(scene: Any) -> Any:
    """A scene with all lobes, and two light groups that hold all light."""
    layer = scene.view_layers[0]
    for lobe in ("diffuse", "glossy", "transmission"):
        for kind in ("direct", "indirect", "color"):
            setattr(layer, f"use_pass_{lobe}_{kind}", True)
    layer.use_pass_emit = layer.use_pass_environment = True
    for name in ("lamps", "world"):
        layer.lightgroups.add(name=name)
    for item in scene.objects:
        item.lightgroup = "lamps"
    scene.world.lightgroup = "world"
    return scene
