"""One process of the plan's report: a still, an animation or a look-dev session."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

LOOKS = (1.0, 0.5, 2.0, 0.25, 1.5)  # factors on the lamps of a look-dev session
FRAMES = 10


def main() -> None:
    """Render as the JSON on the command line asks; write pictures to its `out`."""
    from xrds_blender import render
    from xrds_blender.command.console import leave

    request = json.loads(sys.argv[1])
    setting, out = request["setting"], Path(request["out"])
    scene = _scene(request["scene"], setting)
    _warm_up(scene, setting)
    frames = []
    for index, number in enumerate(_steps(scene, request["kind"])):
        picture = render(
            scene,
            setting["scale"],
            samples=setting["samples"],
            guide_samples=setting["guide_samples"],
            seed=request["seed"] + number,
            savings=tuple(request["savings"]),
        )
        np.save(out / f"{index}.npy", picture.radiance)
        plan = [asdict(each) for each in picture.plan]
        frames.append({"seconds": picture.seconds, "plan": plan})
    (out / "frames.json").write_text(json.dumps(frames), "utf-8")
    leave(0)


def _warm_up(scene: Any, setting: dict[str, Any]) -> None:
    """Load Cycles, OIDN and torch, so that no stage pays for being the first."""
    from xrds_blender import render

    scene.render.resolution_percentage = 10
    render(scene, setting["scale"], samples=1, guide_samples=1)
    scene.render.resolution_percentage = 100


def _scene(name: str, setting: dict[str, Any]) -> Any:
    """Open a file or build one of the small scenes, at the report's size."""
    from xrds_blender.command.scene_file import open_scene

    from ..studio import traps

    size = setting["width"], setting["height"]
    if not name.endswith(".blend"):
        return traps.trap(name, *size)
    scene = open_scene(Path(name))
    upright = scene.render.resolution_x < scene.render.resolution_y
    scene.render.resolution_x, scene.render.resolution_y = size[:: -1 if upright else 1]
    scene.render.resolution_percentage = 100
    return scene


def _steps(scene: Any, kind: str) -> Iterator[int]:
    """Change the scene before each render, as its kind needs it."""
    import bpy

    if kind == "still":
        yield 0
        return
    if kind == "look-dev":
        lamps = list(bpy.data.lights)
        energies = [lamp.energy for lamp in lamps]
        for index, factor in enumerate(LOOKS):
            for lamp, energy in zip(lamps, energies, strict=True):
                lamp.energy = energy * factor
            yield index
        return
    for frame in range(1, FRAMES + 1):
        scene.frame_set(frame)
        yield frame


if __name__ == "__main__":
    main()
