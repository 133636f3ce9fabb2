"""Shots with what light goes through: glass, water, caustics, smoke."""

from __future__ import annotations

from ..studio.geometry import box, sheet, sphere
from ..studio.nodes import Surface
from .stage import Set, glass, key, over, room, slide, truck


def pane(stage: Set) -> None:
    """A thin pane of glass before the things, under a moving camera."""
    room(stage)
    clear = glass(ior=2.0)  # heavy glass mirrors the room as well
    thing = stage.put(box(1.8, 0.02, 1.7), clear, (0.1, -0.6, 0.3), 0.4)
    thing.visible_shadow = False
    truck(stage)


def glass_block(stage: Set) -> None:
    """A thick block of glass, turned to the camera."""
    room(stage)
    thing = stage.put(box(1.3, 0.8, 1.3), glass(), (0.1, -0.7, 0.3), 0.5, bevel=0.03)
    thing.visible_shadow = False
    truck(stage)


def glass_ball(stage: Set) -> None:
    """A ball of glass that turns the room upside down."""
    room(stage)
    thing = stage.put(sphere(0.7, 64), glass(), (0.1, -0.8, 0.9))
    thing.visible_shadow = False
    truck(stage)


def water(stage: Set) -> None:
    """Waves that run over clear water; the camera stands still."""
    room(stage)
    surface = Surface("water", Transmission_Weight=1.0, Roughness=0.0, IOR=1.33)
    surface.set(Base_Color=(0.9, 1.0, 1.0))
    place = surface.add("TexCoord").outputs["UV"]
    moved = surface.add("VectorMath", Vector=place)
    waves = surface.add("TexNoise", Vector=moved.outputs[0], Scale=2.2, Detail=1.0)
    surface.bump(waves.outputs[0], 0.25)
    sea = stage.put(sheet(9, 9.5), surface.material, (0, -0.8, 0.25))
    sea.visible_shadow = False
    offset = moved.inputs[1]
    key(offset, "default_value", over(lambda k: (0.04 * k, 0.02 * k, 0.03 * k)))


def caustics(stage: Set) -> None:
    """A ball of glass that moves, and the light that it gathers on the floor."""
    lamp = room(stage)
    lamp.data.energy = 80
    ball = stage.put(sphere(0.45, 48), glass(), (0.0, -0.4, 0.6))
    slide(ball, (0.035, 0.0, 0.0))
    stage.lamp("SPOT", 900, (-2.4, 0.6, 3.4), (0, -0.4, 0.4), shadow_soft_size=0.25)


def smoke(stage: Set) -> None:
    """Smoke that drifts and boils before the things."""
    room(stage)
    nodes = Surface("smoke")
    place = nodes.add("TexCoord").outputs["Object"]
    drift = nodes.add("VectorMath", Vector=place)
    boil = nodes.add(
        "TexNoise",
        noise_dimensions="4D",
        Vector=drift.outputs[0],
        Scale=2.2,
        Detail=1.0,
    )
    dense = nodes.math("MULTIPLY", nodes.math("SUBTRACT", boil.outputs[0], 0.48), 25.0)
    dense = nodes.math("MAXIMUM", dense, 0.0)
    cloud = nodes.add("VolumeScatter", Color=(0.9, 0.9, 0.9), Density=dense)
    nodes.replace(Volume=cloud.outputs[0])
    stage.put(box(2.6, 1.0, 1.8), nodes.material, (0.0, 0.0, 0.9))
    key(drift.inputs[1], "default_value", over(lambda k: (-0.03 * k, 0, -0.03 * k)))
    key(boil.inputs["W"], "default_value", over(lambda k: 0.03 * k))
    cycles = stage.scene.cycles
    cycles.volume_step_rate, cycles.volume_max_steps = 2.0, 32
    cycles.volume_bounces = 0
