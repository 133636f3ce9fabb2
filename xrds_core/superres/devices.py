"""Choosing where and how precisely a network runs."""

from __future__ import annotations

from pathlib import Path

import torch

from ..errors import UsageError

_TORCH_NAMES = {"metal": "mps"}
"""Where torch's name of a device is not ours, which the denoiser has as well."""
PRECISIONS = {"fp32": torch.float32, "bf16": torch.bfloat16}


def choose_device(name: str = "auto") -> torch.device:
    """Return a device of torch.

    Parameters
    ----------
    name : str
        `auto` for the fastest kind there is, `cpu`, `metal`, or what torch knows.

    Returns
    -------
    device : torch.device

    Raises
    ------
    UsageError
        If this machine, or this build of torch, has no such device.
    """
    if name == "auto":
        kinds = (("cuda", torch.cuda), ("mps", torch.backends.mps))
        present = [kind for kind, backend in kinds if backend.is_available()]
        return torch.device(present[0] if present else "cpu")
    if name in _TORCH_NAMES.values():
        raise UsageError(f"device {name!r} is unknown; use {', '.join(_TORCH_NAMES)}")
    try:
        device = torch.device(_TORCH_NAMES.get(name, name))
        torch.zeros(1, device=device).cpu()  # "meta" holds no numbers
    except (RuntimeError, AssertionError, NotImplementedError) as error:
        # torch's own text runs over many lines
        reason = str(error).partition("\n")[0]
        raise UsageError(
            f"device {name!r} is not available ({reason}); use auto"
        ) from error
    return device


def device_name(device: torch.device) -> str:
    """What commands call a device: `cpu`, `cuda:1`, `metal`."""
    ours = {torchs: name for name, torchs in _TORCH_NAMES.items()}
    return ours.get(device.type, str(device))


def choose_precision(name: str, device: torch.device) -> torch.dtype:
    """Return the type that layers compute in.

    On processors bf16 is slower than fp32 unless they have special units for it.

    Parameters
    ----------
    name : {'auto', 'fp32', 'bf16'}
        `auto` is the fast one of those that the device has.
    device : torch.device
        Where the network runs.

    Returns
    -------
    precision : torch.dtype

    Raises
    ------
    UsageError
        If the name is another one.
    """
    if name == "auto":
        fast = device.type == "cuda" and torch.cuda.is_bf16_supported(False)
        return PRECISIONS["bf16" if fast else "fp32"]
    if name not in PRECISIONS:
        raise UsageError(f"precision {name!r} is unknown; use auto, fp32 or bf16")
    return PRECISIONS[name]


# Texts of torch's plain RuntimeError where an allocation fails on a processor (Linux,
# Windows, oneDNN twice, which gives no reason, C++) or under MPS.
_OUT_OF_MEMORY = (
    "can't allocate memory",
    "not enough memory",
    "could not create a ",
    "could not execute a primitive",
    "bad_alloc",
    "out of memory",
)


def is_out_of_memory(error: BaseException) -> bool:
    """Whether smaller tiles may help."""
    if isinstance(error, (MemoryError, torch.OutOfMemoryError)):
        return True
    message = str(error).lower()
    return isinstance(error, RuntimeError) and any(x in message for x in _OUT_OF_MEMORY)


def free_memory(device: torch.device) -> float:
    """Return the bytes that can be taken on `device`, infinity where not known.

    Linux lets a process take more than there is and then kills it, so this is checked.
    """
    if device.type == "cuda":
        return torch.cuda.mem_get_info(device)[0]
    limits = [float("inf")]
    try:
        lines = [x.split() for x in Path("/proc/meminfo").read_text().splitlines()]
        limits += [1024.0 * int(x[1]) for x in lines if x[0] == "MemAvailable:"]
        group = Path("/sys/fs/cgroup")  # of a container
        most = float((group / "memory.max").read_text())  # ValueError for "max"
        limits.append(most - float((group / "memory.current").read_text()))
    except (OSError, ValueError):
        pass
    return max(0.0, min(limits))
