"""The folder that a bench writes its report into, or goes on with."""

from __future__ import annotations

from typing import TYPE_CHECKING

from xrds_core.errors import UsageError
from xrds_core.files import read_json
from xrds_core.version import package_version

if TYPE_CHECKING:
    from pathlib import Path


def make_folder(out: Path) -> None:
    """Make the folder of a report, or let an unfinished one go on.

    Raises UsageError where it holds the report of another version, whose figures are
    of other code, XRDSError where it holds a damaged one.
    """
    out.mkdir(parents=True, exist_ok=True)
    results = out / "results.json"
    if not results.is_file():
        return
    try:
        version = read_json(results)["machine"]["xrds"]
    except (KeyError, TypeError):
        return  # something else, which is written over
    if version != package_version():
        raise UsageError(
            f"{out} holds a report of XRDS {version}, this is {package_version()}: "
            "give another folder, or remove it"
        )
