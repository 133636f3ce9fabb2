"""What the docs say of the source."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_that_are_named_are_there(page: Path) -> None:
    """`a.py` after a path lies beside it."""
    folder, missing = ROOT, []
    for line in page.read_text("utf-8").splitlines():
        for name in re.findall(r"`([\w/]+\.py)`", line):
            path = ROOT / name
            if "/" in name:
                folder = path.parent
            beside = folder / name
            if not (path.is_file() or beside.is_file() or _is_test(name)):
                missing.append(name)
    assert not missing


def _is_test(name: str) -> bool:
    return any((ROOT / "tests").rglob(name))
