"""Enlarging a render from files: what `xrds upscale` does."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch

from ..errors import UsageError
from ..exr import CYCLES, Names, read_beauty, read_guides, write_picture
from ..exr.openexr_io import FLOAT_ZIP, Encoding
from ..files import check_output, check_place
from ..progress import Callback
from ..version import package_version
from .upscaler import Upscaler


def upscale_file(
    beauty: str | Path,
    guide_file: str | Path,
    output: str | Path,
    *,
    guide_samples: int | None = None,
    exposure: float | None = None,
    memory_limit: int | None = None,
    names: Names = CYCLES,
    encoding: Encoding = FLOAT_ZIP,
    threads: int | None = None,
    progress: Callback | None = None,
    **network: Any,
) -> dict[str, Any]:
    """Enlarge a low-resolution EXR under full-resolution passes; write an EXR.

    Parameters
    ----------
    beauty : str or Path
        The low-resolution render, denoised. The noisy picture, where the file has one
        too, shows what the denoiser took away.
    guide_file : str or Path
        File with albedo and normal.
    output : str or Path
        File for R, G, B, scene-linear, and A if `beauty` has it; the folder is made.
    guide_samples : int, optional
        Samples per pixel of the guides; None where they are many, or not known.
    exposure : float, optional
        Exposure of a picture that this is a part of; None finds it.
    memory_limit : int, optional
        Bytes to aim at.
    names : Names
        What passes are called in both files.
    encoding : Encoding
        How the output's pixels are stored.
    threads : int, optional
        Threads of the processor, from now on.
    progress : callable, optional
        Takes fractions from 0 to exactly 1; False as its result cancels.
    **network
        What `Upscaler` is made of: preset, scale, device, precision, weights.

    Returns
    -------
    result : dict
        `output`, `seconds` (wall clock, files included), `bad_pixels` and `tiles`.

    Raises
    ------
    PictureError
        If a file cannot be read, written, or lacks a pass.
    UsageError
        If `output` does not end in .exr, or the device or precision is not there.
    WeightsError
        If the weights are missing, damaged or of another scale.
    Cancelled
        If `progress` returned False.
    """
    start = time.perf_counter()
    _check_output(Path(output), (beauty, guide_file))
    if threads is not None:
        torch.set_num_threads(threads)
    upscaler = Upscaler(**network)
    low, passes = read_beauty(beauty, names), read_guides(guide_file, names)
    result = upscaler(
        low.picture,
        passes.albedo,
        passes.normal,
        noisy=low.noisy,
        guide_alpha=None if low.alpha is None else passes.alpha,
        guide_samples=guide_samples,
        exposure=exposure,
        memory_limit=memory_limit,
        progress=progress,
    )
    planes = zip("RGBA", np.moveaxis(result.radiance, 2, 0), strict=False)
    metadata = _metadata(upscaler, time.perf_counter() - start)
    write_picture(output, dict(planes), encoding, metadata)
    return {
        "output": str(output),
        "seconds": time.perf_counter() - start,
        "bad_pixels": result.bad_pixels,
        "tiles": result.tiles,
    }


def _metadata(upscaler: Upscaler, seconds: float) -> dict[str, str]:
    """What made the picture, for the file."""
    record = {
        "version": package_version(),
        "mode": "super-resolution",
        "scale": upscaler.scale,
        "preset": upscaler.preset,
        "device": upscaler.device_name,
        "seconds": f"{seconds:.1f}",
    }
    return {f"xrds.{name}": str(value) for name, value in record.items()}


def _check_output(path: Path, inputs: Sequence[str | Path]) -> None:
    check_place(path)
    if path.suffix.lower() != ".exr":
        raise UsageError(
            f"output {str(path)!r} must end in .exr: without Blender there is no view "
            "transform to make another format with"
        )
    check_output(path, inputs)
