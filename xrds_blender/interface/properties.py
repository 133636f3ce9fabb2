"""The settings of XRDS that a scene keeps; samples stay with Cycles."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty

from ..frame.job import RenderJob
from .machine import machine
from .translations import CONTEXT

_SCALES = [
    ("1", "Full Size", "Every pixel is path traced, and denoised by XRDS"),
    ("2", "2×", "A quarter of the pixels are path traced"),
    ("4", "4×", "A sixteenth of the pixels are path traced"),
    ("8", "8×", "One pixel in 64 is path traced"),
]
_PRESETS = [
    ("fast", "Fast", "The fastest network"),
    ("balanced", "Balanced", "A larger network, better at gloss and fine detail"),
    ("paper", "Paper", "The network from the paper; far slower"),
]
_DENOISE = [
    ("high", "High", "The picture of Blender's own default, in 0.6 of its time"),
    ("best", "Best", "The mean of two such pictures; a little better, in its time"),
    ("balanced", "Balanced", "Quicker; a little less detail"),
    ("fast", "Fast", "Quickest, for previews"),
]
_GUIDES = [
    ("fast", "Fast", "Albedo and normal, rendered without diffuse light"),
    ("full", "Full", "Also a noisy full-size picture; slower, but sharper light"),
]


def _ask_for_passes(settings: bpy.types.PropertyGroup, _: Any) -> None:
    """Plain renders have no guides: the Render Layers nodes lose their sockets."""
    for layer in settings.id_data.view_layers:
        layer.update_render_passes()


class XRDSSettings(bpy.types.PropertyGroup):
    """How the engine XRDS renders a scene."""

    scale: EnumProperty(
        name="Scale",
        translation_context=CONTEXT,
        items=_SCALES,
        default="1",
        description="Enlargement along each side",
    )
    preset: EnumProperty(
        name="Quality",
        translation_context=CONTEXT,
        items=_PRESETS,
        description="The network that enlarges the picture",
    )
    denoise: EnumProperty(
        name="Denoising",
        translation_context=CONTEXT,
        items=_DENOISE,
        description="How carefully a full-size picture is denoised",
    )
    temporal_radius: IntProperty(
        name="Temporal Radius",
        translation_context=CONTEXT,
        default=4,
        min=0,
        soft_max=8,
        max=32,
        description="Frames before and after that lend their samples in an animation",
    )
    guides: EnumProperty(
        name="Guides",
        translation_context=CONTEXT,
        items=_GUIDES,
        description="What is rendered at full size",
    )
    guide_samples: IntProperty(
        name="Guide Samples",
        translation_context=CONTEXT,
        default=4,
        min=1,
        soft_max=64,
        description="Samples per pixel of albedo and normal",
    )
    use_exposure: BoolProperty(
        name="Fixed Exposure",
        translation_context=CONTEXT,
        description="Fix the network's exposure, for animations and border renders",
    )
    exposure: FloatProperty(
        name="Exposure",
        translation_context=CONTEXT,
        default=1.0,
        min=1e-12,
        soft_min=1e-3,
        soft_max=1e3,
        description="Factor that brings the radiance to about 0.18",
    )
    plain: BoolProperty(
        name="Plain Cycles",
        translation_context=CONTEXT,
        description="Render with Cycles alone, as if the engine were Cycles",
        update=_ask_for_passes,
    )
    use_time_budget: BoolProperty(
        name="Time Budget",
        translation_context=CONTEXT,
        description="Let XRDS choose scale, samples, guides, network and denoiser",
    )
    time_budget: FloatProperty(
        name="Time Budget",
        translation_context=CONTEXT,
        default=60.0,
        min=0.1,
        soft_max=3600.0,
        subtype="TIME_ABSOLUTE",
        description="Seconds that a frame may take; least expected error wins",
    )


def job_of(settings: XRDSSettings) -> RenderJob:
    """The job that a scene's settings and the preferences describe."""
    here = machine()
    return RenderJob(
        scale=int(settings.scale),
        guide_samples=settings.guide_samples,
        guides=settings.guides,
        preset=settings.preset,
        denoise=settings.denoise,
        temporal_radius=settings.temporal_radius if settings.scale == "1" else 0,
        device=here.device,
        exposure=settings.exposure if settings.use_exposure else None,
        plain=settings.plain,
        time_budget=settings.time_budget if settings.use_time_budget else None,
        memory_limit=here.memory_limit,
        weights=here.weights,
        threads=here.threads,
    )
