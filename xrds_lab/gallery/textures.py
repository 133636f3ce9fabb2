"""Shots whose textures change: the same place shows something else."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

from ..studio.geometry import box, sheet
from ..studio.nodes import Surface, Value
from .stage import COLD, CREAM, WARM, Set, key, over, room, truck, uv


def _board(stage: Set, surface: Surface, colour: Value, glows: bool = False) -> None:
    """A board before the wall that shows `colour`."""
    if glows:
        shine = surface.add("Emission", Color=colour, Strength=1.0)
        surface.replace(Surface=shine.outputs[0])
    else:
        surface.set(Base_Color=colour, Roughness=0.5)
    board = stage.put(sheet(2.6, 1.6), surface.material, (0.0, 0.2, 1.1))
    board.rotation_euler[0] = 1.5708
    stage.put(box(2.8, 0.06, 1.8), bpy.data.materials["wall"], (0.0, 0.3, 0.2))


def _painted(number: int, width: int = 260, height: int = 160) -> np.ndarray:
    """A frame of a film: bars and a disc that move, bytes (H, W, 3)."""
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    bars = ((x + 4 * number) // 13 + (y - 2 * number) // 20) % 3
    colours = np.array([(200, 170, 90), (60, 90, 160), (30, 30, 40)])[bars]
    disc = (x - 60 - 9 * number) ** 2 + (y - 80) ** 2 < 45**2
    colours[disc] = (225, 70, 40)
    return colours.astype(np.uint8)


def _film(folder: Path) -> Path:
    """Write the pictures of a film as PNG; returns the first one's path."""
    from PIL import Image

    folder.mkdir(parents=True, exist_ok=True)
    for number in range(1, 21):
        path = folder / f"film_{number:04}.png"
        if not path.is_file():
            Image.fromarray(_painted(number)).save(path)
    return folder / "film_0001.png"


def image_sequence(stage: Set) -> None:
    """A screen that shows a film of pictures in files."""
    room(stage)
    surface = Surface("screen")
    image = bpy.data.images.load(str(_film(stage.folder / "film").resolve()))
    image.source = "SEQUENCE"
    across = surface.add("TexCoord").outputs["UV"]
    whole = surface.add("Mapping", Vector=across, Scale=(1 / 2.6, 1 / 1.6, 1.0))
    film = surface.add("TexImage", image=image, Vector=whole.outputs[0])
    user = film.image_user
    user.frame_duration, user.frame_start, user.use_auto_refresh = 20, 1, True
    _board(stage, surface, film.outputs["Color"], glows=True)
    truck(stage, 0.02)


def driver(stage: Set) -> None:
    """A material whose scale and colour a driver takes from the frame's number."""
    room(stage)
    surface = Surface("driven")
    squares = surface.add("TexChecker", Vector=uv(surface), Color1=CREAM, Color2=WARM)
    drive = squares.inputs["Scale"].driver_add("default_value").driver
    drive.expression = "7 + 0.12 * (frame - 5)"
    tint = squares.inputs["Color2"].driver_add("default_value", 1).driver
    tint.expression = "0.4 + 0.35 * sin(0.8 * frame)"
    _board(stage, surface, squares.outputs["Color"])


def frame_attribute(stage: Set) -> None:
    """A material that reads the frame's number itself: an Attribute node."""
    room(stage)
    surface = Surface("reads")
    frame = surface.add(
        "Attribute", attribute_type="VIEW_LAYER", attribute_name="frame_current"
    )
    shift = surface.math("MULTIPLY", frame.outputs["Fac"], 0.03)
    moved = surface.add("VectorMath", Vector=uv(surface))
    across = surface.add("CombineXYZ", X=shift, Y=shift)
    surface.plug(moved.inputs[1], across.outputs[0])
    colours = surface.add(
        "TexBrick", Vector=moved.outputs[0], Scale=2.5, Color1=CREAM, Color2=COLD
    )
    _board(stage, surface, colours.outputs["Color"])


def boiling_noise(stage: Set) -> None:
    """A fine procedural texture that boils."""
    room(stage)
    surface = Surface("boils")
    noise = surface.add(
        "TexNoise",
        noise_dimensions="4D",
        Vector=uv(surface),
        Scale=14.0,
        Detail=2.0,
    )
    key(noise.inputs["W"], "default_value", over(lambda k: 3.0 + 0.12 * k))
    colour = surface.ramp(noise.outputs[0], [(0.42, COLD), (0.58, CREAM)], "LINEAR")
    _board(stage, surface, colour)
    truck(stage, 0.02)


def scrolling(stage: Set) -> None:
    """A page of fine lines that scrolls, half a line in a frame."""
    room(stage)
    surface = Surface("page")
    place = surface.add("Mapping", Vector=uv(surface))
    at = place.outputs[0]
    lines = surface.add("TexWave", bands_direction="Y", Vector=at, Scale=4.0)
    words = surface.add("TexNoise", Vector=at, Scale=18.0, Detail=0.0)
    ink = surface.math("MULTIPLY", lines.outputs["Fac"], words.outputs[0])
    dark = surface.math("GREATER_THAN", ink, 0.32)
    paper = surface.mix(CREAM, (0.04, 0.04, 0.05), dark)
    scrolled = over(lambda k: (0.0, 0.035 * k, 0.0))
    key(place.inputs["Location"], "default_value", scrolled)
    _board(stage, surface, paper, glows=True)
