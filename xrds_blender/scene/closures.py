"""What a shader node tree can do to light, read from its nodes without rendering.

Every doubt is decided for the dearer side: a node that is not known here is taken to
mirror, to let through and to vary. Works on whatever looks like Blender's nodes.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from typing import Any

# Cycles carries albedo and normal on to the next surface where at least three quarters
# of the closures are smoother than a GGX alpha of 0.075, which is roughness squared
# (kernel/film/denoising_passes.h).
SMOOTH = 0.28
# Anisotropy stretches alpha along one direction and shrinks it along the other.
SMOOTH_ANISOTROPIC = 0.5

_DIFFUSE = {
    "BSDF_DIFFUSE",
    "BSDF_TRANSLUCENT",
    "BSDF_SHEEN",
    "BSDF_VELVET",
    "BSDF_TOON",
}
_HAIR = {"BSDF_HAIR", "BSDF_HAIR_PRINCIPLED"}
_GLASS = {"BSDF_GLASS", "BSDF_REFRACTION"}
_MICROFACETS = {"BSDF_GLOSSY", "BSDF_GLASS", "BSDF_REFRACTION", "BSDF_METALLIC"}
_DISTRIBUTIONS = {"GGX", "MULTI_GGX", "BECKMANN", "PHYSICAL_CONDUCTOR", "F82"}
_VOLUMES = {
    "VOLUME_ABSORPTION",
    "VOLUME_SCATTER",
    "VOLUME_COEFFICIENTS",
    "PRINCIPLED_VOLUME",
}
_MIXES = {"MIX_SHADER", "ADD_SHADER", "HOLDOUT", "OUTPUT_MATERIAL", "OUTPUT_WORLD"}
# Plumbing and arithmetic: they neither shade nor vary over a surface by themselves.
_VALUES = {
    "GROUP",
    "GROUP_INPUT",
    "GROUP_OUTPUT",
    "REROUTE",
    "FRAME",
    "RGB",
    "VALUE",
    "MATH",
    "VECT_MATH",
    "MIX",
    "MIX_RGB",
    "MAP_RANGE",
    "CLAMP",
    "VALTORGB",
    "RGBTOBW",
    "GAMMA",
    "BRIGHTCONTRAST",
    "HUE_SAT",
    "INVERT",
    "CURVE_RGB",
    "CURVE_VEC",
    "CURVE_FLOAT",
    "SEPARATE_COLOR",
    "COMBINE_COLOR",
    "SEPRGB",
    "COMBRGB",
    "SEPXYZ",
    "COMBXYZ",
    "BLACKBODY",
    "WAVELENGTH",
    "OUTPUT_AOV",
}
# They tell rays apart or look at the view: smooth over a surface, nothing to resolve.
_VIEWS = {"FRESNEL", "LAYER_WEIGHT", "LIGHT_PATH", "CAMERA", "LIGHT_FALLOFF"}
_BUMPS = {"BUMP", "NORMAL_MAP", "BEVEL"}
_DISPLACEMENTS = {"DISPLACEMENT", "VECTOR_DISPLACEMENT"}


@dataclass(frozen=True)
class Closures:
    """What is found in one tree, or in several taken together."""

    scatters: bool = False
    """Some closure reflects or transmits light, so that its radiance is noisy."""
    smooth: bool = False
    """Albedo and normal may be those of what a mirror or glass shows."""
    glass: bool = False
    """Light goes through it without being scattered, and is bent."""
    transparent: bool = False
    emits: bool = False
    volume: bool = False
    subsurface: bool = False
    varies: bool = False
    """Textures, attributes or other inputs that change over a surface."""
    bump: bool = False
    displaced: bool = False
    unknown: tuple[str, ...] = ()

    def __or__(self, other: Closures) -> Closures:
        merged: dict[str, Any] = {
            item.name: getattr(self, item.name) or getattr(other, item.name)
            for item in fields(self)
        }
        merged["unknown"] = tuple(sorted({*self.unknown, *other.unknown}))
        return Closures(**merged)


# Nodes whose settings change nothing of what they add.
_FIXED = {
    **dict.fromkeys(_DIFFUSE, Closures(scatters=True)),
    **dict.fromkeys(_HAIR, Closures(scatters=True, varies=True)),
    **dict.fromkeys(_VOLUMES, Closures(scatters=True, volume=True)),
    **dict.fromkeys(_MIXES | _VALUES | _VIEWS, Closures()),
    **dict.fromkeys(_BUMPS, Closures(bump=True)),
    **dict.fromkeys(_DISPLACEMENTS, Closures(displaced=True)),
    "SUBSURFACE_SCATTERING": Closures(scatters=True, subsurface=True),
    "BSDF_TRANSPARENT": Closures(transparent=True),
}


def of_tree(tree: Any) -> Closures:
    """What the nodes that reach the tree's output can do."""
    closures = Closures()
    for node in reachable(tree):
        closures |= of_node(node)
    return closures


def reachable(tree: Any) -> Iterator[Any]:
    """Nodes that feed an output, groups opened; each once."""
    seen: set[int] = set()
    waiting = list(outputs(tree))
    while waiting:
        node = waiting.pop()
        if node.as_pointer() in seen:
            continue
        seen.add(node.as_pointer())
        yield node
        waiting += [link.from_node for socket in node.inputs for link in _links(socket)]
        if node.type == "GROUP" and node.node_tree:
            waiting += outputs(node.node_tree)


def outputs(tree: Any) -> Iterable[Any]:
    """The nodes that a tree's or a group's effects leave by."""
    ends = ("OUTPUT_MATERIAL", "OUTPUT_WORLD", "OUTPUT_LIGHT", "GROUP_OUTPUT")
    return [node for node in tree.nodes if node.type in (*ends, "OUTPUT_AOV")]


def of_node(node: Any) -> Closures:
    """What one node adds."""
    kind = node.type
    if kind in _FIXED:
        return _FIXED[kind]
    if kind == "BSDF_PRINCIPLED":
        return _principled(node)
    if kind in _MICROFACETS:
        smooth = _is_smooth(node)
        return Closures(scatters=True, smooth=smooth, glass=smooth and kind in _GLASS)
    if kind in {"EMISSION", "BACKGROUND"}:
        return Closures(emits=_is_lit(node, "Color", "Strength"))
    if all(socket.type != "SHADER" for socket in node.outputs):
        return Closures(varies=True)  # textures, attributes, coordinates
    anything: dict[str, Any] = dict.fromkeys((x.name for x in fields(Closures)), True)
    return Closures(**{**anything, "unknown": (kind,)})


def _principled(node: Any) -> Closures:
    metallic, glass = (
        _is_above(node, "Metallic"),
        _is_above(node, "Transmission Weight"),
    )
    coat = _is_above(node, "Coat Weight") and _may_be_below(node, "Coat Roughness")
    gloss = metallic or glass or _is_above(node, "Specular IOR Level")
    alpha = node.inputs["Alpha"]
    subsurface = _is_above(node, "Subsurface Weight")
    return Closures(
        scatters=True,
        smooth=coat or (gloss and _is_smooth(node)),
        glass=glass and _is_smooth(node),
        transparent=bool(_links(alpha)) or alpha.default_value < 1.0,
        emits=_is_lit(node, "Emission Color", "Emission Strength"),
        subsurface=subsurface,
    )


def _is_smooth(node: Any) -> bool:
    if getattr(node, "distribution", "GGX") not in _DISTRIBUTIONS:
        return True
    stretched = "Anisotropic" in node.inputs or "Anisotropy" in node.inputs
    name = "Anisotropy" if "Anisotropy" in node.inputs else "Anisotropic"
    limit = SMOOTH
    if stretched and (_links(node.inputs[name]) or node.inputs[name].default_value):
        limit = SMOOTH_ANISOTROPIC
    return _may_be_below(node, "Roughness", limit)


def _may_be_below(node: Any, name: str, limit: float = SMOOTH) -> bool:
    socket = node.inputs[name]
    return bool(_links(socket)) or socket.default_value < limit


def _is_above(node: Any, name: str) -> bool:
    """Whether an input can be above 0; one that is not there cannot be ruled out."""
    if name not in node.inputs:
        return True
    socket = node.inputs[name]
    return bool(_links(socket)) or socket.default_value > 0.0


def _is_lit(node: Any, colour: str, strength: str) -> bool:
    tint = node.inputs[colour]
    coloured = bool(_links(tint)) or any(v > 0.0 for v in tint.default_value[:3])
    socket = node.inputs[strength]
    return coloured and (bool(_links(socket)) or socket.default_value != 0.0)


def _links(socket: Any) -> list[Any]:
    """The links of a socket; asking the tree again each time is slow, so only then."""
    return list(socket.links) if socket.is_linked else []
