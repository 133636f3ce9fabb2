"""Rows of figures as a CSV file."""

from __future__ import annotations

import csv
from typing import TYPE_CHECKING, Any

from xrds_core.files import replacing

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path


def write_table(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows; the columns are all their keys, in the order they are met."""
    columns = list(dict.fromkeys(key for row in rows for key in row))
    with (
        replacing(path) as part,
        part.open("w", newline="", encoding="utf-8") as file,
    ):
        writer = csv.DictWriter(file, columns)
        writer.writeheader()
        writer.writerows(rows)
