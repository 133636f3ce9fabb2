"""The version of XRDS that is installed."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version


def package_version() -> str:
    """The installed version, or "unknown" when run from bare source."""
    try:
        return version("xrds")
    except PackageNotFoundError:
        return "unknown"
