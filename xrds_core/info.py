"""What `xrds info` prints: versions, devices, weights and the cost of the networks."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from .denoising import oidn_device
from .errors import GET_NETWORK, WeightsError, XRDSError
from .superres.weights_header import DIRECTORY, available
from .version import package_version

COSTS = DIRECTORY / "costs.json"
"""Parameters and operations of the networks, counted before: counting takes seconds."""


def network_devices() -> list[str]:
    """The names that `--device` accepts for a network here, the processor first.

    Raises whatever a missing or broken torch raises.
    """
    import torch

    from .superres.devices import device_name

    devices = [torch.device("cuda", i) for i in range(torch.cuda.device_count())]
    if torch.backends.mps.is_available():
        devices.append(torch.device("mps"))
    return ["cpu", *map(device_name, devices)]


def denoiser_devices() -> list[str]:
    """The names that `xrds denoise --device` accepts here, the fastest first."""
    try:
        return oidn_device.devices()
    except XRDSError:
        return []


def _network() -> dict[str, Any]:
    """What there is of the network: version of torch, devices, or what is wrong."""
    try:
        devices = network_devices()
        import safetensors  # noqa: F401  # only asked whether it is there
        import torch
    except Exception as error:  # OSError, AttributeError: a broken one raises all
        reason = " ".join(str(error).split()) or type(error).__name__
        return {"torch": None, "torch_error": reason, "devices": []}
    return {"torch": torch.__version__, "torch_error": None, "devices": devices}


def shipped_costs() -> dict[str, Any]:
    """{paper_table, presets} of the networks."""
    return dict(json.loads(COSTS.read_text("utf-8")))


def info(
    blender: str | None = None, weights: str | Path | None = None
) -> dict[str, Any]:
    """Collect what `xrds info --json` prints.

    Parameters
    ----------
    blender : str, optional
        Blender's version, which this package cannot find out.
    weights : str or Path, optional
        Folder of weights files; the shipped ones by default.

    Returns
    -------
    info : dict

    Raises
    ------
    WeightsError
        If there is no such folder, or a weights file is damaged.
    """
    if weights is not None and not Path(weights).is_dir():
        raise WeightsError(f"{weights} is no folder of weights files")
    return {
        "version": package_version(),
        "blender": blender,
        **_network(),
        "denoiser": denoiser_devices(),
        **shipped_costs(),
        "weights": available(weights),
    }


def lines(result: dict[str, Any]) -> Iterator[str]:
    """The result of `info` for people to read."""
    yield f"XRDS {result['version']}, Blender {result['blender'] or 'not found'}"
    yield f"denoiser: {', '.join(result['denoiser']) or 'not found'}"
    if result["torch"] is None:
        yield f"network: none ({result['torch_error']}); {GET_NETWORK} brings it"
    else:
        yield f"network: torch {result['torch']} on {', '.join(result['devices'])}"
    yield "the paper's network, x4, 1024 x 1024 output:"
    yield "  RDST  XDG  parameters    MACs  with attention   FLOPs"
    for row in result["paper_table"]:
        yield (
            f"  {row['rdst']:4}  {row['xdg']:3}  {row['parameters'] / 1e6:8.2f} M"
            f"  {row['macs'] / 1e9:6.2f} G  {row['macs_with_attention'] / 1e9:10.2f} G"
            f"  {row['flops'] / 1e12:4.2f} T"
        )
    yield "presets: parameters, MACs per output pixel"
    for preset, scales in result["presets"].items():
        for scale, cost in scales.items():
            yield (
                f"  {preset:9} x{scale}  {cost['parameters'] / 1e6:7.3f} M"
                f"  {cost['macs_per_output_pixel']:8}"
            )
    yield "weights:" if result["weights"] else "weights: none"
    for record in result["weights"]:
        yield (
            f"  {record['file']}  Blender {record['blender_series']}"
            f"  sha256 {record['sha256'][:16]}"
        )
