"""Guides kept from earlier renders, in memory and on request in a folder.

Both are bounded: what was not used for the longest time goes first.
"""

from __future__ import annotations

import zipfile
from collections import OrderedDict
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from xrds_core.arrays import Array
from xrds_core.atomic import replacing, sweep

from ..cycles.pass_names import ALBEDO, NORMAL

MEMORY_LIMIT = 1 << 30  # bytes
FOLDER_LIMIT = 8 << 30
_SAMPLES, _ALPHA = "samples", "alpha"


@dataclass(frozen=True)
class CachedGuides:
    """All that a guide render left: passes (H, W, channels) by (view, name).

    `alphas` (H, W) are by view; albedo, normal and alpha are the mean of `samples`
    samples. Other passes are those of the first render.
    """

    samples: int
    passes: dict[tuple[str, str], Array]
    alphas: dict[str, Array]

    def copy(self) -> CachedGuides:
        """Arrays that others may change."""
        passes = {key: pixels.copy() for key, pixels in self.passes.items()}
        alphas = {view: pixels.copy() for view, pixels in self.alphas.items()}
        return CachedGuides(self.samples, passes, alphas)

    def merged(self, other: CachedGuides) -> CachedGuides:
        """The mean of both, each with the weight of its samples."""
        total = self.samples + other.samples
        share = np.float32(other.samples / total)

        def mean(mine: Array, theirs: Array) -> Array:
            return mine + share * (theirs - mine)

        passes = {
            key: mean(mine, other.passes[key]) if key[1] in (ALBEDO, NORMAL) else mine
            for key, mine in self.passes.items()
        }
        alphas = {v: mean(mine, other.alphas[v]) for v, mine in self.alphas.items()}
        return CachedGuides(total, passes, alphas)

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        arrays = [*self.passes.values(), *self.alphas.values()]
        return sum(array.nbytes for array in arrays)


class GuideCache:
    """Guides by key; what it takes and gives are copies."""

    def __init__(
        self, memory_limit: int = MEMORY_LIMIT, folder_limit: int = FOLDER_LIMIT
    ) -> None:
        self.memory_limit, self.folder_limit = memory_limit, folder_limit
        self._kept: OrderedDict[str, CachedGuides] = OrderedDict()

    def get(self, key: str, folder: Path | None = None) -> CachedGuides | None:
        """The guides of a key, from memory or from the folder; None if there are none.

        A file that cannot be read counts as none.
        """
        if key in self._kept:
            self._kept.move_to_end(key)
            return self._kept[key].copy()
        stored = None if folder is None else _read(folder / f"{key}.npz")
        if stored is not None:
            self._keep(key, stored)
            return stored.copy()
        return None

    def put(self, key: str, guides: CachedGuides, folder: Path | None = None) -> None:
        """Keep guides in place of what the key had.

        Raises OSError where the folder does not take them; memory then has them.
        """
        self._keep(key, guides.copy())
        if folder is not None and guides.nbytes <= self.folder_limit:
            folder.mkdir(parents=True, exist_ok=True)
            _make_room(folder, self.folder_limit - guides.nbytes)
            _write(folder / f"{key}.npz", guides)

    def clear(self) -> None:
        """Forget what is in memory."""
        self._kept.clear()

    def _keep(self, key: str, guides: CachedGuides) -> None:
        self._kept.pop(key, None)
        if guides.nbytes > self.memory_limit:
            return
        self._kept[key] = guides
        while sum(each.nbytes for each in self._kept.values()) > self.memory_limit:
            self._kept.popitem(last=False)


# One for the process: the next F12 is to find what the last one left.
CACHE = GuideCache()


def _write(path: Path, guides: CachedGuides) -> None:
    arrays = {f"{view}/{name}": array for (view, name), array in guides.passes.items()}
    arrays |= {f"{view}/{_ALPHA}": array for view, array in guides.alphas.items()}
    arrays[_SAMPLES] = np.array(guides.samples)
    with replacing(path) as part, part.open("wb") as file:
        np.savez(file, **arrays)


def _read(path: Path) -> CachedGuides | None:
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = dict(file)
        path.touch()  # it was of use
        samples = int(arrays.pop(_SAMPLES))
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile):
        return None
    named = {tuple(name.split("/", 1)): array for name, array in arrays.items()}
    alphas = {view: array for (view, name), array in named.items() if name == _ALPHA}
    passes = {key: array for key, array in named.items() if key[1] != _ALPHA}
    return CachedGuides(samples, passes, alphas)


def _make_room(folder: Path, limit: int) -> None:
    """Remove the files that were used longest ago until at most `limit` bytes stay."""
    sweep(folder)
    files = []
    for path in folder.glob("*.npz"):
        with suppress(FileNotFoundError):  # another render has made room too
            files.append((path.stat(), path))
    files.sort(key=lambda each: each[0].st_mtime_ns, reverse=True)
    total = 0
    for status, path in files:
        total += status.st_size
        if total > limit:
            path.unlink(missing_ok=True)
