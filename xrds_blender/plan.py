"""What is rendered, computed and left out, each with its reason.

Pure functions of facts: neither Blender nor torch is needed here.
"""

from __future__ import annotations

from dataclasses import dataclass

# Mirrors and glass show other things' albedo and normals; four bounces hold them.
GUIDE_BOUNCES = 4
# Cryptomatte counts what covers a pixel by samples: fewer give ragged masks.
CRYPTOMATTE_SAMPLES = 16


@dataclass(frozen=True)
class Facts:
    """What of a scene and a Blender the decisions rest on; sizes in pixels."""

    scale: int
    width: int
    height: int
    guides: str
    max_bounces: int
    has_denoiser: bool
    exact_camera: bool


@dataclass(frozen=True)
class Decision:
    """One choice; `saving_seconds` is None where nothing was measured."""

    decision: str
    value: str
    reason: str
    saving_seconds: float | None = None


def plain(reason: str) -> tuple[Decision, ...]:
    """The only decision where Cycles renders alone."""
    return (Decision("method", "plain", reason),)


def decide(facts: Facts) -> tuple[Decision, ...]:
    """Every decision about one picture, before it is rendered."""
    return (_denoise(facts), _bounces(facts), _low_frame(facts))


def after(first_sync: float, second_sync: float) -> tuple[Decision, ...]:
    """What the render itself showed: seconds of scene sync and BVH of both passes."""
    reason = "the second render keeps geometry, images and BVH of the first"
    saving = max(first_sync - second_sync, 0.0)
    return (Decision("sessions", "one", reason, saving),)


def guide_bounces(max_bounces: int) -> int:
    """Bounces of the guide render, never more than the scene's own."""
    return min(max_bounces, GUIDE_BOUNCES)


def guide_samples(asked: int, cryptomatte: bool) -> tuple[int, tuple[Decision, ...]]:
    """Samples of the guide render, and the decision where they are not those asked."""
    if not cryptomatte or asked >= CRYPTOMATTE_SAMPLES:
        return asked, ()
    reason = f"Cryptomatte is on: its masks need more than the {asked} asked for"
    told = Decision("guide samples", str(CRYPTOMATTE_SAMPLES), reason)
    return CRYPTOMATTE_SAMPLES, (told,)


def _denoise(facts: Facts) -> Decision:
    if facts.has_denoiser:
        reason = "the networks were trained on denoised low-resolution pictures"
        return Decision("denoise", "low resolution", reason)
    reason = "this Blender was built without OpenImageDenoise; expect noise"
    return Decision("denoise", "skipped", reason)


def _bounces(facts: Facts) -> Decision:
    if facts.guides == "full":
        reason = "full guides hold the light of every bounce"
        return Decision("guide bounces", str(facts.max_bounces), reason)
    bounces = guide_bounces(facts.max_bounces)
    reason = (
        "albedo and normal follow mirrors and glass, never diffuse light or volumes"
    )
    return Decision("guide bounces", f"{bounces}, none diffuse", reason)


def _low_frame(facts: Facts) -> Decision:
    width, height = -(-facts.width // facts.scale), -(-facts.height // facts.scale)
    size = f"{width}x{height}"
    if not facts.exact_camera:
        reason = "a panorama cannot be widened: resampled by normalised coordinates"
        return Decision("low frame", size, reason)
    covered = f"{width * facts.scale}x{height * facts.scale}"
    reason = f"covers {covered} of the {facts.width}x{facts.height} frame's pixels"
    return Decision("low frame", size, reason)
