"""Memory that the process has taken."""

from __future__ import annotations


def peak_memory() -> int:
    """The largest memory in bytes that this process has taken; 0 where not known."""
    try:
        import resource
    except ImportError:  # Windows
        return 0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
