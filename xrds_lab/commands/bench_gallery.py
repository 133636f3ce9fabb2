"""`xrds bench gallery`: small shots of what films hold."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from xrds_blender.command import arguments
from xrds_blender.command.console import need_blender

HALVES = ("choosing", "judging")


def add_gallery(benches: Any) -> argparse.ArgumentParser:
    """Add `xrds bench gallery`."""
    command: argparse.ArgumentParser = benches.add_parser(
        "gallery", help="judge small shots block by block against frames alone"
    )
    add = command.add_argument
    add("names", nargs="*", metavar="NAME", help="of the shots; all")
    add("--half", choices=HALVES, help="its shots alone")
    add("--samples", type=arguments.integers, help="per frame, as 2,16; 2,4,16")
    add(
        "--reference-samples",
        type=arguments.positive,
        help="of each half; 512",
    )
    add(
        "--resolution",
        type=arguments.size,
        metavar="WxH",
        help="in place of the shots' own",
    )
    add("--cache", type=Path, help="folder of rendered inputs; OUT/cache")
    add("--middle-only", action="store_true", help="judge no first frames")
    add("--references-only", action="store_true", help="render these, judge nothing")
    add(
        "--crops",
        action="store_true",
        help="also crops.webp: the shots with neighbours that nothing judges, by XRDS",
    )
    command.set_defaults(work=_gallery)
    return command


def _gallery(options: argparse.Namespace) -> dict[str, Any]:
    need_blender("bench")
    from ..gallery.bench import bench_gallery
    from ..gallery.frames import REFERENCE_SAMPLES, Measure
    from ..gallery.stage import SIZE
    from ..gallery.table import SAMPLES

    measure = Measure(
        options.samples or SAMPLES,
        options.reference_samples or REFERENCE_SAMPLES,
        options.resolution or SIZE,
        options.middle_only,
    )
    return bench_gallery(
        options.names,
        options.out,
        measure,
        cache=options.cache,
        half=options.half,
        references_only=options.references_only,
        crops=options.crops,
    )
