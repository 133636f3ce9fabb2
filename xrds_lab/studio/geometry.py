"""Plain shapes as arrays: built with numpy, joined cheaply, then made one mesh.

Lengths are metres, z is up. Texture coordinates are metres along the surface, so one
material has the same grain on whatever it lies.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import bpy
import numpy as np
from numpy.typing import NDArray

Vertices = NDArray[np.float64]
"""Points or texture coordinates, one in each row."""
Point = Sequence[float]
Profile = Sequence[tuple[float, float]]


@dataclass(frozen=True)
class Shape:
    """Vertices (n, 3), faces as vertex indices, texture coordinates (corners, 2)."""

    vertices: Vertices
    faces: list[tuple[int, ...]]
    uv: Vertices
    smooth: bool = False

    def moved(self, offset: Point = (0, 0, 0), turn: float = 0.0) -> Shape:
        """Turned by `turn` radians about z, then moved by `offset`."""
        return self.rotated("z", turn).shifted(offset)

    def shifted(self, offset: Point) -> Shape:
        """Moved by `offset`."""
        return self._with(self.vertices + np.asarray(offset, float))

    def rotated(self, axis: str, angle: float) -> Shape:
        """Turned by `angle` radians about the axis `x`, `y` or `z`."""
        if not angle:
            return self
        i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
        c, s = math.cos(angle), math.sin(angle)
        out = self.vertices.copy()
        out[:, i] = c * self.vertices[:, i] - s * self.vertices[:, j]
        out[:, j] = s * self.vertices[:, i] + c * self.vertices[:, j]
        return self._with(out)

    def bent(self, bend: Callable[[Vertices], Vertices]) -> Shape:
        """Vertices replaced by `bend(vertices)`."""
        return self._with(bend(self.vertices))

    def _with(self, vertices: Vertices) -> Shape:
        return Shape(vertices, self.faces, self.uv, self.smooth)

    def mesh(self, name: str) -> bpy.types.Mesh:
        """The shape as a new mesh."""
        mesh = bpy.data.meshes.new(name)
        mesh.from_pydata(self.vertices.tolist(), [], self.faces)
        layer = mesh.uv_layers.new(name="UVMap")
        layer.data.foreach_set("uv", np.ascontiguousarray(self.uv, np.float32).ravel())
        if self.smooth:
            mesh.shade_smooth()
            mesh.set_sharp_from_angle(angle=math.radians(40))
        return mesh


def joined(shapes: Iterable[Shape]) -> Shape:
    """Several shapes as one."""
    parts = list(shapes)
    starts = np.cumsum([0] + [len(part.vertices) for part in parts])
    faces = [
        tuple(index + int(start) for index in face)
        for part, start in zip(parts, starts, strict=False)
        for face in part.faces
    ]
    return Shape(
        np.concatenate([part.vertices for part in parts]),
        faces,
        np.concatenate([part.uv for part in parts]),
        any(part.smooth for part in parts),
    )


def box(x: float, y: float, z: float) -> Shape:
    """A box, its base centred on the origin."""
    corners = np.array(
        [(i, j, k) for k in (0, 1) for j in (-0.5, 0.5) for i in (-0.5, 0.5)]
    )
    faces = [
        (0, 2, 3, 1),
        (4, 5, 7, 6),
        (0, 1, 5, 4),
        (2, 6, 7, 3),
        (0, 4, 6, 2),
        (1, 3, 7, 5),
    ]
    vertices = corners * (x, y, z)
    axes = [(0, 1), (0, 1), (0, 2), (0, 2), (1, 2), (1, 2)]
    uv = [vertices[list(face)][:, axis] for face, axis in zip(faces, axes, strict=True)]
    return Shape(vertices, faces, np.concatenate(uv))


def quads(points: Vertices) -> Shape:
    """Separate quadrilaterals, points (n, 4, 3); each with its own coordinates."""
    count = len(points)
    faces = [tuple(range(4 * i, 4 * i + 4)) for i in range(count)]
    u = np.linalg.norm(points[:, 1] - points[:, 0], axis=1)
    v = np.linalg.norm(points[:, 3] - points[:, 0], axis=1)
    zero = np.zeros(count)
    uv = np.stack([(zero, zero), (u, zero), (u, v), (zero, v)]).transpose(2, 0, 1)
    return Shape(points.reshape(-1, 3), faces, uv.reshape(-1, 2))


def sheet(width: float, depth: float, columns: int = 1, rows: int = 1) -> Shape:
    """A level grid centred on the origin."""
    u, v = np.meshgrid(
        np.linspace(0, width, columns + 1), np.linspace(0, depth, rows + 1)
    )
    flat = np.stack([u.ravel(), v.ravel()], axis=1)
    points = np.column_stack([flat - (width / 2, depth / 2), np.zeros(len(flat))])
    return _grid(points, flat, columns + 1, rows + 1)


def _grid(points: Vertices, uv: Vertices, columns: int, rows: int) -> Shape:
    index = np.arange(columns * rows).reshape(rows, columns)
    cells = np.stack(
        [index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], -1
    )
    faces = cells.reshape(-1, 4)
    return Shape(
        points, [tuple(face) for face in faces.tolist()], uv[faces.ravel()], True
    )


def curved(points: Profile) -> list[tuple[float, float]]:
    """A profile for `lathe`: a Catmull-Rom curve through (radius, height) points."""
    ends = np.array([points[0], *points, points[-1]], float)
    t = np.linspace(0.0, 1.0, 8, endpoint=False)[:, None]
    pieces = [
        b
        + 0.5 * (c - a) * t
        + (a - 2.5 * b + 2 * c - 0.5 * d) * t**2
        + 0.5 * (3 * b - a - 3 * c + d) * t**3
        for a, b, c, d in zip(ends, ends[1:], ends[2:], ends[3:], strict=False)
    ]
    curve = np.concatenate([*pieces, ends[-1:]])
    curve[:, 0] = curve[:, 0].clip(0.0)
    return [(float(radius), float(height)) for radius, height in curve]


def lathe(profile: Profile, segments: int = 32) -> Shape:
    """The profile of (radius, height) points turned about z."""
    radius, height = np.array(profile, float).T
    radius = np.maximum(radius, 1e-4)
    angle = np.linspace(0, 2 * math.pi, segments + 1)
    ring = np.stack([np.cos(angle), np.sin(angle)], -1)
    points = np.empty((len(radius), segments + 1, 3))
    points[..., :2] = radius[:, None, None] * ring
    points[..., 2] = height[:, None]
    length = np.r_[0, np.cumsum(np.hypot(np.diff(radius), np.diff(height)))]
    u, v = np.meshgrid(angle * float(radius.max()), length)
    uv = np.stack([u.ravel(), v.ravel()], -1)
    return _grid(points.reshape(-1, 3), uv, segments + 1, len(radius))


def cylinder(radius: float, height: float, segments: int = 16) -> Shape:
    """A closed cylinder standing on the origin."""
    return cone(radius, radius, height, segments)


def cone(low: float, high: float, height: float, segments: int = 16) -> Shape:
    """A closed cone or frustum standing on the origin."""
    return lathe([(0, 0), (low, 0), (high, height), (0, height)], segments)


def sphere(radius: float, segments: int = 32) -> Shape:
    """A ball centred on the origin."""
    angles = np.linspace(-math.pi / 2, math.pi / 2, segments // 2 + 1)
    return lathe(
        [(radius * math.cos(a), radius * math.sin(a)) for a in angles], segments
    )


def torus(radius: float, thickness: float, segments: int = 40) -> Shape:
    """A ring about z centred on the origin."""
    angles = np.linspace(0, 2 * math.pi, segments // 2 + 1)
    profile = [
        (radius + thickness * math.cos(a), thickness * math.sin(a)) for a in angles
    ]
    return lathe(profile, segments)


def tube(points: Sequence[Point], radius: float, segments: int = 8) -> Shape:
    """A round wire through `points`."""
    path = np.asarray(points, float)
    along = np.gradient(path, axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    helper = np.where(np.abs(along[:, 2:]) < 0.9, [[0.0, 0, 1]], [[1.0, 0, 0]])
    side = np.cross(along, helper)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    angle = np.linspace(0, 2 * math.pi, segments + 1)[None, :, None]
    rim = np.cos(angle) * side[:, None] + np.sin(angle) * np.cross(along, side)[:, None]
    length = np.r_[0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))]
    u, v = np.meshgrid(angle.ravel() * radius, length)
    uv = np.stack([u.ravel(), v.ravel()], -1)
    vertices = (path[:, None] + radius * rim).reshape(-1, 3)
    return _grid(vertices, uv, segments + 1, len(path))


def rod(start: Point, end: Point, radius: float) -> Shape:
    """A straight wire."""
    return tube([start, end], radius)


def lumpy(
    shape: Shape, rng: np.random.Generator, size: float, strength: float
) -> Shape:
    """Vertices pushed from the origin by smooth noise of wavelength `size`."""

    def push(vertices: Vertices) -> Vertices:
        waves = rng.normal(0, 1 / size, (12, 3))
        phase = rng.uniform(0, 2 * math.pi, 12)
        noise = np.sin(vertices @ waves.T * 2 + phase).mean(1, keepdims=True)
        return vertices * (1 + strength * noise)

    return shape.bent(push)


def wall(width: float, height: float, holes: Sequence[tuple[float, ...]]) -> Shape:
    """A wall in the plane y = 0 with rectangular holes (x0, z0, x1, z1).

    x runs from 0 to `width`; the visible face looks to -y.
    """
    xs = sorted({0.0, width, *(x for hole in holes for x in hole[0::2])})
    zs = sorted({0.0, height, *(z for hole in holes for z in hole[1::2])})
    cells = [
        [(x0, 0, z0), (x1, 0, z0), (x1, 0, z1), (x0, 0, z1)]
        for x0, x1 in pairwise(xs)
        for z0, z1 in pairwise(zs)
        if not any(h[0] <= x0 < h[2] and h[1] <= z0 < h[3] for h in holes)
    ]
    points = np.array(cells)
    shape = quads(points)
    return Shape(shape.vertices, shape.faces, shape.vertices[:, (0, 2)])
