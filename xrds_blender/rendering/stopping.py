"""What Esc and Ctrl-C leave: the samples there are, denoised as quickly as can be."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..cycles import session
from ..cycles.low_resolution import Beauty, LowSamples
from ..cycles.samples import samples_in
from ..planning.request import Request
from ..planning.settings import Denoising
from .enlarging import enlarged
from .loading import in_process, load_denoiser


def finish_samples(engine: Any, layer_name: str, request: Request) -> None:
    """Denoise the full-size samples in the result, if the request asks for it."""
    if not request.finish_stopped:
        return
    denoiser = load_denoiser("fast", request.machine)
    noisy = samples_in(engine, layer_name)
    pictures = {
        view: denoiser(samples.picture, samples.albedo, samples.normal).radiance
        for view, samples in noisy.items()
        if samples.picture.any()
    }
    session.write_combined(engine, layer_name, pictures)


def finish_low_samples(
    engine: Any, layer_name: str, request: Request, light: Mapping[str, LowSamples]
) -> None:
    """Denoise low-resolution samples, if requested, and as `finish_beauties`.

    Views without any are left out.
    """
    if not request.finish_stopped:
        return
    denoise = in_process(Denoising.XRDS_FAST, request.machine)
    beauties = {
        view: low.place.beauty(low.samples.picture)
        if denoise is None
        else low.denoised(denoise)
        for view, low in light.items()
        if low.samples.picture.any()
    }
    finish_beauties(engine, layer_name, request, beauties)


def finish_beauties(
    engine: Any, layer_name: str, request: Request, beauties: dict[str, Beauty]
) -> None:
    """Make low-resolution pictures the result, enlarged, if the request asks for it."""
    if request.finish_stopped:
        result = engine.get_result()
        size = result.resolution_y, result.resolution_x
        pictures = enlarged(beauties, request.settings.scale, size)
        session.write_combined(engine, layer_name, pictures)
