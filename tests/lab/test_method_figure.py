"""The figure of docs/method.md."""

from __future__ import annotations

from typing import TYPE_CHECKING

from xrds_lab.pages.method import draw

if TYPE_CHECKING:
    from pathlib import Path


def test_it_is_the_same_each_time(tmp_path: Path) -> None:
    files = [tmp_path / name for name in ("one.svg", "two.svg")]
    for file in files:
        draw(file)
    one, two = (file.read_text("utf-8") for file in files)
    assert one == two
    assert "What judges it" in one
