"""Guides of earlier renders, in memory and on request in a folder.

Both are bounded: what was not used for the longest time goes first. In the folder only
files that were written here are touched: they lie in a folder of their own and are
known by their names and by what they begin with.
"""

from __future__ import annotations

import struct
import tokenize
import zipfile
import zlib
from collections import OrderedDict
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from xrds_core.arrays import Array
from xrds_core.errors import warn
from xrds_core.files import replacing, sweep

from ..cycles.settings import ALBEDO, NORMAL

MEMORY_LIMIT = 1 << 30  # bytes
FOLDER_LIMIT = 8 << 30
_SAMPLES, _ALPHA, _PROBE = "samples", "alpha", "probe"
_SUBFOLDER, _SUFFIX = "xrds-guides", ".guides.npz"
_MARK = "xrds guides 1"  # the first array of each file, which holds its key
# What two probes of one scene differ by at most: some modifiers round their texture
# coordinates in another order each time.
TOLERANCE = 1e-3


@dataclass(frozen=True, eq=False)
class GuideName:
    """Which scene guides are of: its key, and the probe that proves it."""

    key: str
    probe: Array

    def is_same(self, other: GuideName | None) -> bool:
        """Whether guides of both names are samples of one and the same thing."""
        if other is None or self.key != other.key:
            return False
        return _agree(self.probe, other.probe)


@dataclass(frozen=True)
class CachedGuides:
    """All that a guide render left: passes (H, W, channels) by (view, name).

    `alphas` (H, W) are by view; albedo, normal and alpha are the mean of `samples`
    samples. Other passes are those of the first render. `probe` (values,) proves
    which scene they are of.
    """

    samples: int
    passes: dict[tuple[str, str], Array]
    alphas: dict[str, Array]
    probe: Array

    def copy(self) -> CachedGuides:
        """Arrays that others may change."""
        passes = {key: pixels.copy() for key, pixels in self.passes.items()}
        alphas = {view: pixels.copy() for view, pixels in self.alphas.items()}
        return CachedGuides(self.samples, passes, alphas, self.probe)

    def is_of(self, probe: Array) -> bool:
        """Whether a probe render shows the scene that these guides are of."""
        return _agree(self.probe, probe)

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
        return CachedGuides(total, passes, alphas, self.probe)

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        arrays = [*self.passes.values(), *self.alphas.values(), self.probe]
        return sum(array.nbytes for array in arrays)


class GuideCache:
    """Guides by key; what it takes and gives are copies."""

    def __init__(
        self, memory_limit: int = MEMORY_LIMIT, folder_limit: int = FOLDER_LIMIT
    ) -> None:
        self.memory_limit, self.folder_limit = memory_limit, folder_limit
        self._cached: OrderedDict[str, CachedGuides] = OrderedDict()
        self.hits = self.misses = self.holes = 0

    def get(
        self,
        key: str,
        probe: Array,
        folder: Path | None = None,
        size: tuple[int, int] | None = None,
    ) -> CachedGuides | None:
        """The guides of a key, from memory or from the folder; None if there are none.

        A damaged file, or one of another `size` (height, width), counts as none and is
        reported on stderr. Guides of another probe count as none, too, and as a hole.
        """
        cached = self._cached.get(key)
        if cached is None and folder is not None:
            cached = _find(key, folder, size)
        if cached is None or not cached.is_of(probe):
            self.misses += 1
            self.holes += cached is not None
            return None
        self.hits += 1
        self._store(key, cached)
        return cached.copy()

    def put(self, key: str, guides: CachedGuides, folder: Path | None = None) -> None:
        """Store guides in place of what the key had.

        Guides with bad pixels go into memory alone. Raises OSError where the folder
        does not take them; memory then has them.
        """
        self._store(key, guides.copy())
        if (
            folder is not None
            and guides.nbytes <= self.folder_limit
            and _is_sound(guides)
        ):
            path = _path(key, folder)
            path.parent.mkdir(parents=True, exist_ok=True)
            _make_room(path.parent, self.folder_limit - guides.nbytes)
            _write(path, key, guides)

    def clear(self) -> None:
        """Forget what is in memory."""
        self._cached.clear()
        self.hits = self.misses = self.holes = 0

    def _store(self, key: str, guides: CachedGuides) -> None:
        self._cached.pop(key, None)
        if guides.nbytes > self.memory_limit:
            return
        self._cached[key] = guides
        while (
            sum(guides.nbytes for guides in self._cached.values()) > self.memory_limit
        ):
            self._cached.popitem(last=False)


# One for the process: the next F12 is to find what the last one left.
CACHE = GuideCache()


def _agree(first: Array, second: Array) -> bool:
    return first.shape == second.shape and np.allclose(
        first, second, TOLERANCE, TOLERANCE, equal_nan=True
    )


def _path(key: str, folder: Path) -> Path:
    return folder / _SUBFOLDER / f"{key}{_SUFFIX}"


def _write(path: Path, key: str, guides: CachedGuides) -> None:
    arrays = {_MARK: np.array(key), _SAMPLES: np.array(guides.samples)}
    arrays |= {f"{view}/{name}": array for (view, name), array in guides.passes.items()}
    arrays |= {f"{view}/{_ALPHA}": array for view, array in guides.alphas.items()}
    arrays[_PROBE] = guides.probe
    with replacing(path) as part, part.open("wb") as file:
        np.savez(file, **arrays)


def _find(key: str, folder: Path, size: tuple[int, int] | None) -> CachedGuides | None:
    path = _path(key, folder)
    try:
        guides = _read(path, key, size)
        with suppress(OSError):  # a folder that can only be read
            path.touch()  # it was of use
    except FileNotFoundError:
        return None
    except OSError as error:
        warn(f"cannot read cached guides {path} ({error.strerror})")
        return None
    except _FAULTS as error:
        reason = str(error) or type(error).__name__
        warn(f"cached guides {path} are damaged ({reason}) and are rendered anew")
        return None
    return guides


# What NumPy and zipfile raise on damaged files, beside OSError.
_FAULTS = (
    ValueError,
    KeyError,
    EOFError,
    MemoryError,
    OverflowError,
    TypeError,
    SyntaxError,
    RuntimeError,  # encrypted, as a flipped bit says
    struct.error,
    tokenize.TokenError,
    zipfile.BadZipFile,
    zlib.error,
)


def _read(path: Path, key: str, size: tuple[int, int] | None) -> CachedGuides:
    """The guides that a file holds; raises OSError or one of _FAULTS."""
    with np.load(path, allow_pickle=False) as file:
        arrays = dict(file)
    if str(arrays.pop(_MARK)) != key:
        raise ValueError("of another key")
    samples, probe = int(arrays.pop(_SAMPLES)), arrays.pop(_PROBE)
    named = {tuple(name.split("/", 1)): array for name, array in arrays.items()}
    alphas = {view: array for (view, name), array in named.items() if name == _ALPHA}
    passes = {key: array for key, array in named.items() if key[1] != _ALPHA}
    guides = CachedGuides(samples, passes, alphas, probe)
    _check(guides, size)
    return guides


def _check(guides: CachedGuides, size: tuple[int, int] | None) -> None:
    """Raise ValueError where the arrays are not such as a render leaves."""
    if guides.samples < 1 or not guides.alphas:
        raise ValueError("without samples or views")
    for view, alpha in guides.alphas.items():
        size = size or (alpha.shape[0], alpha.shape[1])
        used = [guides.passes[view, ALBEDO], guides.passes[view, NORMAL], alpha]
        if not all(np.isfinite(array).all() for array in used):
            raise ValueError("it holds NaN or infinity")
    for array in (
        *guides.passes.values(),
        *(a[..., None] for a in guides.alphas.values()),
    ):
        if array.dtype != np.float32 or array.ndim != 3 or array.shape[:2] != size:
            raise ValueError(f"{array.dtype} of the shape {array.shape}")


def _is_sound(guides: CachedGuides) -> bool:
    try:
        _check(guides, None)
    except ValueError:
        return False
    return True


def _make_room(folder: Path, limit: int) -> None:
    """Remove the files that were used longest ago until at most `limit` bytes stay."""
    sweep(folder)
    files = []
    for path in folder.glob(f"*{_SUFFIX}"):
        with suppress(OSError):  # another render has made room too
            if _is_ours(path):
                files.append((path.stat(), path))
    files.sort(key=lambda each: each[0].st_mtime_ns, reverse=True)
    total = 0
    for status, path in files:
        total += status.st_size
        if total > limit:
            path.unlink(missing_ok=True)


def _is_ours(path: Path) -> bool:
    """Whether a file begins as those written here: a zip whose first member is ours."""
    name = f"{_MARK}.npy".encode()
    with path.open("rb") as file:
        head = file.read(30 + len(name))
    return head.startswith(b"PK\x03\x04") and head.endswith(name)
