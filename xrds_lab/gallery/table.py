"""The gallery's shots: what each tests, and which half of the gallery it is in.

Figures and thresholds of the product are chosen on one half and judged on the other.
Shots that are alike lie in different halves, until one of the judging half has failed
and was looked into: then it belongs to the choosing half. Simulations are baked in
memory when the scene is built; of smoke there is a procedural one, for that simulation
keeps its cache in files and takes minutes. An object cannot change its mesh by
keyframes: geometry nodes swap it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from xrds_core.errors import UsageError

from . import bending, cameras, cards, changes, clear, lights, mirrors, small, textures
from .stage import SHUTTER, SIZE, Set, open_set

CHOOSING, JUDGING = "choosing", "judging"
HALVES = (CHOOSING, JUDGING)
SAMPLES = (2, 4, 16)
FRAMES = tuple(range(1, 10))


@dataclass(frozen=True)
class Shot:
    """One shot: nine frames, of which the fifth and the first are judged.

    `samples` are the counts it is judged at in place of those asked for. Where it is
    `adaptive` they are the most that a pixel gets. `version` counts up whenever the
    scene changes: what was rendered of the one before is then left.
    """

    name: str
    half: str
    scene: Callable[[Set], None]
    blur: bool = False
    samples: tuple[int, ...] = ()
    frames: tuple[int, ...] = FRAMES
    adaptive: bool = False
    version: int = 1

    @property
    def what(self) -> str:
        """What it tests, in a sentence."""
        sentence = (self.scene.__doc__ or "").partition("\n")[0]
        return f"{sentence} With motion blur." if self.blur else sentence

    @property
    def judged(self) -> tuple[int, int]:
        """Numbers of the frames that are judged: the middle one, the first one."""
        return self.frames[len(self.frames) // 2], self.frames[0]

    def counts(self, asked: tuple[int, ...] = SAMPLES) -> tuple[int, ...]:
        """Samples per pixel that it is judged at."""
        return self.samples or asked

    def build(self, folder: Path, size: tuple[int, int] = SIZE) -> Any:
        """Open an empty file, make the shot in it and return its scene."""
        stage = open_set(folder, size)
        self.scene(stage)
        if self.blur:
            stage.scene.render.use_motion_blur = True
            stage.scene.render.motion_blur_shutter = SHUTTER
        return stage.scene


TABLE = (
    Shot("plane_mirror", CHOOSING, mirrors.plane_mirror),
    Shot("mirror_ball", JUDGING, mirrors.mirror_ball),
    Shot("moving_mirror", JUDGING, mirrors.moving_mirror),
    Shot("facing_mirrors", CHOOSING, mirrors.facing_mirrors),
    Shot("figure_in_ball", CHOOSING, mirrors.figure_in_ball),
    Shot("figure_in_mirror", CHOOSING, mirrors.figure_in_mirror),
    Shot("glossy_floor", JUDGING, mirrors.glossy_floor),
    Shot("pane", CHOOSING, clear.pane),
    Shot("glass_block", JUDGING, clear.glass_block),
    Shot("glass_ball", CHOOSING, clear.glass_ball),
    Shot("water", CHOOSING, clear.water),
    Shot("caustics", CHOOSING, clear.caustics),
    Shot("smoke", CHOOSING, clear.smoke),
    Shot("leaf_cards_film", CHOOSING, cards.leaf_cards_film),
    Shot("leaf_cards", JUDGING, cards.leaf_cards),
    Shot("hair", CHOOSING, cards.hair),
    Shot("holdout", JUDGING, cards.holdout),
    Shot("shadow_catcher", CHOOSING, cards.shadow_catcher),
    Shot("transparent_film", CHOOSING, cards.transparent_film),
    Shot("figure", CHOOSING, bending.figure),
    Shot("figure_blur", JUDGING, bending.figure, blur=True),
    Shot("shape_keys", JUDGING, bending.shape_keys),
    Shot("shape_keys_blur", CHOOSING, bending.shape_keys, blur=True),
    Shot("displacement", CHOOSING, bending.displacement),
    Shot("displacement_blur", JUDGING, bending.displacement, blur=True),
    Shot("held_poses", JUDGING, bending.held_poses),
    Shot("cloth", CHOOSING, bending.cloth),
    Shot("instances", JUDGING, changes.instances),
    Shot("instances_blur", CHOOSING, changes.instances, blur=True),
    Shot("particles", CHOOSING, changes.particles),
    Shot("rigid_bodies", JUDGING, changes.rigid_bodies),
    Shot("boolean", CHOOSING, changes.boolean),
    Shot("vanish", JUDGING, changes.vanish),
    Shot("vanish_blur", CHOOSING, changes.vanish, blur=True),
    Shot("swap", JUDGING, changes.swap),
    Shot("swap_blur", JUDGING, changes.swap, blur=True),
    Shot("handler", JUDGING, changes.handler),
    Shot("moving_lamp", CHOOSING, lights.moving_lamp),
    Shot("flash", JUDGING, lights.flash),
    Shot("dimming", JUDGING, lights.dimming),
    Shot("flickering_tube", JUDGING, lights.flickering_tube),
    Shot("blinking_lights", CHOOSING, lights.blinking_lights),
    Shot("turning_sun", CHOOSING, lights.turning_sun),
    Shot("turning_sky", JUDGING, lights.turning_sky),
    Shot("bright_panel", CHOOSING, lights.bright_panel),
    Shot("image_sequence", JUDGING, textures.image_sequence),
    Shot("driver", JUDGING, textures.driver),
    Shot("frame_attribute", JUDGING, textures.frame_attribute),
    Shot("boiling_noise", CHOOSING, textures.boiling_noise),
    Shot("scrolling", JUDGING, textures.scrolling),
    Shot("hand_held", CHOOSING, cameras.hand_held),
    Shot("slow_pan", JUDGING, cameras.slow_pan),
    Shot("zoom", JUDGING, cameras.zoom),
    Shot("focus_pull", CHOOSING, cameras.focus_pull),
    Shot("lens_shift", JUDGING, cameras.lens_shift),
    Shot("orthographic", JUDGING, cameras.orthographic),
    Shot("panorama", JUDGING, cameras.panorama),
    Shot("cut", CHOOSING, cameras.cut),
    Shot("stereo", JUDGING, cameras.stereo),
    Shot("rails", CHOOSING, small.rails),
    Shot("text", JUDGING, small.text),
    Shot("fine_checks", CHOOSING, small.fine_checks),
    Shot(
        "adaptive_default",
        JUDGING,
        cameras.adaptive_default,
        samples=(16, 64),
        adaptive=True,
    ),
    Shot(
        "adaptive_rough",
        CHOOSING,
        cameras.adaptive_rough,
        samples=(4096,),
        adaptive=True,
    ),
    Shot("on_twos", CHOOSING, cameras.on_twos, frames=tuple(range(1, 18, 2))),
)
SHOTS = {shot.name: shot for shot in TABLE}


def chosen(names: tuple[str, ...] = (), half: str | None = None) -> list[Shot]:
    """Shots by name, or all, of one half or both; raises UsageError for others."""
    unknown = sorted(set(names) - set(SHOTS))
    if unknown:
        raise UsageError(
            f"no shot {', '.join(unknown)} in the gallery; it has {', '.join(SHOTS)}"
        )
    there = [SHOTS[name] for name in names] or list(TABLE)
    return [shot for shot in there if half is None or shot.half == half]
