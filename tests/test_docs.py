"""What the docs say of the source, and where their links lead."""

from __future__ import annotations

import argparse
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from xrds_blender.command import main

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.glob("*.md")), *sorted(DOCS.glob("lab/*.md"))]
LINES = {"README.md": 120, "docs/guide.md": 250, "docs/performance.md": 200}
RELEASES = ("../../releases", "../../../releases")  # beside the code on its server
SOURCE = ("xrds_core", "xrds_blender", "xrds_lab", "extension", "tests")


def named(page: Path) -> str:
    """A page's path from the root."""
    return str(page.relative_to(ROOT))


every_page = pytest.mark.parametrize("page", PAGES, ids=named)


@every_page
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


@every_page
def test_links_lead_somewhere(page: Path) -> None:
    lost = []
    for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text("utf-8")):
        if link.startswith("http") or link in RELEASES:
            continue
        name, _, heading = link.partition("#")
        file = (page.parent / name).resolve() if name else page
        if not file.exists() or (heading and heading not in headings(file)):
            lost.append(link)
    assert not lost


def headings(page: Path) -> set[str]:
    """The anchors that GitHub makes of a page's headings."""
    text = re.sub(r"```.*?```", "", page.read_text("utf-8"), flags=re.DOTALL)
    found = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", x.lower()).strip().replace(" ", "-") for x in found}


def test_pages_that_the_source_names_are_there() -> None:
    files = [x for folder in SOURCE for x in (ROOT / folder).rglob("*.py")]
    names = {
        name
        for file in [*files, ROOT / "Makefile", ROOT / "blender_manifest.toml"]
        for name in re.findall(r"docs/[\w/.-]+\.md", file.read_text("utf-8"))
    }
    assert names
    assert not [name for name in sorted(names) if not (ROOT / name).is_file()]


@pytest.mark.parametrize("page", LINES)
def test_pages_stay_short(page: str) -> None:
    assert len((ROOT / page).read_text("utf-8").splitlines()) <= LINES[page]


@every_page
def test_commands_are_understood(page: Path) -> None:
    for line in commands(page.read_text("utf-8")):
        words = shlex.split(line)
        main._parser(words).parse_args(words)


# Of Blender, pip and other programs that the project speaks of.
OTHERS = """
--any-blender --command --crossframe
--albedo --alpha --diffuse --specular --tiles --enable
--extra-index-url --factory-startup --index-url --kind --online-mode
--only-binary --platform --python --python-exit-code --python-expr --python-version
--render-anim --render-frame --run-dependencies --step --sync --target --url --check
--draw --help --version --compiler --flags --no-deps
"""


def options_of_all_commands() -> set[str]:
    return {
        name
        for command in commands_below(main._parser([]))
        for action in command._actions
        for name in action.option_strings
    }


def commands_below(
    parser: argparse.ArgumentParser,
) -> Iterator[argparse.ArgumentParser]:
    """The commands of a parser, and theirs."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield command
                yield from commands_below(command)


@pytest.mark.parametrize("folder", ["xrds_core", "xrds_blender", "docs"])
def test_options_that_are_named_are_there(folder: str) -> None:
    known = {*options_of_all_commands(), *OTHERS.split()}
    files = [x for x in (ROOT / folder).rglob("*") if x.suffix in {".py", ".md"}]
    lost = {
        (named(file), option)
        for file in files
        if not {"lab", "results", "pipeline"} & {*file.parts}
        for option in re.findall(r"(?<![\w-])--[a-z][a-z-]+", file.read_text("utf-8"))
        if option not in known
    }
    assert not lost


def commands(text: str) -> list[str]:
    """What follows `xrds` in the lines of code blocks."""
    blocks = re.findall(r"^\s*```\n(.*?)```", text, re.DOTALL | re.MULTILINE)
    lines = "\n".join(blocks).replace("\\\n", " ").splitlines()
    found = [re.match(r"\s*(?:blender --command )?xrds (.*)", x) for x in lines]
    return [x[1].partition("#")[0] if " # " in x[1] else x[1] for x in found if x]
