"""What is rendered, computed and left out, each with its reason.

Pure functions of facts: neither Blender nor torch is needed here. A saving that
is not allowed is not made; with none allowed, a render is the baseline that seconds and
differences are measured against.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace

from xrds_core.progress import duration

from .settings import counted, low_size

__all__ = [
    "DEADLINE",
    "GUIDE_CACHE",
    "SAME_PICTURE",
    "SAVINGS",
    "Decision",
    "Facts",
    "GuideRender",
    "Plan",
    "SceneFacts",
    "Strength",
    "after",
    "cycles_only",
    "deadline",
    "decide",
    "full_size",
    "guide_bounces",
    "neighbours",
    "reused_less",
    "same_picture",
    "savings_but",
]

# Mirrors and glass show other things' albedo and normals; four bounces hold them.
GUIDE_BOUNCES = 4
GUIDE_CACHE = "guide cache"
SAME_PICTURE, DEADLINE = "same picture", "deadline"
# What may be left out where a scene does not need it, by the names of the decisions.
SAVINGS = (
    "denoise",
    "guides",
    "guide samples",
    "guide bounces",
    "guide lights",
    GUIDE_CACHE,
    "motion blur",
    "network",
)
# Shares of a guide render's seconds that a saving takes off: docs/lab/measurements.md.
LIGHT_SHARE = 0.45
BOUNCE_SHARE = 0.12
# Guide samples where nothing is finer than an edge.
CRISP_SAMPLES = 2
# Cryptomatte counts what covers a pixel by samples: fewer give ragged masks.
CRYPTOMATTE_SAMPLES = 16


_SHOWN = 6  # objects that are named; more would not help a reader


@dataclass(frozen=True)
class Decision:
    """One choice; `saving_seconds` is an estimate, None where there is none."""

    decision: str
    value: str
    reason: str
    saving_seconds: float | None = None


@dataclass(frozen=True)
class GuideRender:
    """How albedo and normal are rendered.

    Lights that are not sampled still shine where a ray meets them: the camera, mirrors
    and glass see worlds and emitting surfaces as before. Lamps are left out wholly.
    """

    bounces: int = GUIDE_BOUNCES
    sample_world: bool = True
    sample_emitters: bool = True
    lamps: bool = True
    shadows: bool = True


@dataclass(frozen=True)
class Plan:
    """What was decided: the choices, and the reasons that are shown."""

    render_guides: bool
    guides: GuideRender
    guide_samples: int
    denoise: bool
    motion_blur: bool
    skip_idle: bool
    decisions: tuple[Decision, ...]


def cycles_only(reason: str) -> Plan:
    """The plan where Cycles renders alone, as the file has it."""
    decisions = (Decision("method", "Cycles only", reason),)
    return Plan(False, GuideRender(), 0, True, True, False, decisions)


def full_size(quality: str) -> Plan:
    """The plan at scale 1: all of Cycles' samples, denoised in process."""
    decisions = (
        Decision("method", "full size", "as requested"),
        Decision("denoise", quality, "in process, by Open Image Denoise"),
    )
    return Plan(False, GuideRender(), 0, True, True, False, decisions)


def savings_but(*names: str) -> tuple[str, ...]:
    """All savings but those named."""
    return tuple(name for name in SAVINGS if name not in names)


def decide(facts: Facts, savings: Collection[str] = SAVINGS) -> Plan:
    """Every decision about one picture, before it is rendered.

    `savings` names those that may be made.
    """
    denoise, of_denoiser = _denoise(facts, "denoise" in savings)
    rendered, of_guides = _render_guides(facts, "guides" in savings)
    samples, of_samples = _samples(facts, "guide samples" in savings)
    bounces, of_bounces = _bounces(facts, "guide bounces" in savings)
    lights, of_lights = _lights(facts, "guide lights" in savings)
    blurred, of_blur = _motion_blur(facts, "motion blur" in savings)
    idle, of_network = _idle("network" in savings)
    decisions: tuple[Decision, ...] = (of_denoiser, of_guides)
    if rendered:
        decisions += (of_samples, of_bounces, of_lights)
    return Plan(
        render_guides=rendered,
        guides=replace(lights, bounces=bounces),
        guide_samples=samples,
        denoise=denoise,
        motion_blur=blurred,
        skip_idle=idle,
        decisions=(*decisions, *of_blur, of_network, _low_frame(facts)),
    )


def after(first_sync: float, second_sync: float) -> tuple[Decision, ...]:
    """What the render itself showed: seconds of scene sync and BVH of both passes."""
    reason = "the second render keeps geometry, images and BVH of the first"
    saving = max(first_sync - second_sync, 0.0)
    return (Decision("sessions", "one", reason, saving),)


def guide_bounces(max_bounces: int) -> int:
    """Bounces of the guide render, never more than the scene's own."""
    return min(max_bounces, GUIDE_BOUNCES)


def _denoise(facts: Facts, allowed: bool) -> tuple[bool, Decision]:
    scene, name = facts.scene, "denoise"
    if not facts.has_denoiser:
        reason = (
            "neither this Blender nor its Python has Open Image Denoise; expect noise"
        )
        return False, Decision(name, "skipped", reason)
    blurred = scene.depth_of_field or (scene.motion_blur and scene.moving)
    if allowed and not (scene.scatters or scene.volumes or blurred):
        reason = "every surface only emits: the low-resolution picture has no noise"
        return False, Decision(name, "skipped", reason)
    reason = "the networks were trained on denoised low-resolution pictures"
    return True, Decision(name, "low resolution", reason)


def _render_guides(facts: Facts, allowed: bool) -> tuple[bool, Decision]:
    scene, name = facts.scene, "guides"
    seen = scene.surfaces or scene.volumes or scene.world == "varies"
    seen = seen or bool(scene.passes)  # they come with the guides
    if seen or not allowed:
        reason = "albedo and normal carry what the low resolution cannot"
        return True, Decision(name, "rendered", reason)
    reason = "nothing but an even background: the picture itself is the guide"
    return False, Decision(name, "none", reason, facts.guide_seconds)


def _samples(facts: Facts, allowed: bool) -> tuple[int, Decision]:
    requested, name = facts.guide_samples, "guide samples"
    masks = any(name.startswith("cryptomatte") for name in facts.scene.passes)
    if masks and requested < CRYPTOMATTE_SAMPLES:
        reason = (
            f"Cryptomatte is on: its masks need more than the {requested} requested"
        )
        decision = Decision(name, str(CRYPTOMATTE_SAMPLES), reason)
        return CRYPTOMATTE_SAMPLES, decision
    fine = _fine_detail(facts.scene)
    if fine or masks or not allowed or requested <= CRISP_SAMPLES:
        reason = f"as requested; the scene has {fine}" if fine else "as requested"
        return requested, Decision(name, str(requested), reason)
    saving = _part(facts, 1 - CRISP_SAMPLES / requested)
    reason = "even colours on sharp surfaces: only edges need samples"
    return CRISP_SAMPLES, Decision(name, str(CRISP_SAMPLES), reason, saving)


def _fine_detail(scene: SceneFacts) -> str:
    """What makes albedo and normal vary within a pixel, or noisy; empty if nothing."""
    causes = {
        "textures": scene.textures or scene.world == "varies",
        "bump": scene.bump,
        "displacement": scene.displacement,
        "hair": scene.hair,
        "mirrors or glass": scene.smooth,
        "transparency": scene.transparent,
        "volumes": scene.volumes,
        "depth of field": scene.depth_of_field,
        "motion blur": scene.motion_blur and scene.moving,
    }
    return ", ".join(name for name, present in causes.items() if present)


def _bounces(facts: Facts, allowed: bool) -> tuple[int, Decision]:
    scene, name = facts.scene, "guide bounces"
    # A ray that glances off a part-transparent surface carries its features along.
    if not allowed or scene.smooth or scene.transparent or scene.volumes:
        bounces = guide_bounces(facts.max_bounces)
        reason = "albedo and normal follow mirrors and glass, never diffuse light"
        return bounces, Decision(name, f"{bounces}, none diffuse", reason)
    reason = "no mirror, glass, alpha or volume: the first surface decides"
    return 0, Decision(name, "0", reason, _part(facts, BOUNCE_SHARE))


def _lights(facts: Facts, allowed: bool) -> tuple[GuideRender, Decision]:
    scene, name = facts.scene, "guide lights"
    if not allowed:
        return GuideRender(), Decision(name, "all", "as in the picture")
    saving = _part(facts, LIGHT_SHARE)
    # Without lamps volumes would be sampled by other random numbers.
    lamps = scene.seen_lamps > 0 or (scene.volumes and scene.lamps > 0)
    dark = GuideRender(0, False, False, lamps, False)
    if lamps:
        reason = "lamps stay, without shadows: mirrors, glass or volumes may show them"
        return dark, Decision(name, "lamps alone", reason, saving)
    reason = "light does not change albedo or normal; what shines stays visible"
    return dark, Decision(name, "none sampled", reason, saving)


def _motion_blur(facts: Facts, allowed: bool) -> tuple[bool, tuple[Decision, ...]]:
    scene, name = facts.scene, "motion blur"
    if not scene.motion_blur:
        return False, ()
    if scene.moving or not allowed:
        moving = ", ".join(scene.moving) or "not examined"
        return True, (Decision(name, "on", f"moving: {moving}"),)
    return False, (Decision(name, "skipped", "requested, but nothing moves"),)


def _idle(allowed: bool) -> tuple[bool, Decision]:
    name = "network"
    if not allowed:
        return False, Decision(name, "whole picture", "as requested")
    reason = "an even background needs no network: the base is the picture"
    return True, Decision(name, "without empty parts", reason)


def _low_frame(facts: Facts) -> Decision:
    width, height = low_size(facts.width, facts.height, facts.scale)
    size = f"{width}x{height}"
    if not facts.exact_camera:
        reason = "a panorama cannot be widened: resampled by normalised coordinates"
        return Decision("low frame", size, reason)
    covered = f"{width * facts.scale}x{height * facts.scale}"
    reason = f"covers {covered} pixels of a {facts.width}x{facts.height} frame"
    return Decision("low frame", size, reason)


def _part(facts: Facts, share: float) -> float | None:
    return None if facts.guide_seconds is None else share * facts.guide_seconds


# --- Shots ---------------------------------------------------------------------------


@dataclass(frozen=True)
class Strength:
    """How much neighbours count: in the scene, and times that on objects, by name.

    That of the scene is keyed where it may be another one in other frames.
    """

    of_scene: float = 1.0
    is_keyed: bool = False
    of_objects: Mapping[str, float] = field(default_factory=dict)


def neighbours(
    facts: Facts, radius: int, strength: Strength | None = None
) -> tuple[Decision, ...]:
    """The decisions of a shot whose frames reuse samples of `radius` to each side."""
    name, scene, strength = "accumulation", facts.scene, strength or Strength()
    if not (strength.of_scene or strength.is_keyed):
        reason = "their strength is 0: each frame is alone"
        return (Decision(name, "none", reason),)
    if not facts.reprojects:
        reason = "this panorama cannot be reprojected: each frame is alone"
        return (Decision(name, "none", reason),)
    value = f"{radius} frames to each side"
    rest = tuple(_strength(facts, strength))
    if not scene.moving:
        reason = "nothing moves: frames differ in noise alone, and every sample counts"
        return (Decision(name, value, reason), *rest)
    reason = "pixels are found again by depth, cameras and motion, if the light agrees"
    return Decision(name, value, reason), _images(facts), *rest


def same_picture(samples: int) -> Decision:
    """The decision of a shot that may have fewer samples than the file's."""
    reason = (
        f"each frame takes as many of {samples} samples as it needs beside its "
        "neighbours', as the first frame shows"
    )
    return Decision(SAME_PICTURE, "as few samples as it needs", reason)


def deadline(seconds: float, frames: int) -> Decision:
    """The decision of a shot that is to be finished in some seconds."""
    reason = "each takes as many samples as fit, and what it took corrects the next"
    value = f"{duration(seconds)} for {counted(frames, 'frame')}"
    return Decision(DEADLINE, value, reason)


def _images(facts: Facts) -> Decision:
    name = "images"
    if facts.scale > 1:
        reason = "above scale 1 neighbours are found by surfaces alone"
        return Decision(name, "skipped", reason)
    if facts.scene.smooth:
        reason = "where the camera moves, mirrors and glass are found by their images"
        return Decision(name, "followed", reason)
    reason = "nothing is as smooth as a mirror or clear glass"
    return Decision(name, "skipped", reason)


MOTION_BLUR = "Motion blur: moving things that blur reuse fewer samples"
DEPTH_OF_FIELD = "Depth of field: blurred pixels mix many depths and reuse less"
GLASS = "Glass: thick glass shows several things at once, so it gains less"
VOLUMES = "Volumes: haze has no depth, it is reused with the surface behind it"
HAIR = "Hair: strands finer than a pixel reuse fewer samples"


def reused_less(scene: SceneFacts) -> list[str]:
    """A sentence for each thing in a shot that gains less from its neighbours."""
    if not scene.moving:
        return []
    causes = {
        MOTION_BLUR: scene.motion_blur,
        DEPTH_OF_FIELD: scene.depth_of_field,
        GLASS: scene.glass,
        VOLUMES: scene.volumes,
        HAIR: scene.hair,
    }
    return [sentence for sentence, is_there in causes.items() if is_there]


def _strength(facts: Facts, strength: Strength) -> Iterator[Decision]:
    if strength.is_keyed or strength.of_scene != 1.0:
        value = f"{strength.of_scene:.2g}{', keyed' if strength.is_keyed else ''}"
        yield Decision("strength", value, "so much do neighbours count, 1 being all")
    if strength.of_objects:
        named = [f"{name} {value:.2g}" for name, value in strength.of_objects.items()]
        reason = "so much do neighbours count where the camera sees them"
        if facts.scale > 1:
            reason = "not used: above scale 1 that of the scene counts alone"
        more = len(named) - _SHOWN
        value = ", ".join(named[:_SHOWN]) + (f" and {more} more" if more > 0 else "")
        yield Decision("strength of objects", value, reason)


@dataclass(frozen=True)
class SceneFacts:
    """What a scene holds; see `scene_facts` for how it is found."""

    surfaces: bool = True
    """Anything at all that a ray can hit."""
    scatters: bool = True
    """Some surface or volume reflects light: radiance is noisy."""
    smooth: bool = True
    """Mirrors, glass or gloss so smooth that they show others' albedo and normals."""
    glass: bool = True
    """Some of it bends light and does not scatter it."""
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
