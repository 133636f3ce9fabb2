"""Weights files: safetensors, so that reading one never runs code.

A file holds the tensors of one `XRDS` and, in its metadata, the network's configuration
as JSON under `config` beside whatever else was recorded (preset, blender_series,
training set, licence), all strings. What has several axes is in whole numbers of 8 bits
with one factor per output channel, float32, under NAME.factors; all else is in half
precision.
"""

from __future__ import annotations

import json
import math
from pathlib import Path

import torch
from safetensors import SafetensorError, safe_open
from torch import Tensor

from ..errors import WeightsError
from .network import XRDS, NetworkConfig
from .weights_header import DIRECTORY, GUIDES, network_files

FACTORS = ".factors"
_LARGEST_SETTING = 4096  # far above any real width or count; bounds hostile files


def file_name(preset: str, scale: int) -> str:
    """Return the name of a preset's file: fast_x2.safetensors."""
    return f"{preset}_x{scale}.safetensors"


def unpack(tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    """Multiply whole numbers by their factors; what is a float already stays.

    Parameters
    ----------
    tensors : dict of str to Tensor
        Tensors of a file, by name.

    Returns
    -------
    unpacked : dict of str to Tensor
        Floats.

    Raises
    ------
    ValueError
        If factors are missing or not one per output channel.
    """
    unpacked = {k: v for k, v in tensors.items() if not k.endswith(FACTORS)}
    for name, tensor in unpacked.items():
        if tensor.dtype == torch.int8:
            factors = tensors.get(name + FACTORS)
            if factors is None or factors.shape != tensor.shape[:1]:
                raise ValueError(f"{name} lacks its factors")
            ones = (1,) * (tensor.dim() - 1)
            unpacked[name] = tensor.float() * factors.float().view(-1, *ones)
    return unpacked


def load(path: str | Path) -> tuple[XRDS, dict[str, str]]:
    """Load a weights file.

    Parameters
    ----------
    path : str or Path
        The file.

    Returns
    -------
    network : XRDS
        In float32 on the CPU.
    metadata : dict of str to str
        What the file says of it.

    Raises
    ------
    WeightsError
        If the file is missing, damaged, or does not hold exactly the tensors of the
        network that its configuration describes.
    """
    path = Path(path)
    tensors, metadata = _read(path)
    config, expected = _read_description(path, metadata, len(tensors))
    _compare(path, expected, tensors)
    network = XRDS(config)
    network.load_state_dict({name: x.float() for name, x in tensors.items()})
    return network.eval().requires_grad_(False), metadata


def _read(path: Path) -> tuple[dict[str, Tensor], dict[str, str]]:
    if not path.is_file():
        raise WeightsError(f"no weights file at {path}")
    try:
        with safe_open(path, framework="pt") as file:
            metadata = dict(file.metadata() or {})
            packed = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118  # no mapping
        tensors = unpack(packed)
    except (SafetensorError, OSError, ValueError) as error:
        raise WeightsError(
            f"{path} is not a complete safetensors file ({error}); download it again"
        ) from error
    return tensors, metadata


def _read_description(
    path: Path, metadata: dict[str, str], tensors: int
) -> tuple[NetworkConfig, dict[str, torch.Size]]:
    """Return the configuration in `metadata` and the shapes that follow from it."""
    if "config" not in metadata:
        raise WeightsError(f"{path} holds no XRDS network: its metadata has no config")
    try:
        values = json.loads(metadata["config"])
        numbers = [v for v in values.values() if not isinstance(v, (str, bool))]
        if not all(isinstance(v, int) and 0 <= v <= _LARGEST_SETTING for v in numbers):
            raise ValueError(f"a setting is outside 0 to {_LARGEST_SETTING}")
        guides = values.pop("guides", GUIDES)
        if guides != GUIDES:
            raise WeightsError(
                f"{path} was trained for guides that this version does not render "
                f"({guides!r}); choose other weights"
            )
        config = NetworkConfig.from_dict(values)
        layers = (config.groups, config.blocks, config.dense_layers)
        if math.prod(max(n, 1) for n in layers) > tensors:
            raise ValueError(f"{tensors} tensors are too few for it")
        with torch.device("meta"):  # sizes cost nothing here, whatever is claimed
            shapes = {k: v.shape for k, v in XRDS(config).state_dict().items()}
    except (ValueError, TypeError, AttributeError, ArithmeticError, RuntimeError) as e:
        raise WeightsError(
            f"{path} describes a network that this version does not know ({e})"
        ) from e
    return config, shapes


def _compare(
    path: Path, expected: dict[str, torch.Size], tensors: dict[str, Tensor]
) -> None:
    """Raise WeightsError on the first tensor that is missing, foreign or damaged."""
    for name in sorted(expected.keys() | tensors.keys()):
        if name not in tensors:
            raise WeightsError(f"{path} lacks the tensor {name} of its network")
        if name not in expected:
            raise WeightsError(f"{path} holds an unexpected tensor {name}")
        if tensors[name].shape != expected[name]:
            raise WeightsError(
                f"{name} in {path} has shape {tuple(tensors[name].shape)}, "
                f"but its network has {tuple(expected[name])}"
            )
        if not tensors[name].is_floating_point() or not tensors[name].isfinite().all():
            raise WeightsError(
                f"{name} in {path} holds values that are not finite floats"
            )


def load_preset(
    preset: str, scale: int, directory: str | Path | None = None
) -> tuple[XRDS, dict[str, str]]:
    """Load a shipped preset, or one of a folder.

    Parameters
    ----------
    preset : str
        Its name.
    scale : int
        Output pixels per low-resolution pixel along one axis.
    directory : str or Path, optional
        The folder.

    Returns
    -------
    network : XRDS
        In float32 on the CPU.
    metadata : dict of str to str
        What the file says of it.

    Raises
    ------
    WeightsError
        If there is no such file, naming what there is; or if it cannot be used.
    """
    folder = Path(directory or DIRECTORY)
    path = folder / file_name(preset, scale)
    if not path.is_file():
        known = ", ".join(sorted(p.stem for p in network_files(folder))) or "none"
        raise WeightsError(
            f"no weights for preset {preset!r} at scale {scale} in {folder}; "
            f"it holds: {known}"
        )
    network, metadata = load(path)
    if network.config.scale != scale:
        raise WeightsError(
            f"{path} is for scale {network.config.scale}, unlike its name; "
            "download it again"
        )
    return network, metadata


def choose_network(preset: str, scale: int, weights: str | Path | XRDS | None) -> XRDS:
    """Return a network for a scale.

    Parameters
    ----------
    preset : str
        Name of the preset, in a folder.
    scale : int
        Output pixels per low-resolution pixel along one axis.
    weights : str, Path, XRDS or None
        A folder, a file, or the network itself; None for the shipped ones.

    Returns
    -------
    network : XRDS

    Raises
    ------
    WeightsError
        If there is none such, or if it is for another scale.
    """
    if isinstance(weights, XRDS):
        network = weights.eval()
    elif weights is None or Path(weights).is_dir():
        network, _ = load_preset(preset, scale, weights)
    else:
        network, _ = load(weights)
    if network.config.scale != scale:
        raise WeightsError(
            f"these weights are for scale {network.config.scale}, "
            f"not for scale {scale}; choose others"
        )
    return network
