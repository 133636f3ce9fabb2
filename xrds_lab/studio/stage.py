"""The stage that recipes of random scenes build on: dice, materials, views."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, field
from pathlib import Path

import bpy
import numpy as np

from .assets import Library, chosen, copied, import_model
from .builder import Builder
from .geometry import Point
from .materials import Painter


@dataclass(frozen=True)
class View:
    """A camera: where it stands, what it looks at (metres), lens in mm of 36."""

    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    lens: float
    fstop: float = 0.0  # 0: everything sharp


@dataclass
class Stage(Builder):
    """A random scene under construction. Recipes add things and views."""

    rng: random.Random
    library: Library | None
    kind: str = ""
    views: list[View] = field(default_factory=list)
    models: dict[str, bpy.types.Object] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.paint = Painter(self.rng, self.library)
        self.dice = np.random.default_rng(self.rng.getrandbits(32))

    def chance(self, probability: float) -> bool:
        """True with this probability."""
        return self.rng.random() < probability

    def model(
        self, size: float, at: Point, turn: float, words: tuple[str, ...] = ()
    ) -> bpy.types.Object | None:
        """A model (whose name has one of `words`) standing at `at`."""
        if self.library is None:
            return None
        path = chosen(self.rng, self.library.models, words)
        base = copied(self._imported(path))
        base.location, base.rotation_euler[2] = at, turn
        base.scale = (size, size, size)
        return base

    def _imported(self, path: Path) -> bpy.types.Object:
        if path.name not in self.models:
            base = import_model(path, 1.0)
            # The first one is only copied: it stays out of the picture's way.
            base.location = (0, 0, -500)
            self.models[path.name] = base
            self.library.note(path)
        return self.models[path.name]

    def look(
        self, eye: Point, target: Point, lens: float, shallow: float = 0.25
    ) -> None:
        """Add a view; with probability `shallow` it has a depth of field."""
        fstop = self.rng.uniform(1.2, 6.0) if self.chance(shallow) else 0.0
        self.views.append(View(tuple(eye), tuple(target), lens, fstop))


def turned(rng: random.Random) -> float:
    """Any angle in radians."""
    return rng.uniform(0, 2 * math.pi)
