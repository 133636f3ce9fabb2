"""The machine a figure was measured on, and how much memory a task takes at most."""

from __future__ import annotations

import ctypes
import os
import platform
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from xrds_core.native.library import processors

if TYPE_CHECKING:
    from collections.abc import Iterator

_SELF = Path("/proc/self")


def describe(device: str = "cpu") -> dict[str, Any]:
    """Processor, cores, memory and versions, for a report."""
    import bpy

    from xrds_core.version import package_version

    networks: dict[str, Any] = {"torch": None, "torch_threads": None}
    with suppress(ImportError):  # full size and shots need none
        import torch

        networks = {
            "torch": torch.__version__,
            "torch_threads": torch.get_num_threads(),
        }
    return {
        "processor": _processor(),
        "cores": processors(),
        "memory": _memory(),
        "system": f"{platform.system()} {platform.release()}",
        "device": device,
        "python": platform.python_version(),
        "blender": bpy.app.version_string,
        **networks,
        "xrds": package_version(),
    }


@contextmanager
def only_cores(count: int) -> Iterator[None]:
    """Hold every thread of this process to the first `count` of its cores (Linux).

    Threads made meanwhile inherit it. Raises OSError where there are too few.
    """
    allowed = sorted(os.sched_getaffinity(0))
    if count > len(allowed):
        raise OSError(f"this process may use {len(allowed)} cores, not {count}")
    with ExitStack() as held:
        with suppress(ImportError):  # full size and shots need none
            import torch

            held.callback(torch.set_num_threads, torch.get_num_threads())
            torch.set_num_threads(count)
        held.callback(_hold, set(allowed))
        _hold(set(allowed[:count]))
        yield


def _hold(chosen: set[int]) -> None:
    for thread in (_SELF / "task").iterdir():
        with suppress(ProcessLookupError):  # it has ended meanwhile
            os.sched_setaffinity(int(thread.name), chosen)


def forget_peak() -> bool:
    """Start a new peak of resident memory; False where the system cannot (not Linux).

    Memory that the C library keeps is released first.
    """
    try:
        ctypes.CDLL(None).malloc_trim(0)
        (_SELF / "clear_refs").write_text("5")
    except (OSError, AttributeError):
        return False
    return True


def peak() -> int | None:
    """Bytes of resident memory at the peak since `forget_peak`; None if not known."""
    try:
        status = (_SELF / "status").read_text()
    except OSError:
        return None
    lines = [line for line in status.splitlines() if line.startswith("VmHWM:")]
    return int(lines[0].split()[1]) * 1024 if lines else None


def _processor() -> str:
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()


def _memory() -> int | None:
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (ValueError, AttributeError, OSError):
        return None
