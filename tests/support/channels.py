"""Every channel of an EXR file, for tests of what Blender and XRDS wrote."""

from __future__ import annotations

from pathlib import Path

from xrds_core import exr
from xrds_core.arrays import Array


def read_channels(path: str | Path) -> dict[str, Array]:
    """By full name, as `ViewLayer.Depth.Z`: (H, W), of all parts."""
    file = exr.File(path)
    return {name: file.plane(name) for name in file.names.names}
