"""Choosing where and how precisely a network runs."""

from __future__ import annotations

import torch

from .errors import UsageError

PRECISIONS = {"fp32": torch.float32, "bf16": torch.bfloat16}


def choose_device(name: str = "auto") -> torch.device:
    """Return the named device; for ``auto`` the fastest kind there is.

    Raises UsageError if this machine, or this build of torch, has no such device.
    """
    if name == "auto":
        kinds = (("cuda", torch.cuda), ("mps", torch.backends.mps))
        found = [kind for kind, backend in kinds if backend.is_available()]
        return torch.device(found[0] if found else "cpu")
    try:
        device = torch.device(name)
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError, NotImplementedError) as error:
        # torch's own text runs over many lines
        reason = str(error).partition("\n")[0]
        raise UsageError(f"device {name!r} is not here ({reason}); use auto") from error
    return device


def choose_precision(name: str, device: torch.device) -> torch.dtype:
    """Return the type that layers compute in; for ``auto`` the fast one that holds.

    On processors bf16 is slower than fp32 unless they have special units for it.
    Raises UsageError for other names than auto, fp32, bf16.
    """
    if name == "auto":
        fast = device.type == "cuda" and torch.cuda.is_bf16_supported(False)
        return PRECISIONS["bf16" if fast else "fp32"]
    if name not in PRECISIONS:
        raise UsageError(f"precision {name!r} is not among auto, fp32, bf16")
    return PRECISIONS[name]
