"""Makes a shot of an open scene; its middle frame is the file's own view.

So the scene's reference picture judges that frame. Needs Blender.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import bpy
from mathutils import Matrix, Vector

from xrds_core.errors import SceneError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from ..bench.windows import Window

FILE = "file"
MADE = {
    "pan": "the camera trucks and turns, 2 to 5 pixels a frame",
    "fast": "the same, four times as far",
    "still": "nothing moves",
    "objects": "a still camera; up to three small objects move 3 pixels a frame",
    "both": "the camera as in pan, and the objects",
}
"""Each motion that is made here, and what moves in it."""
MOTIONS = {**MADE, FILE: "what the file itself animates, around its current frame"}
FAST = 4.0  # times pan
_TRUCK = 0.01  # metres per frame
_LARGEST_TRUCK = 0.01  # of the middle distance: a small scene would leap
_TURN = 0.02  # degrees per frame
_OBJECT_STEP = 3  # pixels per frame
_OBJECTS = 3  # that move at most
_SMALL = 0.3  # largest size of an object that moves, of its distance: no walls
_RAYS = (12, 8)  # across and down the window
_RIM = 1  # frames beyond the ends that the motion goes on for: vectors lead there


def animate(
    scene: Any, window: Window, motion: str, middle: int, reach: int
) -> list[str]:
    """Animate frames `middle` - `reach` to `middle` + `reach`; return what moves.

    All animation of the file is taken away: things stay where its current frame has
    them. Simulations are not: bake them. With the motion of the file nothing is done:
    its current frame stays the middle one. Raises SceneError where `motion` asks for
    small objects and the window shows none.
    """
    if motion == FILE:
        return []
    graph = bpy.context.evaluated_depsgraph_get()
    view = graph.objects[scene.camera.name].matrix_world.copy()
    seen = _seen(scene, graph, window)
    chosen = _chosen(seen) if motion in {"objects", "both"} else []
    if motion in {"objects", "both"} and not chosen:
        raise SceneError(f"the window of {scene.name!r} shows no small object to move")
    _hold(scene, view)
    frames = range(middle - reach - _RIM, middle + reach + _RIM + 1)
    pixel = 2 * math.tan(scene.camera.data.angle_x / 2) / window.frame_width
    right = (view.to_3x3() @ Vector((1, 0, 0))).normalized()
    for thing in chosen:
        step = right * (_OBJECT_STEP * pixel * thing.distance)
        _move_object(thing, step, middle, frames)
    if motion in {"pan", "fast", "both"}:
        step = FAST if motion == "fast" else 1.0
        _move_camera(scene.camera, view, step, _truck(seen), middle, frames)
    scene.frame_start, scene.frame_end = middle - reach, middle + reach
    scene.render.use_motion_blur = False
    scene.frame_set(middle)
    return [thing.name for thing in chosen]


@dataclass
class _Seen:
    """An object of the scene that rays hit: itself, or what it instances."""

    item: Any
    place: Matrix
    distances: list[float] = field(default_factory=list)
    corners: list[Vector] = field(default_factory=list)

    @property
    def name(self) -> str:
        return str(self.item.name)

    @property
    def distance(self) -> float:
        return sum(self.distances) / len(self.distances)

    @property
    def size(self) -> float:
        """The longest side of the box around it along the world's axes."""
        axes = zip(*self.corners, strict=True)
        return max(max(axis) - min(axis) for axis in axes)


def _seen(scene: Any, graph: Any, window: Window) -> dict[str, _Seen]:
    """Objects that the window shows, by name."""
    owners = {}
    found: dict[str, _Seen] = {}
    for each in graph.object_instances:
        owner = (each.parent if each.is_instance else each.object).original
        shown, place = each.object, each.matrix_world.copy()
        owners[_instance(shown.original, place)] = owner.name
        if owner.name in scene.objects and shown.type == "MESH":
            own = graph.objects[owner.name].matrix_world.copy()
            entry = found.setdefault(owner.name, _Seen(scene.objects[owner.name], own))
            entry.corners += [place @ Vector(corner) for corner in shown.bound_box]
    eye = graph.objects[scene.camera.name].matrix_world.translation
    for ray in _rays(scene, graph, window):
        hit, spot, _, _, thing, place = scene.ray_cast(graph, eye, ray)
        name = owners.get(_instance(thing.original, place)) if hit else None
        if name in found:
            found[name].distances.append((spot - eye).length)
    return {name: thing for name, thing in found.items() if thing.distances}


def _instance(item: Any, place: Matrix) -> tuple[Any, ...]:
    """What tells one instance of an object from the others."""
    return item.name, *(round(x, 4) for row in place for x in row)


def _rays(scene: Any, graph: Any, window: Window) -> Iterator[Vector]:
    """Directions from the eye through the window, evenly spread."""
    width, height = window.frame_width, window.frame_height
    camera = graph.objects[scene.camera.name]
    project = scene.camera.calc_matrix_camera(graph, x=width, y=height)
    back = (project @ camera.matrix_world.inverted()).inverted()
    for i in range(_RAYS[0]):
        for j in range(_RAYS[1]):
            across = (window.x + (i + 0.5) * window.width / _RAYS[0]) / width * 2 - 1
            up = 1 - (window.y + (j + 0.5) * window.height / _RAYS[1]) / height * 2
            far = back @ Vector((across, up, 0.9, 1))
            ray = far.xyz / far.w - camera.matrix_world.translation
            yield ray.normalized()


def _chosen(seen: dict[str, _Seen]) -> list[_Seen]:
    """The small things that cover most of the window."""
    small = [x for x in seen.values() if x.size < _SMALL * x.distance]
    small.sort(key=lambda x: (-len(x.distances), x.name))
    return small[:_OBJECTS]


def _truck(seen: dict[str, _Seen]) -> float:
    """Metres per frame; less in a scene so small that it would be a leap."""
    distances = sorted(d for thing in seen.values() for d in thing.distances)
    if not distances:
        return _TRUCK
    return min(_TRUCK, _LARGEST_TRUCK * distances[len(distances) // 2])


def _hold(scene: Any, view: Matrix) -> None:
    """Take all animation away, and from the camera what else could move it."""
    for owner in _animated():
        owner.animation_data_clear()
    camera = scene.camera
    camera.constraints.clear()
    camera.parent = None
    camera.matrix_world = view


def _animated() -> Iterator[Any]:
    """All data of the file that has animation, node trees inside of others too."""
    kinds = (x for x in bpy.data.bl_rna.properties if x.type == "COLLECTION")
    for kind in kinds:
        for item in getattr(bpy.data, kind.identifier):
            for owner in (item, getattr(item, "node_tree", None)):
                if getattr(owner, "animation_data", None) is not None:
                    yield owner


def _move_camera(
    camera: Any,
    view: Matrix,
    step: float,
    truck: float,
    middle: int,
    frames: Iterable[int],
) -> None:
    camera.rotation_mode = "QUATERNION"
    for frame in frames:
        k = (frame - middle) * step
        turn = Matrix.Rotation(math.radians(-_TURN * k), 4, "Y")
        way = Matrix.Translation((truck * k, 0, truck / 2 * k))
        camera.matrix_world = view @ way @ turn
        camera.keyframe_insert("location", frame=frame)
        camera.keyframe_insert("rotation_quaternion", frame=frame)
    camera.matrix_world = view


def _move_object(
    thing: _Seen, step: Vector, middle: int, frames: Iterable[int]
) -> None:
    item = thing.item
    item.parent = None
    item.constraints.clear()
    item.matrix_world = thing.place
    start = item.location.copy()
    for frame in frames:
        item.location = start + step * (frame - middle)
        item.keyframe_insert("location", frame=frame)
    item.location = start
