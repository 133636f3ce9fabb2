"""Which channels of a file hold what, by the names that renderers give to passes."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

from ..accumulation.passes import LAYOUT
from ..errors import Unfit
from ..exr.channels import COMPONENTS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..exr.channels import Channels


COMBINED = "Combined"  # Cycles' name
NOISY, ALBEDO, CAMERA_NORMAL, PATH_LENGTH = (
    LAYOUT[name].name for name in ("radiance", "albedo", "normal", "path_length")
)
NOISE = "XRDS Noise"  # of the samples, as XRDS estimated it before storing them
# Names of passes in the order in which they are tried, case-insensitive.
_USUAL = {
    "beauty": (NOISY, COMBINED, "beauty", "RGBA", "rgb", "C", "Ci"),
    "albedo": (ALBEDO, "albedo", "denoise_albedo", "diffuse_albedo"),
    "normal": (CAMERA_NORMAL, "Normal", "normals", "denoise_normal", "N", "Nn"),
    "position": ("Position", "P", "Pworld"),
    "depth": ("Depth", "Z", PATH_LENGTH),
    "vector": ("Vector", "motion", "motionvector", "forward"),
}
_SINGLE = ("Z", "V", "R", "Y", "z", "r")
_MOTION = ("XYZW", "RGBA", "xyzw", "XY", "RG", "xy", "rg", "UV", "uv")


@dataclass(frozen=True)
class PassNames:
    """What the passes of a file are called; None for the usual names.

    Layers before the names may be left out. `beauty` is the noisy radiance.
    """

    beauty: str | None = None
    albedo: str | None = None
    normal: str | None = None
    position: str | None = None
    depth: str | None = None
    vector: str | None = None


PASSES = tuple(field.name for field in fields(PassNames))


@dataclass(frozen=True)
class PassChannels:
    """The full names of the channels of the passes that a file has.

    Lists are empty where the file lacks a pass.

    Attributes
    ----------
    beauty : list of str
        Noisy radiance.
    albedo, normal : list of str
        Guides.
    position, depth, vector : list of str
        Geometry and motion.
    noise : list of str
        Noise that XRDS has stored.
    others : dict of str to list of str
        Passes of `LAYOUT` that have one name alone, by the name of their field.
    picture : list of str
        Channels that the finished picture is written to: R, G, B.
    alpha : str or None
        The channel with the alpha of the input.
    has_camera_normal : bool
        Whether normals are in camera space.
    has_length : bool
        Whether depth is a length along the ray.
    """

    beauty: list[str]
    albedo: list[str]
    normal: list[str]
    position: list[str]
    depth: list[str]
    vector: list[str]
    noise: list[str]
    others: dict[str, list[str]]
    picture: list[str]
    alpha: str | None
    has_camera_normal: bool
    has_length: bool


def find_passes(channels: Channels, names: PassNames) -> PassChannels:
    """Find the passes of a file.

    Parameters
    ----------
    channels : Channels
        Names of the file's channels.
    names : PassNames
        What its passes are called.

    Returns
    -------
    passes : PassChannels

    Raises
    ------
    Unfit
        If beauty, albedo or normal is missing, or a pass requested by its name.
    PictureError
        If several layers hold a pass.
    """
    beauty = _find_pass(channels, names, "beauty")
    prefix = "" if beauty is None else beauty
    radiance = channels.of(prefix)
    if not radiance:
        raise _missing_error(
            channels, "beauty", names.beauty or f"{NOISY}, {COMBINED}, RGB"
        )
    target = _find_target(channels, prefix)
    alphas = [f"{x}.A" if x else "A" for x in (prefix, target)]
    normal, depth = _find_pass(channels, names, "normal"), _find_depth(channels, names)
    return PassChannels(
        beauty=radiance,
        albedo=_require_channels(channels, names, "albedo"),
        normal=_require_channels(channels, names, "normal"),
        position=_find_channels(channels, names, "position"),
        depth=depth,
        vector=_find_channels(channels, names, "vector", _MOTION),
        noise=_by_name(channels, NOISE, ("XYZ",)),
        others=_find_others(channels, depth),
        picture=channels.of(target) or ["R", "G", "B"],
        alpha=next((x for x in alphas if x in channels.names), None),
        has_camera_normal=(normal or "").endswith(CAMERA_NORMAL),
        has_length=any(PATH_LENGTH in name for name in depth),
    )


def _find_others(channels: Channels, depth: list[str]) -> dict[str, list[str]]:
    """The passes that have one name alone, but for one that serves as depth."""
    names = LAYOUT.keys() - {*_USUAL, "radiance", "alpha"}
    others = {}
    for name in sorted(names):
        layout = LAYOUT[name]
        letters = (layout.letters, *(() if layout.channels else _SINGLE))
        full_names = _by_name(channels, layout.name, letters)
        if full_names and full_names != depth:
            others[name] = full_names
    return others


def _by_name(channels: Channels, name: str, letters: Sequence[str]) -> list[str]:
    """The channels of a pass of this name."""
    full_name = channels.find(name, letters)
    return [] if full_name is None else channels.of(full_name, letters)


def _find_target(channels: Channels, prefix: str) -> str:
    """The pass that the denoised picture is written to: Cycles has two of them."""
    layer, _, name = prefix.rpartition(".")
    if name != NOISY:
        return prefix
    combined = f"{layer}.{COMBINED}" if layer else COMBINED
    return combined if channels.of(combined) else ""


def _find_pass(
    channels: Channels,
    names: PassNames,
    kind: str,
    letters: Sequence[str] = COMPONENTS,
) -> str | None:
    """The full name of a pass; None where there is none of the usual names."""
    requested = getattr(names, kind)
    if requested is not None:
        full_name = channels.find(requested, letters)
        if full_name is None:
            raise _missing_error(channels, kind, requested)
        return full_name
    if kind == "beauty" and channels.of("") and not channels.find(NOISY):
        return None  # plain R, G, B
    for wanted in _USUAL[kind]:
        full_name = channels.find(wanted, letters, any_case=True)
        if full_name is not None:
            return full_name
    return None


def _find_channels(
    channels: Channels,
    names: PassNames,
    kind: str,
    letters: Sequence[str] = COMPONENTS,
) -> list[str]:
    full_name = _find_pass(channels, names, kind, letters)
    return [] if full_name is None else channels.of(full_name, letters)


def _find_depth(channels: Channels, names: PassNames) -> list[str]:
    """Depth is one channel: `Depth.Z`, or without a pass `Z`."""
    wanted = (names.depth,) if names.depth else _USUAL["depth"]
    usual = [x.lower() for x in wanted]
    plain = [name for name in channels.names if name.lower() in usual]
    return plain[:1] or _find_channels(channels, names, "depth", _SINGLE)


def _require_channels(channels: Channels, names: PassNames, kind: str) -> list[str]:
    channel_names = _find_channels(channels, names, kind)
    if not channel_names:
        raise _missing_error(channels, kind, getattr(names, kind) or _USUAL[kind][0])
    return channel_names


def _missing_error(channels: Channels, kind: str, name: str) -> Unfit:
    return Unfit(
        f"{channels.path} has no {kind} ({name}); it holds {channels.contents()}; "
        f"render it too, or name the pass with --{kind}"
    )
