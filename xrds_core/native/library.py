"""Loads the compiled library of this platform, and runs its work on all processors."""

from __future__ import annotations

import os
import platform
import sys
import time
from concurrent.futures import CancelledError, ThreadPoolExecutor
from ctypes import CDLL, POINTER, c_double, c_float, c_int32, c_int64, c_void_p, sizeof
from functools import cache
from pathlib import Path
from struct import unpack_from
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np

from ..errors import XRDSError
from .structures import IN_ORDER, Area, Neighbour, Packing, Pass, Reprojection, Target

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import DTypeLike, NDArray


FOLDER = Path(__file__).parent / "lib"
_SYSTEMS = {
    "linux": ("linux", ".so"),
    "win32": ("windows", ".dll"),
    "darwin": ("macos", ".dylib"),
}
_MACHINES = {"x86_64": "x64", "amd64": "x64", "arm64": "arm64", "aarch64": "arm64"}
_FUNCTIONS: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "level": (c_int32, ()),
    "limit_level": (None, (c_int32,)),
    "struct_size": (c_int64, (c_int32,)),
    "scratch_bytes": (c_int64, (POINTER(Target), Area)),
    "accumulate": (c_double, (POINTER(Target), Area, c_void_p)),
    "find_rims": (None, (c_void_p, c_void_p, *(c_int32,) * 5)),
    "find_ranges": (None, (*(c_void_p,) * 3, *(c_int32,) * 4, c_void_p)),
    "find_moving": (
        None,
        (
            *(c_void_p, c_void_p, POINTER(Reprojection)),
            *(c_int32, c_int32, c_int32, c_int32),
            *(c_float, c_float, c_void_p, c_void_p),
        ),
    ),
    "packing_bytes": (c_int64, (POINTER(Packing), c_int32)),
    "pack": (None, (POINTER(Packing), c_int32, c_int32, c_void_p)),
    "to_halves": (c_int32, (POINTER(Pass), *(c_int32,) * 4, c_void_p)),
    "find_spots": (
        None,
        (POINTER(Target), POINTER(Neighbour), c_int32, *(c_void_p,) * 4),
    ),
    "compare_spots": (
        None,
        (POINTER(Target), POINTER(Neighbour), c_int32, *(c_void_p,) * 5),
    ),
}


class LibraryError(XRDSError):
    """The compiled library is missing, or cannot be loaded here."""


def file_name() -> str:
    """Return the name of this platform's library. Raises LibraryError for others."""
    system, machine = sys.platform, platform.machine().lower()
    if system not in _SYSTEMS or machine not in _MACHINES:
        raise LibraryError(
            f"XRDS has no compiled library for {system} on {machine}: Linux, Windows "
            "and macOS on x86-64, Linux and macOS on ARM are supported"
        )
    name, suffix = _SYSTEMS[system]
    return f"{name}-{_MACHINES[machine]}{suffix}"


@cache
def library() -> CDLL:
    """Return the library of this platform, loaded once in a process.

    Raises LibraryError where it is missing, does not load, or is of another version.
    """
    path = FOLDER / file_name()
    try:
        _check_length(path)
        compiled = CDLL(str(path))
    except OSError as error:
        raise LibraryError(
            f"the compiled library {path} cannot be loaded ({error}): install XRDS "
            "again, or in a checkout run make native"
        ) from error
    for name, (result, arguments) in _FUNCTIONS.items():
        function = getattr(compiled, name, None)
        if function is None:
            raise LibraryError(_other_version_message(path))
        function.restype, function.argtypes = result, arguments
    sizes = [compiled.struct_size(number) for number in range(len(IN_ORDER))]
    if sizes != [sizeof(structure) for structure in IN_ORDER]:
        raise LibraryError(_other_version_message(path))
    return compiled


def _check_length(path: Path) -> None:
    """Raise OSError for a file that is cut off, where Linux would end the process.

    The table of an ELF file's sections is its end.
    """
    with path.open("rb") as file:
        head = file.read(64)
    if len(head) < 64 or not head.startswith(b"\x7fELF"):
        return  # which the system refuses, or which is not Linux's
    (start,) = unpack_from("<Q", head, 40)
    size, count = unpack_from("<2H", head, 58)
    if path.stat().st_size < start + size * count:
        raise OSError("it is cut off")


def _other_version_message(path: Path) -> str:
    return (
        f"the compiled library {path} is of another version of XRDS: install XRDS "
        "again, or in a checkout run make native"
    )


class Arrays:
    """Gives arrays to the library, and keeps them as long as it may use them."""

    def __init__(self) -> None:
        self._kept: list[Any] = []

    def at(
        self, array: NDArray[Any] | None, dtype: DTypeLike, count: int
    ) -> int | None:
        """Return the address of an array for the library, and keep the array.

        Numbers are copied where they do not lie one after the other.

        Parameters
        ----------
        array : array or None
            The array.
        dtype : dtype
            The type that the library reads.
        count : int
            The number of numbers that it reads.

        Returns
        -------
        address : int or None
            None for no array.

        Raises
        ------
        ValueError
            If there are more or fewer numbers, or of another type: the library would
            read what is no number.
        """
        if array is None:
            return None
        if array.dtype != dtype or array.size != count:
            raise ValueError(
                f"{array.size} numbers of {array.dtype} where {count} of "
                f"{np.dtype(dtype)} are needed"
            )
        array = np.ascontiguousarray(array)
        self._kept.append(array)
        return array.ctypes.data

    def strided(self, array: NDArray[Any]) -> tuple[int, tuple[int, ...]]:
        """Return the address of the first float32, and the step along each axis."""
        array = array.astype(np.float32, copy=False)
        if (
            any(step % array.itemsize for step in array.strides)
            or array.ctypes.data % array.itemsize
        ):
            array = np.ascontiguousarray(array)
        self._kept.append(array)
        return array.ctypes.data, tuple(
            step // array.itemsize for step in array.strides
        )

    def addresses(self, addresses: Sequence[int | None]) -> Any:
        """Return a C array of addresses."""
        array = (c_void_p * max(len(addresses), 1))(*addresses)
        self._kept.append(array)
        return array


Item = TypeVar("Item")
Result = TypeVar("Result")

_ROWS = 128  # of a band
_MOMENT = 1e-3  # seconds


def processors() -> int:
    """Return how many this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def in_threads(
    work: Callable[[Item], Result], items: Sequence[Item], threads: int | None = None
) -> list[Result]:
    """Do work in threads.

    No thread works any more when this ends, by an interrupt or several as well: what it
    writes into is freed then.

    Parameters
    ----------
    work : callable
        Takes an item and returns a result.
    items : sequence
        The items.
    threads : int, optional
        Number of threads, one for each processor by default.

    Returns
    -------
    results : list
        In the order of the items.
    """
    count = min(threads or processors(), len(items))
    if count <= 1:
        return [work(item) for item in items]
    tracked = _Tracked(work)
    pool = ThreadPoolExecutor(count)
    try:
        futures = [pool.submit(tracked, item) for item in items]
        return [future.result() for future in futures]
    finally:
        try:
            tracked.end()
        finally:
            pool.shutdown()


class _Tracked(Generic[Item, Result]):
    """Work of which is known what runs, whatever an interrupt has made of its thread.

    A thread whose start or join was interrupted is known to nobody: Python 3.11 neither
    joins it nor tells what it works on. Appending to lists is all that is needed, and
    no interrupt leaves a lock held.
    """

    def __init__(self, work: Callable[[Item], Result]) -> None:
        self._work = work
        self._begun: list[None] = []
        self._done: list[None] = []
        self._is_over = False

    def __call__(self, item: Item) -> Result:
        self._begun.append(None)  # before it is asked whether all is over
        try:
            if self._is_over:
                raise CancelledError
            return self._work(item)
        finally:
            self._done.append(None)

    def end(self) -> None:
        """Let nothing more begin, and wait for the rest however often interrupted."""
        interrupt: KeyboardInterrupt | None = None
        while True:
            try:
                self._is_over = True
                while len(self._done) < len(self._begun):
                    time.sleep(_MOMENT)
                break
            except KeyboardInterrupt as again:
                interrupt = again
        if interrupt is not None:
            raise interrupt


def bands(height: int) -> list[tuple[int, int]]:
    """Return the rows of a picture in bands: first and last (excluded)."""
    return [(top, min(top + _ROWS, height)) for top in range(0, height, _ROWS)]
