"""Shots with alpha: leaves on cards, hair, holdouts, shadow catchers, films."""

from __future__ import annotations

import math

import bpy
import numpy as np

from ..studio.geometry import box, cone, sheet, sphere
from ..studio.nodes import Surface, solid
from .stage import (
    CREAM,
    LEAF,
    WARM,
    Set,
    boxes,
    checks,
    key,
    light,
    marble,
    over,
    room,
    truck,
    turn,
)


def _leaf() -> bpy.types.Material:
    """Leaves cut out of a card by alpha."""
    leaf = Surface("leaf", Roughness=0.7)
    place = leaf.add("TexCoord").outputs["UV"]
    cells = leaf.add("TexVoronoi", Vector=place, Scale=7.0)
    near = leaf.math("LESS_THAN", cells.outputs["Distance"], 0.42)
    tint = leaf.mix(LEAF, (0.45, 0.5, 0.1), cells.outputs["Color"])
    leaf.set(Base_Color=tint, Alpha=near)
    return leaf.material


def _cards(stage: Set) -> None:
    """Cards of leaves that sway."""
    stuff = _leaf()
    for number, (x, y) in enumerate(
        ((-1.4, -0.6), (-0.5, 0.1), (0.3, -0.9), (1.2, -0.2), (0.8, 0.6))
    ):
        card = stage.put(sheet(1.1, 1.5), stuff, (x, y, 1.0))
        way = 0.4 * (number - 2)
        swing = over(
            lambda k, n=number, w=way: (math.pi / 2, 0.02 * k * (-1) ** n, w + 0.01 * k)
        )
        key(card, "rotation_euler", swing)


def leaf_cards(stage: Set) -> None:
    """Cards of leaves that sway before the room."""
    room(stage)
    _cards(stage)
    truck(stage, 0.02)


def leaf_cards_film(stage: Set) -> None:
    """Cards of leaves that sway before a transparent film."""
    light(stage, 0.8)
    _cards(stage)
    stage.scene.render.film_transparent = True
    truck(stage, 0.02)


def transparent_film(stage: Set) -> None:
    """Things without a room, before a transparent film."""
    light(stage, 0.5)
    boxes(stage)
    stage.put(cone(0.5, 0.05, 1.4), marble("cone", WARM, CREAM), (0.1, -0.2, 0.2))
    stage.scene.render.film_transparent = True
    truck(stage)


def holdout(stage: Set) -> None:
    """A ball that moves cuts a hole into the picture."""
    room(stage)
    hole = Surface("hole")
    hole.replace(Surface=hole.add("Holdout").outputs[0])
    ball = stage.put(sphere(0.5), hole.material, (0.0, -0.4, 0.9))
    key(ball, "location", over(lambda k: (0.04 * k, -0.4, 0.9)))
    stage.scene.render.film_transparent = True


def shadow_catcher(stage: Set) -> None:
    """A box that turns and its shadow alone, for another picture."""
    light(stage, 0.5)
    stage.lamp("SUN", 1.2, (-2, -3, 5), (0, 0, 0), angle=0.05)
    ground = stage.put(sheet(14, 14), solid("ground", Base_Color=(0.5, 0.5, 0.5)))
    ground.is_shadow_catcher = True
    thing = stage.put(box(0.9, 0.9, 1.1), checks("turned", CREAM, WARM), (0, 0, 0.1))
    turn(thing, (0.0, 0.0, 0.03))
    stage.scene.render.film_transparent = True
    truck(stage, 0.02)


def hair(stage: Set) -> None:
    """A ball of hair that turns."""
    room(stage)
    ball = stage.put(sphere(0.5), solid("skin", Base_Color=WARM), (0.0, -0.6, 1.0))
    curves = bpy.data.hair_curves.new("hair")
    points = _strands(1800, 7)
    curves.add_curves([points.shape[1]] * len(points))
    flat = np.ascontiguousarray(points, np.float32).reshape(-1, 3)
    curves.attributes["position"].data.foreach_set("vector", flat.ravel())
    thin = curves.attributes.new("radius", "FLOAT", "POINT")
    thin.data.foreach_set("value", np.tile(np.linspace(0.006, 0.001, 7), len(points)))
    curves.materials.append(solid("hair", Base_Color=(0.5, 0.24, 0.08), Roughness=0.4))
    fur = stage.link("fur", curves)
    fur.parent = ball
    turn(ball, (0.0, 0.0, 0.035))


def _strands(count: int, points: int) -> np.ndarray:
    """Curved strands on a ball, (strands, points, 3)."""
    dice = np.random.default_rng(3)
    root = dice.normal(size=(count, 1, 3))
    root /= np.linalg.norm(root, axis=-1, keepdims=True)
    along = np.linspace(0.0, 0.4, points)[None, :, None]
    lean = dice.normal(scale=0.25, size=(count, 1, 3)) - (0.0, 0.0, 0.5)
    return root * (0.49 + along) + lean * along**2 * 2.0
