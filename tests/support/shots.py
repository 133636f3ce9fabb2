"""A small world whose every frame is known exactly, for tests of accumulation.

A textured wall far away, a textured card in front of it that may move, and sky beyond
the wall's edges. What a frame shows at a pixel's centre is worked out by intersecting
rays, so nothing here uses the code under test.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import cos, sin

import numpy as np
from numpy.typing import NDArray

from xrds_core.accumulation.camera import Camera
from xrds_core.accumulation.frame import Frame

Array = NDArray[np.float32]
Matrix = NDArray[np.float64]

WIDTH, HEIGHT = 64, 48
FOCUS = 2.0  # clip units: half a frame's width is seen at distance 1 / FOCUS * distance
PIXEL = 2.0 / (FOCUS * WIDTH)  # width of a pixel at distance 1
WALL, CARD = 1, 2  # names in the index


def camera(
    x: float = 0.0,
    y: float = 0.0,
    z: float = 0.0,
    yaw: float = 0.0,
    orthographic: bool = False,
    window: tuple[int, int] = (0, 0),
) -> Camera:
    """A camera at (x, y, z) that looks along -Z, turned to the left by ``yaw``."""
    world = np.eye(4)
    world[:3, :3] = [[cos(yaw), 0, sin(yaw)], [0, 1, 0], [-sin(yaw), 0, cos(yaw)]]
    world[:3, 3] = x, y, z
    down = FOCUS * WIDTH / HEIGHT
    project = np.diag([FOCUS, down, -1.0, 0.0])
    project[2, 3], project[3, 2] = -0.2, -1.0
    if orthographic:
        project = np.diag([0.2, 0.2 * WIDTH / HEIGHT, -0.01, 1.0])
    return Camera(np.linalg.inv(world), project, (WIDTH, HEIGHT), window)


@dataclass(frozen=True)
class World:
    """What there is at one moment; lengths in world units."""

    card: tuple[float, float] | None = None  # its middle
    card_half: float = 0.8
    card_z: float = -5.0
    wall_z: float = -10.0
    wall_half: float = 50.0
    light: float = 1.0


@dataclass(frozen=True)
class View:
    """A frame, and the world point, name and colour at each pixel's centre."""

    frame: Frame
    point: Matrix
    name: NDArray[np.int32]
    colour: Array = field(repr=False)


def view(
    number: int,
    eye: Camera,
    world: World | None = None,
    noise: float = 0.0,
    shape: tuple[int, int] = (HEIGHT, WIDTH),
    **more: object,
) -> View:
    """Render a frame; ``noise`` is the standard deviation that its radiance gets."""
    world = world or World()
    start, ray = _rays(eye, shape)
    point, name = _hits(world, start, ray)
    colour = _texture(point, name, world)
    depth = -(np.concatenate([point, np.ones((*shape, 1))], -1) @ eye.view[2])
    depth = np.where(name == 0, 1e10, depth).astype(np.float32)
    normal = np.zeros((*shape, 3)) + (np.array([0, 0, 1]) @ eye.view[:3, :3].T)
    normal = normal * [1, 1, -1] * (name != 0)[..., None]
    rng = np.random.default_rng(number + 1000)
    noisy = colour * (1 + noise * rng.standard_normal((*shape, 1)))
    frame = Frame(
        number=number,
        camera=eye,
        radiance=noisy.astype(np.float32),
        albedo=colour.astype(np.float32),
        normal=normal.astype(np.float32),
        depth=depth,
        **more,  # type: ignore[arg-type]
    )
    return View(frame, point, name, colour.astype(np.float32))


def _rays(eye: Camera, shape: tuple[int, int]) -> tuple[Matrix, Matrix]:
    """Return where the ray of each pixel's centre starts and leads, in the world."""
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    right = ((columns + 0.5 + eye.window[0]) / WIDTH * 2 - 1) / eye.project[0, 0]
    up = (1 - (rows + 0.5 + eye.window[1]) / HEIGHT * 2) / eye.project[1, 1]
    zero, one = np.zeros(shape), np.ones(shape)
    world = np.linalg.inv(eye.view)
    if eye.project[3, 3]:
        start, ray = np.stack([right, up, zero], -1), np.stack([zero, zero, -one], -1)
    else:
        start, ray = np.zeros((*shape, 3)), np.stack([right, up, -one], -1)
    return start @ world[:3, :3].T + world[:3, 3], ray @ world[:3, :3].T


def _hits(world: World, start: Matrix, ray: Matrix) -> tuple[Matrix, NDArray[np.int32]]:
    """Return the first hit of each ray and its name; 0 and names 0 for the sky."""
    point, name = np.zeros(ray.shape), np.zeros(ray.shape[:2], np.int32)
    planes = [(WALL, world.wall_z, (0.0, 0.0), world.wall_half)]
    if world.card is not None:
        planes.append((CARD, world.card_z, world.card, world.card_half))
    for this, z, middle, half in planes:
        way = (z - start[..., 2]) / ray[..., 2]
        at = start + way[..., None] * ray
        hit = (way > 0) & (np.abs(at[..., :2] - middle) <= half).all(-1)
        point[hit], name[hit] = at[hit], this
    return point, name


def _texture(point: Matrix, name: NDArray[np.int32], world: World) -> Matrix:
    """Return the colour of hits, which goes along with what they lie on."""
    own = point[..., :2] - np.where(
        (name == CARD)[..., None], world.card or (0.0, 0.0), (0.0, 0.0)
    )
    waves = np.sin(own[..., :1] * [2.0, 3.1, 1.7] + own[..., 1:] * [1.3, 2.2, 2.9])
    colour = world.light * (0.5 + 0.3 * waves) + (name == CARD)[..., None] * 1.0
    return np.where((name == 0)[..., None], 0.25, colour)


def vector(views: list[View], index: int, worlds: list[World]) -> Array:
    """Return Cycles' Vector pass of ``views[index]``, from what moved around it.

    At both ends of the list the missing side is what a thing that rests would give.
    """
    here = views[index]
    result = np.zeros((*here.name.shape, 4), np.float32)
    own = project(here.frame.camera, here.point)
    for side, beside in ((0, index - 1), (2, index + 1)):
        other = min(max(beside, 0), len(views) - 1)
        point = here.point.copy()
        before, after = worlds[index].card, worlds[other].card
        if before is not None and after is not None:
            moved = np.append(np.subtract(after, before), 0.0)
            point[here.name == CARD] += moved
        there = project(views[other].frame.camera, point)
        step = (there - own) * ([1, -1] if side == 0 else [-1, 1])
        result[..., side : side + 2] = np.where(here.name[..., None] == 0, 0.0, step)
    return result


def project(eye: Camera, point: Matrix) -> Matrix:
    """Return the pixels (..., 2) that show world points (..., 3)."""
    seen = (point - np.linalg.inv(eye.view)[:3, 3]) @ eye.view[:3, :3].T
    across, up = seen[..., 0] * eye.project[0, 0], seen[..., 1] * eye.project[1, 1]
    if not eye.project[3, 3]:
        across, up = across / -seen[..., 2], up / -seen[..., 2]
    left, top = eye.window
    return np.stack(
        [(across + 1) / 2 * WIDTH - left, (1 - up) / 2 * HEIGHT - top], axis=-1
    )
