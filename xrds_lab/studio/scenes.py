"""Random scenes by number: the same seed and assets give the same scene."""

from __future__ import annotations

import random
from pathlib import Path

import bpy
from mathutils import Vector

from . import clutter, dark, outdoor, rooms, still
from .assets import Library
from .builder import aim, use_cycles
from .stage import Stage, View

VERSION = 2  # of the recipes; written into every data file
FRAMES = (
    (1920, 1080),
    (1920, 1080),
    (1920, 1080),
    (1920, 1280),
    (1440, 1920),
    (1920, 816),
)
RECIPES = {
    "room": (rooms.build, 5),
    "still": (still.build, 3),
    "outdoor": (outdoor.build, 2.5),
    "dark": (dark.build, 1.5),
    "clutter": (clutter.build, 2),
}


def build_scene(
    seed: int, assets: str | Path | None = None, kind: str | None = None
) -> Stage:
    """Replace the open file by random scene `seed`; its views are in `Stage.views`.

    `assets` is a folder as Library describes, `kind` one of RECIPES (any if None).
    All data of the file open before is lost. Frames are 1920 px on the long side.
    """
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    rng = random.Random(seed)
    library = Library.at(assets) if assets is not None else None
    stage = Stage(bpy.context.scene, rng, library)
    weights = [weight for _, weight in RECIPES.values()]
    drawn = rng.choices(list(RECIPES), weights)[0]
    stage.kind = kind or drawn
    RECIPES[stage.kind][0](stage)
    _settings(stage)
    _camera(stage)
    return stage


def _settings(stage: Stage) -> None:
    scene, cycles = stage.scene, stage.scene.cycles
    use_cycles(scene, *stage.rng.choice(FRAMES))
    scene.render.use_persistent_data = True
    cycles.max_bounces, cycles.diffuse_bounces, cycles.glossy_bounces = 6, 2, 3
    cycles.transmission_bounces, cycles.transparent_max_bounces = 6, 8
    cycles.use_light_tree = stage.chance(0.2)  # a third to a half of a sample's time
    cycles.volume_bounces = 0
    cycles.caustics_reflective = cycles.caustics_refractive = stage.chance(0.25)
    if stage.chance(0.06):
        _moving(stage)


def _moving(stage: Stage) -> None:
    """Motion blur by a third of the things drifting."""
    stage.scene.render.use_motion_blur = True
    things = [thing for thing in stage.scene.objects if thing.type == "MESH"]
    for thing in stage.rng.sample(things, len(things) // 3):
        drift = Vector(stage.rng.gauss(0, 0.03) for _ in range(3))
        for frame, way in ((0, -1), (2, 1)):
            thing.location = thing.location + drift * way
            thing.keyframe_insert("location", frame=frame)
    stage.scene.frame_set(1)


def _camera(stage: Stage) -> None:
    stage.scene.camera = stage.link("camera", bpy.data.cameras.new("camera"))
    good = [view for view in stage.views if clear(stage, view)]
    stage.views = good or stage.views
    show(stage, stage.views[0])


def clear(stage: Stage, view: View) -> bool:
    """True if nothing stands right before the camera in the middle of its picture."""
    eye = Vector(view.eye)
    return _hit(stage, eye, Vector(view.target) - eye) > 0.5


def _hit(stage: Stage, eye: Vector, way: Vector) -> float:
    graph = bpy.context.evaluated_depsgraph_get()
    hit, spot, *_ = stage.scene.ray_cast(graph, eye, way.normalized())
    return (spot - eye).length if hit else 1e3


def show(stage: Stage, view: View) -> None:
    """Set the scene's camera to a view."""
    camera = stage.scene.camera
    aim(camera, view.eye, view.target, stage.rng.gauss(0, 0.02))
    data = camera.data
    data.lens, data.clip_start = view.lens, 0.01
    data.dof.use_dof = view.fstop > 0
    data.dof.aperture_fstop = view.fstop or 2.8
    way = Vector(view.target) - Vector(view.eye)
    data.dof.focus_distance = min(_hit(stage, Vector(view.eye), way), way.length * 2)
