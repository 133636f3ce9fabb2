"""Training windows: the files of `xrds dataset`, read as half floats and kept.

A window file (`.npz`) holds one window of a frame: the reference, two guide renders of
different seeds, and two low-resolution renders per scale, denoised and noisy.
"""

from __future__ import annotations

import json
import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from xrds_core.arrays import Array
from xrds_core.errors import PictureError, UsageError
from xrds_core.superres.front_end import auto_exposure, clean_radiance

Box = tuple[slice, slice]

# What numpy and zipfile raise for files that are not whole or claim the impossible.
DAMAGED = (
    OSError,
    ValueError,
    KeyError,
    EOFError,
    MemoryError,
    NotImplementedError,
    RuntimeError,
    zipfile.BadZipFile,
    zlib.error,
)

LOW_RENDERS = 2  # of each scale, with different numbers of samples
WHOLE: Box = (slice(None), slice(None))


@dataclass(frozen=True)
class Window:
    """One window, half float (height, width, channels), scene-linear."""

    path: Path
    arrays: dict[str, NDArray[np.float16]]
    exposures: dict[str, float]
    """The automatic exposure of each low-resolution render."""
    meta: dict[str, Any]

    def array(self, name: str, box: Box = WHOLE) -> Array:
        """One array, or a box of it, as float32."""
        return self.arrays[name][box].astype(np.float32)

    @property
    def size(self) -> int:
        """Bytes in memory."""
        return sum(array.nbytes for array in self.arrays.values())


def low_name(scale: int, index: int, noisy: bool = False) -> str:
    """The array of one low-resolution render."""
    return f"low{scale}_{index}{'_noisy' if noisy else ''}"


def array_names(scale: int) -> tuple[list[str], list[str]]:
    """What training at one scale reads: low-resolution renders, and the rest."""
    kinds = (False, True)
    low = [low_name(scale, i, kind) for i in range(LOW_RENDERS) for kind in kinds]
    return low, ["reference", "guides_a", "guides_b"]


def read_window(path: Path, scale: int) -> Window:
    """Read what training at one scale needs.

    Raises:
        PictureError: the file is damaged or was rendered without that scale.
    """
    low, high = array_names(scale)
    arrays, meta = read_arrays(path, low + high, f"scale {scale}")
    clean = {name: clean_radiance(arrays[name].astype(np.float32))[0] for name in low}
    exposures = {name: auto_exposure(picture) for name, picture in clean.items()}
    return Window(path, arrays, exposures, meta)


def read_arrays(
    path: Path, names: Sequence[str], use: str
) -> tuple[dict[str, NDArray[np.float16]], dict[str, Any]]:
    """Some arrays of a window, and its metadata; `use` is what they are for.

    Raises:
        PictureError: the file is damaged or lacks one of them.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in names}
            return arrays, json.loads(str(file["meta"]))
    except DAMAGED as error:
        raise PictureError(
            f"{path} is no training window for {use}: {str(error)[:200]}"
        ) from error


def holds(path: Path, names: Sequence[str]) -> bool:
    """Whether a window file has these arrays; raises PictureError if it is damaged."""
    try:
        with zipfile.ZipFile(path) as file:
            return {f"{name}.npy" for name in names} <= set(file.namelist())
    except (OSError, zipfile.BadZipFile) as error:
        raise PictureError(f"{path} is no training window: {error}") from error


class WindowSet:
    """The windows of one split of one run, in a fixed order, kept in memory.

    What does not fit into `memory` bytes is read again each time.
    """

    def __init__(self, paths: Sequence[Path], scale: int, memory: float) -> None:
        self.paths = paths
        self._scale = scale
        self._free = memory
        self._kept: dict[int, Window] = {}

    def __len__(self) -> int:
        return len(self.paths)

    def __getitem__(self, index: int) -> Window:
        if index in self._kept:
            return self._kept[index]
        window = read_window(self.paths[index], self._scale)
        if window.size <= self._free:
            self._free -= window.size
            self._kept[index] = window
        return window


def find_windows(folders: Sequence[Path], split: str, names: Sequence[str]) -> Files:
    """Files of a split that hold the arrays `names`, sorted, for each folder.

    Raises:
        UsageError: there are none.
        PictureError: one is damaged.
    """
    listed = [sorted((folder / split).glob("*.npz")) for folder in folders]
    kept = [[path.name for path in paths if holds(path, names)] for paths in listed]
    if not any(kept):
        total = sum(map(len, listed))
        raise UsageError(
            f"{total or 'no'} windows in the {split} folder of "
            f"{', '.join(map(str, folders))}"
            + (f", none with {names[0]}" if total else "")
            + "; run `xrds dataset`"
        )
    return kept


Files = list[list[str]]
"""Names of window files, a list for each data folder."""


def paths_of(folders: Sequence[Path], split: str, files: Files) -> list[Path]:
    """The full paths of `files`, one folder after the other."""
    return [
        folder / split / name
        for folder, names in zip(folders, files, strict=True)
        for name in names
    ]
