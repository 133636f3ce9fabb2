"""Shots for what cameras do, and for how frames are numbered and sampled."""

from __future__ import annotations

from ..studio.builder import aim
from .stage import EYE, LENS, TARGET, Set, key, over, room, truck

# A hand, by frame: small, without a pattern, about a pixel a step.
_HAND = (
    *(0.0, 0.6, 1.1, 0.7, -0.2, -0.9, -0.6, 0.3, 1.4, 1.9, 1.2, 0.4),
    *(0.1, -0.6, -1.5, -1.1, -0.3, 0.2, 1.0, 0.8, -0.1, -1.2, -1.8, -0.9),
)


def _hand(k: int, axis: int) -> float:
    return _HAND[(k + 7 * axis) % len(_HAND)]


def hand_held(stage: Set) -> None:
    """A camera in a hand: it shakes about all axes."""
    room(stage)
    camera = stage.scene.camera
    x, y, z = camera.location
    turned = tuple(camera.rotation_euler)
    moved = over(lambda k: (x + 0.02 * _hand(k, 3), y, z + 0.012 * _hand(k, 4)))
    key(camera, "location", moved)
    shaken = over(
        lambda k: tuple(a + 0.006 * _hand(k, i) for i, a in enumerate(turned))
    )
    key(camera, "rotation_euler", shaken)


def zoom(stage: Set) -> None:
    """The lens grows by two hundredths in each frame."""
    room(stage)
    key(stage.scene.camera.data, "lens", over(lambda k: LENS * 1.02**k))


def focus_pull(stage: Set) -> None:
    """The focus goes from the wall to the things before it."""
    room(stage)
    lens = stage.scene.camera.data
    lens.lens, lens.dof.use_dof, lens.dof.aperture_fstop = 40, True, 0.6
    key(lens.dof, "focus_distance", over(lambda k: 4.6 - 0.25 * k))
    truck(stage, 0.01)


def lens_shift(stage: Set) -> None:
    """The lens is shifted to the side, as for buildings."""
    room(stage)
    key(stage.scene.camera.data, "shift_x", over(lambda k: 0.008 * k))


def orthographic(stage: Set) -> None:
    """An orthographic camera that moves."""
    room(stage)
    lens = stage.scene.camera.data
    lens.type, lens.ortho_scale = "ORTHO", 5.0
    truck(stage)


def panorama(stage: Set) -> None:
    """An equirectangular camera in the midst of the room, which moves."""
    room(stage)
    camera = stage.scene.camera
    aim(camera, (0.2, -1.0, 1.3), (0.2, 4.0, 1.3))
    camera.data.type = "PANO"
    held = camera.data if hasattr(camera.data, "panorama_type") else camera.data.cycles
    held.panorama_type = "EQUIRECTANGULAR"
    truck(stage, 0.05)


def cut(stage: Set) -> None:
    """Markers change to another camera at the middle frame."""
    room(stage)
    truck(stage)
    first = stage.scene.camera
    second = stage.camera((2.6, -3.0, 2.2), (-0.4, 1.0, 0.6), LENS)
    truck(stage)
    stage.scene.camera = first
    for frame, camera in ((-9, first), (5, second)):
        stage.scene.timeline_markers.new(f"F{frame}", frame=frame).camera = camera


def stereo(stage: Set) -> None:
    """Two eyes, which lend to each other as well; the left one is judged."""
    room(stage)
    truck(stage)
    stage.scene.render.use_multiview = True
    stage.scene.render.views_format = "STEREO_3D"
    eyes = stage.scene.camera.data.stereo
    eyes.convergence_distance, eyes.interocular_distance = 4.5, 0.065


def adaptive_default(stage: Set) -> None:
    """Adaptive sampling as Blender's default has it: threshold 0.01."""
    room(stage)
    truck(stage)
    _adaptive(stage, 0.01)


def adaptive_rough(stage: Set) -> None:
    """Adaptive sampling that ends early: threshold 0.2, up to 4096 samples."""
    room(stage)
    truck(stage)
    _adaptive(stage, 0.2)


def _adaptive(stage: Set, threshold: float) -> None:
    cycles = stage.scene.cycles
    cycles.use_adaptive_sampling = True
    cycles.adaptive_threshold, cycles.adaptive_min_samples = threshold, 0


def on_twos(stage: Set) -> None:
    """Every second frame is rendered: a step of two."""
    from . import bending

    room(stage)
    bending.walker(stage, (0.1, -0.7, 0.0))
    truck(stage, 0.01)
    stage.scene.frame_start, stage.scene.frame_end, stage.scene.frame_step = 1, 17, 2
    aim(stage.scene.camera, EYE, TARGET)


def slow_pan(stage: Set) -> None:
    """The camera pans over a room where nothing is hard: a shot that must gain."""
    room(stage)
    camera = stage.scene.camera
    turned = tuple(camera.rotation_euler)
    panned = over(lambda k: (*turned[:2], turned[2] - 0.006 * k))
    key(camera, "rotation_euler", panned)
