"""Final frames of path tracers, without Blender.

Samples of a shot's frames are accumulated (`accumulation`) and denoised (`denoising`,
`finish`); or few pixels are enlarged by a network (`superres`).

Importing this package imports neither torch nor Blender: the public names are
loaded on first use.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .errors import (
    GET_NETWORK,
    Cancelled,
    OutOfMemory,
    PictureError,
    SceneError,
    UsageError,
    WeightsError,
    XRDSError,
)

if TYPE_CHECKING:
    from .superres.exr_upscale import upscale_file
    from .superres.network import XRDS, NetworkConfig
    from .superres.upscaler import Upscaled, Upscaler, upscale

_LAZY = {
    "XRDS": ".superres.network",
    "NetworkConfig": ".superres.network",
    "Upscaled": ".superres.upscaler",
    "Upscaler": ".superres.upscaler",
    "upscale": ".superres.upscaler",
    "upscale_file": ".superres.exr_upscale",
}

__all__ = [
    "XRDS",
    "Cancelled",
    "NetworkConfig",
    "OutOfMemory",
    "PictureError",
    "SceneError",
    "Upscaled",
    "Upscaler",
    "UsageError",
    "WeightsError",
    "XRDSError",
    "upscale",
    "upscale_file",
]


def __getattr__(name: str) -> Any:
    """Import a public name that needs torch on first access.

    Raises XRDSError, saying what to install, where torch or safetensors is missing.
    """
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        module = import_module(_LAZY[name], __name__)
    except ModuleNotFoundError as error:
        raise XRDSError(
            f"{name} needs {error.name}, which is not installed: run {GET_NETWORK}"
        ) from error
    value = getattr(module, name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
