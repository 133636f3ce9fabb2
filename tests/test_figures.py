"""The figures of the pages are those of docs/results, and of nothing else."""

from __future__ import annotations

import re
import shutil
import tomllib
from pathlib import Path

import pytest

from xrds_lab.pages.writing import PageError, Pages

ROOT = Path(__file__).resolve().parent.parent
LISTED = tuple(tomllib.loads((ROOT / "docs/figures.toml").read_text("utf-8")))


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """The pages by themselves, with the results of this checkout."""
    (tmp_path / "docs").mkdir()
    for name in (*LISTED, "docs/figures.toml"):
        shutil.copy(ROOT / name, tmp_path / name)
    (tmp_path / "docs/results").symlink_to(ROOT / "docs/results")
    return tmp_path


def change(page: Path, pattern: str, into: str) -> None:
    """Change a page by hand, at one place."""
    text, count = re.subn(pattern, into, page.read_text("utf-8"), count=1)
    assert count == 1
    page.write_text(text, "utf-8")


def test_every_figure_is_that_of_the_results() -> None:
    assert list(Pages(ROOT).faults()) == []


@pytest.mark.parametrize(
    ("page", "pattern", "into"),
    [
        pytest.param("README.md", r"shot is \d\.\d", "shot is 9.9", id="sentence"),
        pytest.param("README.md", r"\*\*\+\d\.\d\*\*", "**+9.9**", id="table"),
        pytest.param("docs/performance.md", r"\| 34\.49 \|", "| 35.49 |", id="cell"),
        pytest.param("docs/performance.md", r"\| `fast` .*\n", "", id="row"),
        pytest.param("README.md", "## Limits", "It is 3.7 dB better.", id="new"),
        pytest.param("README.md", "## Limits", "It takes 9 s.", id="unit"),
    ],
)
def test_a_figure_that_is_typed_is_found(
    copy: Path, page: str, pattern: str, into: str
) -> None:
    change(copy / page, pattern, into)
    faults = list(Pages(copy).faults())
    assert faults
    assert all(fault.startswith(page) for fault in faults)


def test_writing_puts_figures_right(copy: Path) -> None:
    page = copy / "README.md"
    right = page.read_text("utf-8")
    change(page, r"shot is \d\.\d", "shot is 9.9")
    change(page, r"\| \+\d\.\d \|", "| +9.9 |")
    Pages(copy).write()
    assert page.read_text("utf-8") == right


def test_sentences_break_where_they_like(copy: Path) -> None:
    change(copy / "README.md", "others, held out", "others,\nheld out")
    assert list(Pages(copy).faults()) == []


@pytest.mark.parametrize("words", ["dB better", "Python 3.11"])
def test_a_list_that_the_page_has_outgrown_is_found(copy: Path, words: str) -> None:
    change(copy / "README.md", words.replace(" ", r"\s+"), "otherwise")
    with pytest.raises(PageError, match=r"README\.md"):
        list(Pages(copy).faults())
