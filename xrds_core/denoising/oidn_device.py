"""Open Image Denoise (OIDN): loading it, its devices, its errors.

It comes with the package `mitsuba-oidn`. Source: https://www.openimagedenoise.org.
"""

from __future__ import annotations

import sys
from contextlib import contextmanager
from importlib import import_module
from typing import TYPE_CHECKING, Any

from ..errors import OutOfMemory, UsageError, XRDSError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import ModuleType

DEVICES = {"cpu": "CPU", "cuda": "CUDA", "metal": "Metal"}
"""What we call a device, and what OIDN does."""


def load() -> ModuleType:
    """Return the module `mitsuba_oidn`; raises XRDSError if it cannot be loaded."""
    try:
        return import_module("mitsuba_oidn")
    except (ImportError, OSError, RuntimeError) as error:
        raise XRDSError(
            f"cannot load Open Image Denoise ({_first_line(error)}): install it with "
            f"{sys.executable} -m pip install mitsuba-oidn"
        ) from error


def devices() -> list[str]:
    """Return the devices that are here, the fastest first.

    Raises
    ------
    XRDSError
        If the library cannot be loaded.
    """
    names = (device.type.name.lower() for device in load().physical_devices())
    return [name for name in dict.fromkeys(names) if name in DEVICES]


def open_device(name: str, threads: int) -> Any:
    """Open a device of OIDN.

    Parameters
    ----------
    name : {'auto', 'cpu', 'cuda', 'metal'}
        `auto` is the fastest there is.
    threads : int
        Threads of the CPU; 0 for one per core.

    Returns
    -------
    device : mitsuba_oidn.Device

    Raises
    ------
    UsageError
        If the device is not here.
    XRDSError
        If the library cannot be loaded.
    """
    oidn = load()
    if name != "auto" and name not in DEVICES:
        known = ", ".join(("auto", *DEVICES))
        raise UsageError(f"device {name!r} is not among {known}")
    try:
        device = oidn.Device(getattr(oidn.DeviceType, DEVICES.get(name, "Default")))
        if device.type == oidn.DeviceType.CPU:
            device.num_threads = threads
            # bound to cores, its threads fight with the renderer's; so in Blender
            device.set_bool("setAffinity", False)
        device.commit()
    except oidn.Error as error:
        here = ", ".join(devices()) or "none"
        raise UsageError(
            f"device {name!r} is not here ({_first_line(error)}); use auto, or one of: "
            f"{here}"
        ) from error
    return device


@contextmanager
def explained(device: str, shape: tuple[int, ...]) -> Iterator[None]:
    """Turn what OIDN raises over a picture of `shape` into one clear line."""
    oidn = load()
    try:
        yield
    except (oidn.Error, MemoryError) as error:
        code = getattr(error, "code", None)
        if not isinstance(error, MemoryError) and code != oidn.ErrorCode.OutOfMemory:
            raise XRDSError(
                f"Open Image Denoise failed: {_first_line(error)}"
            ) from error
        raise OutOfMemory(
            f"{device} has too little memory to denoise {shape[1]}x{shape[0]} pixels: "
            "set a memory_limit, close other programs, or use another device"
        ) from error


def _first_line(error: BaseException) -> str:
    return str(error).partition("\n")[0]
