"""Options that several commands have, and the request that they describe."""

from __future__ import annotations

import argparse
from collections.abc import Collection, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from xrds_core.denoising.light_passes import NONE
from xrds_core.errors import UsageError
from xrds_core.exr.openexr_io import CODECS, FLOAT_ZIP, Encoding
from xrds_core.frames import RADIUS
from xrds_core.superres.weights_header import PRESETS

from ..planning.plan import SAVINGS
from ..planning.request import CHOICES, Request, render_request
from ..planning.settings import QUALITIES, SCALES
from . import arguments
from .scene_file import SceneChoice

DEVICE_HELP = "where the network runs: auto, cpu, cuda, cuda:1, metal"
RENDER_DEVICE_HELP = (
    "where the picture is denoised, and above scale 1 the network runs: auto, cpu, "
    "cuda, cuda:1, metal; Cycles renders where the file says"
)


def add_request(command: argparse.ArgumentParser) -> None:
    """Add what a request holds."""
    add_scene(command)
    _add_mode(command)
    _add_samples(command)
    add = command.add_argument
    add(
        "--denoise",
        choices=QUALITIES,
        default="high",
        help="quality of the denoiser at scale 1 (default: high)",
    )
    add(
        "--temporal-radius",
        type=arguments.whole,
        metavar="N",
        help="neighbour frames on each side whose samples are reused (default: 4 for "
        "several frames)",
    )
    add_strength(command, "as the file says")
    add(
        "--guide-samples",
        type=arguments.positive,
        default=4,
        help="samples per pixel of the guides (default: 4)",
    )
    add("--guide-cache", type=Path, metavar="DIR", help="folder to cache guides in")
    add(
        "--guide-limit",
        type=arguments.whole,
        default=0,
        help="samples up to which repeated renders improve the cached guides",
    )
    add(
        "--skip-nothing",
        action="store_const",
        dest="savings",
        const=(),
        default=SAVINGS,
        help="skip nothing that could be skipped",
    )
    add(
        "--seed",
        type=arguments.whole,
        help="seed of Cycles' noise, in place of the file's",
    )
    add_light(command)
    add_network(command, RENDER_DEVICE_HELP)


def add_strength(
    command: argparse.ArgumentParser, default: str, value: float | None = None
) -> None:
    """Add how much neighbours count."""
    command.add_argument(
        "--strength",
        type=arguments.share,
        default=value,
        metavar="S",
        help="how much the samples of neighbour frames count, from 0 to 1 "
        f"(default: {default})",
    )


def add_light(command: argparse.ArgumentParser) -> None:
    """Add which parts of the light are finished as well."""
    command.add_argument(
        "--passes",
        type=arguments.words,
        default=(NONE,),
        metavar="all",
        help="parts of the light that are denoised as well, and add up to the picture: "
        "none, groups (light groups), all, or names, as Emission,key (default: none)",
    )
    command.add_argument(
        "--light-aovs",
        type=arguments.words,
        default=(),
        metavar="NAMES",
        help="further passes of light, which add up to nothing",
    )


def _add_mode(command: argparse.ArgumentParser) -> None:
    """Add what decides how the picture is made: one of these alone."""
    size = command.add_mutually_exclusive_group()
    size.add_argument(
        "--scale",
        type=int,
        choices=SCALES,
        default=1,
        help="enlargement along each side by super-resolution; 1 is full size "
        "(default: 1)",
    )
    size.add_argument("--plain", action="store_true", help="render with Cycles alone")
    size.add_argument(
        "--time-budget",
        type=arguments.factor,
        metavar="SECONDS",
        help="time for a frame: as many samples as fit, on the mean of a shot",
    )


def _add_samples(command: argparse.ArgumentParser) -> None:
    """Add what decides how many samples a frame takes."""
    add = command.add_argument
    add(
        "--samples",
        type=arguments.positive,
        help="samples per pixel, in place of the file's, without its noise threshold "
        "and its time limit; above scale 1, of the low-resolution render",
    )
    add(
        "--noise-threshold",
        type=arguments.share,
        metavar="T",
        help="let pixels stop at this noise, such as 0.01; --samples, or the file's, "
        "are then the most that they take; 0 lets Cycles choose",
    )
    add(
        "--same-picture",
        action=argparse.BooleanOptionalAction,
        help="frames of a shot as the file's own samples make them, from fewer where "
        "neighbours help and that is sooner, as by default at scale 1; else cleaner "
        "ones of all samples",
    )
    add(
        "--deadline",
        type=arguments.seconds,
        metavar="TIME",
        help="time for all frames together, such as 8h or 1h30m: each takes as many "
        "samples as fit; at scale 1",
    )


def add_scene(command: argparse.ArgumentParser) -> None:
    """Add the file, and what `SceneChoice` holds but for threads."""
    add = command.add_argument
    add("scene", type=Path, metavar="SCENE.blend")
    add(
        "--resolution",
        type=arguments.size,
        metavar="WxH",
        help="size in pixels, in place of the file's",
    )
    add("--scene", dest="scene_name", metavar="NAME", help="a scene of the file")
    add("--view-layer", metavar="NAME", help="a view layer (default: the first used)")
    add("--camera", metavar="NAME", help="a camera of the scene, for all frames")
    add(
        "-y",
        "--enable-autoexec",
        action="store_true",
        dest="trusted",
        help="trust the file: run its drivers and scripts",
    )


def add_network(
    command: argparse.ArgumentParser, device_help: str = DEVICE_HELP
) -> None:
    """Add what chooses a network and how it runs."""
    add = command.add_argument
    add("--preset", choices=PRESETS, default="fast", help="the network (default: fast)")
    add(
        "--exposure",
        type=arguments.factor,
        help="fixed exposure factor, for animations and border renders",
    )
    add("--device", default="auto", help=device_help)
    add(
        "--threads",
        type=arguments.positive,
        metavar="N",
        help="threads of the processor (default: all)",
    )
    add(
        "--memory-limit",
        type=arguments.size_in_bytes,
        help="memory for the network, such as 500M or 4G",
    )
    add("--weights", type=Path, help="weights file, or a folder of them")


def add_output(command: argparse.ArgumentParser, **how: Any) -> None:
    """Add where the result goes, and how an .exr holds it."""
    add = command.add_argument
    add("-o", "--out", **how)
    add(
        "--exr-depth",
        choices=("float", "half"),
        default="float",
        help="32 or 16 bits for each number of an .exr (default: float)",
    )
    add(
        "--exr-codec",
        choices=CODECS,
        default=FLOAT_ZIP.codec,
        help="compression of an .exr (default: zip)",
    )


def add_read_limit(command: argparse.ArgumentParser) -> None:
    """Add how much memory a file may claim."""
    command.add_argument(
        "--read-limit",
        type=arguments.size_in_bytes,
        metavar="SIZE",
        help="memory that a file's pixels may take, such as 20G "
        "(default: 1G, or 1000 times the file)",
    )


def encoding_of(options: argparse.Namespace) -> Encoding:
    """How .exr files hold their pixels."""
    return Encoding(options.exr_depth == "half", options.exr_codec)


_PATHS = ("out", "sample_cache", "guide_cache", "weights")


def resolve_paths(options: argparse.Namespace) -> None:
    """Let paths that begin with // lie beside the .blend file, as Blender has it."""
    folder = options.scene.resolve().parent
    for name in _PATHS:
        value = getattr(options, name, None)
        if value is not None and str(value).startswith("//"):
            setattr(options, name, type(value)(folder / str(value).lstrip("/")))


def choice_of(options: argparse.Namespace) -> SceneChoice:
    """What of the file is rendered."""
    # `scene` is the file there
    given = _pick_options(
        options, {field.name for field in fields(SceneChoice)} - {"scene"}
    )
    return SceneChoice(options.scene_name, **given)


def request_of(options: argparse.Namespace) -> Request:
    """Build a request from the options of `add_request`; raises UsageError."""
    _check_pace(options)
    _check_light(options)
    given = _pick_options(options, CHOICES)
    given["temporal_radius"] = _temporal_radius(options)
    if options.noise_threshold is not None:  # the most, as `SceneChoice` has it
        del given["samples"]
    if options.same_picture is None:
        del given["same_picture"]
    return render_request(**given)


def _pick_options(
    options: argparse.Namespace, names: Collection[str]
) -> dict[str, Any]:
    """Those options that have one of these names."""
    return {name: value for name, value in vars(options).items() if name in names}


def _temporal_radius(options: argparse.Namespace) -> int:
    """The requested radius; by default one that pays, where frames can be reused."""
    requested: int | None = options.temporal_radius
    incompatible = _incompatible(options)
    if requested is not None:
        if requested and incompatible:
            raise UsageError(f"--temporal-radius cannot be had with {incompatible}")
        return requested
    several = len(getattr(options, "frames", None) or ()) > 1
    several |= getattr(options, "animation", False)
    several |= getattr(options, "sample_cache", None) is not None
    return RADIUS if several and not incompatible else 0


def _check_pace(options: argparse.Namespace) -> None:
    """Raise UsageError where samples are to be found, and something rules that out."""
    paces = {"--same-picture": options.same_picture, "--deadline": options.deadline}
    others = {
        "--samples": options.samples,
        **_not_full_size(options),
        "--sample-cache": getattr(options, "sample_cache", None),
    }
    chosen = [name for name, value in paces.items() if value]
    if chosen:
        _rule_out(chosen[0], dict.fromkeys(chosen[1:], True) | others)


def _check_light(options: argparse.Namespace) -> None:
    """Raise UsageError where parts of the light could not be finished."""
    if options.passes != (NONE,) or options.light_aovs:
        _rule_out("--passes", _not_full_size(options))


def _not_full_size(options: argparse.Namespace) -> dict[str, Any]:
    """The options with which XRDS may not make the picture at full size."""
    return {
        "--scale above 1": options.scale > 1,
        "--plain": options.plain,
        "--time-budget": options.time_budget,
    }


def _rule_out(option: str, others: Mapping[str, Any]) -> None:
    """Raise UsageError for the first of the others that is given beside an option."""
    for name, value in others.items():
        if value:
            raise UsageError(f"{option} cannot be had with {name}")


def _incompatible(options: argparse.Namespace) -> str:
    """The option that rules out reuse between frames; empty if none does."""
    if options.plain:
        return "--plain: Cycles renders each frame alone"
    return ""
