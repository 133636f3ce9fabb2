"""The settings of XRDS that a scene keeps; samples stay with Cycles."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty

from xrds_core.denoising.light_passes import ALL, GROUPS, NONE
from xrds_core.frames import RADIUS

from ..planning.request import Request, render_request
from ..planning.settings import Mode
from ..rendering import modes
from ..scene.contents import passes_looked_at
from .preference_values import preference_values
from .translations import CONTEXT

SAME_PICTURE, SAME_TIME, DEADLINE = "same_picture", "same_time", "deadline"
_MODES = [
    (
        Mode.AUTOMATIC,
        "Automatic",
        "XRDS takes the mode that gives the best picture at the present samples. "
        "With a time budget it chooses the samples as well",
    ),
    (
        Mode.FULL_SIZE,
        "Full Size",
        "Cycles renders every pixel and XRDS denoises the picture. In animations with "
        "the samples of neighbouring frames; a still gains little but time",
    ),
    (
        Mode.X2,
        "Super-Resolution 2×",
        "Cycles renders a quarter of the pixels and a network adds the detail. Quicker "
        "than full size at the same samples; small reflections and sharp shadows get "
        "softer",
    ),
    (
        Mode.X4,
        "Super-Resolution 4×",
        "Cycles renders one pixel in 16 and a network adds the detail. For tests and "
        "look development; print and fine patterns get soft",
    ),
    (
        Mode.X8,
        "Super-Resolution 8×",
        "Cycles renders one pixel in 64 and a network adds the detail. For thumbnails "
        "and first looks",
    ),
    (
        Mode.CYCLES_ONLY,
        "Cycles Only",
        "Cycles renders alone, with its own denoiser, exactly as if it were the "
        "render engine",
    ),
]
_PRESETS = [
    (
        "fast",
        "Fast",
        "The small network: it takes a few seconds for a frame of full HD",
    ),
    (
        "balanced",
        "Balanced",
        "A larger network, slower, made for more detail in glossy and finely "
        "patterned things",
    ),
    (
        "paper",
        "Paper",
        "The large network exactly as its inventors, Hou and Liu, published it; far "
        "slower than the others",
    ),
]
DENOISE = [
    (
        "best",
        "Best",
        "Two pictures like High are made and mixed, with finer texture. The least "
        "noise; takes a little longer than Blender's own denoiser",
    ),
    (
        "high",
        "High",
        "The picture of Blender's own denoiser in a little more than half of its time",
    ),
    (
        "medium",
        "Medium",
        "A smaller network on guides that were denoised first: most of High's "
        "texture in two thirds of its time",
    ),
    (
        "balanced",
        "Balanced",
        "A smaller network: quicker, with less detail in fine texture",
    ),
    (
        "fast",
        "Fast",
        "The smallest network, for previews: the quickest, and the softest picture",
    ),
]


_ANIMATIONS = [
    (
        SAME_PICTURE,
        "Same Picture, Sooner",
        "Frames look as the file's own samples make them, sooner: each takes as many "
        "samples as it needs beside those of its neighbours. How many is measured in "
        "the first frames, and where fewer are hardly sooner all are taken",
    ),
    (
        SAME_TIME,
        "Same Samples, Cleaner",
        "Each frame takes the file's own samples, and the neighbours' make it better",
    ),
    (
        DEADLINE,
        "Deadline",
        "All frames together take the time that is given: each has as many samples as "
        "fit. Every frame that is finished corrects how many that are",
    ),
]

AUTOMATIC = "automatic"
_PASSES = [
    (
        AUTOMATIC,
        "Automatic",
        "All light where the output is a multilayer OpenEXR file or the compositor "
        "reads a pass of light, else none",
    ),
    (NONE, "None", "Passes of light stay as noisy as Cycles renders them"),
    (
        GROUPS,
        "Light Groups",
        "Light groups are denoised as well, and add up to the picture",
    ),
    (
        ALL,
        "All Light",
        "Light groups and the passes of diffuse, glossy, transmission, volume, "
        "emission and environment are denoised as well, and add up to the picture. "
        "Takes up to three times the denoising of the picture",
    ),
]


_STRENGTH: dict[str, Any] = {
    "name": "Strength",
    "translation_context": CONTEXT,
    "default": 1.0,
    "min": 0.0,
    "max": 1.0,
    "subtype": "FACTOR",
}


class XRDSSettings(bpy.types.PropertyGroup):
    """How the engine XRDS renders a scene."""

    mode: EnumProperty(
        name="Mode",
        translation_context=CONTEXT,
        items=_MODES,
        default=Mode.AUTOMATIC,
        description="How XRDS makes the picture: this decides how long a frame takes "
        "and how good it gets",
    )
    preset: EnumProperty(
        name="Network",
        translation_context=CONTEXT,
        items=_PRESETS,
        description="The network that adds detail to the low-resolution picture; a "
        "larger one takes longer",
    )
    denoise: EnumProperty(
        name="Denoising",
        translation_context=CONTEXT,
        items=DENOISE,
        default="high",
        description="How carefully noise is taken out of the picture. It takes as long "
        "for one sample as for a thousand",
    )
    temporal_radius: IntProperty(
        name="Frames Before and After",
        translation_context=CONTEXT,
        default=RADIUS,
        min=0,
        soft_max=8,
        max=32,
        description="In an animation, so many frames before each frame, and as many "
        "after it, give it their samples. More give less noise and flicker and take "
        "more memory; 0 renders every frame by itself",
    )
    strength: FloatProperty(
        **_STRENGTH,
        description="How much the samples of neighbouring frames count: 0 renders "
        "every frame by itself. Objects have a strength of their own in their "
        "properties, which counts as well. It can be animated",
    )
    animation: EnumProperty(
        name="Animations Keep",
        translation_context=CONTEXT,
        items=_ANIMATIONS,
        default=SAME_PICTURE,
        description="What an animation keeps of the file's settings: neighbouring "
        "frames' samples make it quicker, or better",
    )
    passes: EnumProperty(
        name="Passes",
        translation_context=CONTEXT,
        items=_PASSES,
        default=AUTOMATIC,
        description="Which passes of light are denoised with the picture, at full size",
    )
    deadline: FloatProperty(
        name="Time of All Frames",
        translation_context=CONTEXT,
        default=8 * 3600.0,
        min=1.0,
        soft_max=7 * 24 * 3600.0,
        subtype="TIME_ABSOLUTE",
        description="Seconds that the whole animation may take, from its first frame "
        "to its last",
    )
    guide_samples: IntProperty(
        name="Samples per Pixel",
        translation_context=CONTEXT,
        default=4,
        min=1,
        soft_max=64,
        description="Samples of the guides. More make metal, glass and blurred things "
        "cleaner; each takes about two thirds of a full-size sample's time",
    )
    use_exposure: BoolProperty(
        name="Fixed Exposure",
        translation_context=CONTEXT,
        description="Use one brightness factor for all frames, so that super-resolved "
        "animations do not flicker. The brightness of the picture stays as it is",
    )
    exposure: FloatProperty(
        name="Exposure",
        translation_context=CONTEXT,
        default=1.0,
        min=1e-12,
        soft_min=1e-3,
        soft_max=1e3,
        description="The network works on a picture of middle brightness: 1 suits a "
        "scene that looks right without Cycles' exposure, 2 one that is half as bright",
    )
    use_time_budget: BoolProperty(
        name="Time Budget",
        translation_context=CONTEXT,
        description="Give each frame a number of seconds: XRDS tries the scene out "
        "and takes as many samples as fit",
    )
    time_budget: FloatProperty(
        name="Time Budget",
        translation_context=CONTEXT,
        default=60.0,
        min=0.1,
        soft_max=3600.0,
        subtype="TIME_ABSOLUTE",
        description="Seconds that a frame may take, trying out included; in an "
        "animation, on the mean of its frames",
    )

    @property
    def is_timed(self) -> bool:
        """Whether a time budget chooses the samples."""
        budget = self.use_time_budget and self.animation != DEADLINE
        return self.mode == Mode.AUTOMATIC and budget


OBJECT_STRENGTH = FloatProperty(
    **_STRENGTH,
    override={"LIBRARY_OVERRIDABLE"},
    description="How much the samples of neighbouring frames count where the camera "
    "sees this object, times the scene's strength: 0 for what looks wrong in a shot",
)
"""Of each object; instances have that of the object that is instanced."""


def request_of(settings: XRDSSettings) -> Request:
    """What a scene's settings and the preferences describe."""
    here = preference_values()
    passes: tuple[str, ...] = (settings.passes,)
    if settings.passes == AUTOMATIC:
        passes = passes_looked_at(settings.id_data)
    wanted = render_request(
        scale=1,
        guide_samples=settings.guide_samples,
        preset=settings.preset,
        denoise=settings.denoise,
        device=here.device,
        exposure=settings.exposure if settings.use_exposure else None,
        time_budget=settings.time_budget if settings.is_timed else None,
        memory_limit=here.memory_limit,
        weights=here.weights,
        threads=here.threads,
        finish_stopped=here.finish_stopped,
        temporal_radius=settings.temporal_radius,
        same_picture=settings.animation == SAME_PICTURE,
        deadline=settings.deadline if settings.animation == DEADLINE else None,
        passes=passes,
    )
    return modes.in_mode(wanted, Mode(settings.mode))
