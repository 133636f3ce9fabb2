"""Checkpoints: written whole or not at all, and never trusted when read."""

from __future__ import annotations

import pickle
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch

from xrds_core.errors import WeightsError
from xrds_core.files import replacing

# What torch raises on files that are no whole checkpoint, or one of another network.
_DAMAGED = (
    RuntimeError,
    EOFError,
    ValueError,
    LookupError,
    TypeError,
    AttributeError,
    pickle.UnpicklingError,
    zipfile.BadZipFile,
)


def write_checkpoint(path: Path, state: dict[str, Any]) -> None:
    """Write the state of a run."""
    with replacing(path) as part:
        torch.save(state, part)


def read_checkpoint(path: Path, device: torch.device) -> dict[str, Any]:
    """Read the state of a run: tensors alone, never code that the file may hold.

    Raises WeightsError where it is damaged.
    """
    with taking_over(path):
        return torch.load(path, map_location=device, weights_only=True)


@contextmanager
def taking_over(path: Path) -> Iterator[None]:
    """Raise WeightsError where the state of `path` does not fit what takes it over."""
    try:
        yield
    except _DAMAGED as error:
        reason = (str(error) or type(error).__name__).splitlines()[0][:200]
        raise WeightsError(
            f"{path} is damaged or of another run ({reason}); remove it to begin anew"
        ) from error
