"""What is known about a picture before it is rendered.

The defaults are the dearest case, so that what nobody looked at is never left out.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SceneFacts:
    """What a scene holds; see `scene_facts` for how it is found."""

    surfaces: bool = True
    """Anything at all that a ray can hit."""
    scatters: bool = True
    """Some surface or volume reflects light: radiance is noisy."""
    smooth: bool = True
    """Mirrors, glass or gloss so smooth that they show others' albedo and normals."""
    transparent: bool = True
    volumes: bool = True
    emitters: tuple[str, ...] = ()
    """Names of materials that give light."""
    lamps: int = 1
    seen_lamps: int = 1
    """Lamps that a camera, a mirror or glass may show."""
    world: str = "varies"
    """`none` (black), `constant` or `varies`."""
    textures: bool = True
    bump: bool = True
    displacement: bool = True
    subsurface: bool = True
    hair: bool = True
    depth_of_field: bool = True
    motion_blur: bool = True
    """Requested in the file; what moves is another question."""
    moving: tuple[str, ...] = ("anything",)
    """Up to a few names of what changes from frame to frame."""
    film_transparent: bool = False
    shadow_catchers: bool = True
    passes: tuple[str, ...] = ()
    """Requested beside the picture and its guides."""
    materials: int = 0
    unknown_nodes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Facts:
    """What of a job, a scene and a Blender the decisions rest on; sizes in pixels."""

    scale: int
    width: int
    height: int
    max_bounces: int
    has_denoiser: bool
    exact_camera: bool
    reprojects: bool = True
    """Whether it is known where the camera shows a place in another frame."""
    guide_samples: int = 4
    scene: SceneFacts = SceneFacts()
    guide_seconds: float | None = None
    """Estimate for the guide render with nothing left out; None if there is none."""
