"""Every word that the interface shows, as the source and Blender tell it."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import bpy
import pytest

from xrds_blender import interface
from xrds_blender.interface import registration, translations
from xrds_blender.planning import estimates, offers, plan
from xrds_blender.rendering import advice
from xrds_blender.rendering.pace import obstacles

FOLDER = Path(interface.__file__).parent
# The panel shows what a mode lacks, offers and advice.
SHOWN = (estimates, offers, advice)
SOURCES = [*sorted(FOLDER.rglob("*.py")), *(Path(str(x.__file__)) for x in SHOWN)]
# Other modules have a few such sentences beside what they call things.
SENTENCES = {
    plan.MOTION_BLUR,
    plan.DEPTH_OF_FIELD,
    plan.GLASS,
    plan.VOLUMES,
    plan.HAIR,
    obstacles.FEW_FRAMES,
    obstacles.FEW_SAMPLES,
    obstacles.OLD_BLENDER,
    obstacles.ONE_SUBSET,
    obstacles.OWN_SAMPLES,
    obstacles.OTHER_MODE,
}
WORDS = translations.read()
# Shown as they are in every language.
NAMES = {"XRDS", "Cycles", "CPU", "Metal", "Error: "}
Text = tuple[str | None, str]  # context, None where the source does not tell; English


def own_types() -> Iterator[type]:
    kinds = (
        bpy.types.Operator,
        bpy.types.Panel,
        bpy.types.Menu,
        bpy.types.PropertyGroup,
        bpy.types.AddonPreferences,
    )
    for kind in kinds:
        for item in kind.__subclasses__():
            if item.__module__.startswith("xrds_blender") and item.is_registered:
                yield item


def texts_of(item: type) -> Iterator[Text]:
    """Labels and tooltips of a class and of its own properties."""
    rna = item.bl_rna
    if issubclass(item, bpy.types.Operator):
        module, _, name = item.bl_idname.partition(".")
        rna = getattr(getattr(bpy.ops, module), name).get_rna_type()
        yield "Operator", rna.name
        yield "*", rna.description
    elif issubclass(item, bpy.types.Panel | bpy.types.Menu):
        yield getattr(item, "bl_translation_context", "*"), item.bl_label
    for name in getattr(item, "__annotations__", {}):
        prop = rna.properties.get(name)
        if prop is None or prop.is_hidden:
            continue
        yield prop.translation_context, prop.name
        yield "*", prop.description
        for choice in getattr(prop, "enum_items_static_ui", ()):
            yield prop.translation_context, choice.name
            yield "*", choice.description


def texts_in(path: Path) -> Iterator[Text]:
    """What reads like prose in a module, docstrings and errors aside."""
    tree = ast.parse(path.read_text("utf-8"))
    aside = {id(part) for node in ast.walk(tree) for part in not_shown(node)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            yield from ((None, text) for text in translated(node))
        is_text = isinstance(node, ast.Constant) and isinstance(node.value, str)
        if is_text and id(node) not in aside and is_prose(node.value):
            yield None, node.value


def not_shown(node: ast.AST) -> Iterator[ast.AST]:
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        yield node.value
    elif isinstance(node, ast.Raise | ast.JoinedStr):
        yield from ast.walk(node)


def translated(call: ast.Call) -> Iterator[str]:
    """Short words are told from identifiers by what is done with them."""
    if getattr(call.func, "attr", getattr(call.func, "id", "")) == "translated":
        for node in ast.walk(call.args[0]):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                yield node.value


def is_prose(text: str) -> bool:
    return bool(re.search(r"^[A-Z][a-z]|[a-z] [a-z]", text))


@pytest.fixture(scope="module")
def texts() -> set[Text]:
    registration.ensure_registered()
    told = {text for item in own_types() for text in texts_of(item)}
    told |= {text for path in SOURCES for text in texts_in(path)}
    told |= {(None, sentence) for sentence in SENTENCES}
    return {(context, text) for context, text in told if text and text not in NAMES}


@pytest.mark.parametrize("language", sorted(WORDS))
def test_everything_shown_is_translated(texts: set[Text], language: str) -> None:
    words = WORDS[language]
    anywhere = set().union(*words.values())
    left = {
        (context, text)
        for context, text in texts
        if text not in (anywhere if context is None else words.get(context, {}))
    }
    assert not left


@pytest.mark.parametrize("language", sorted(WORDS))
def test_nothing_is_translated_that_is_not_shown(
    texts: set[Text], language: str
) -> None:
    known = {text for _, text in texts}
    left = {e for pairs in WORDS[language].values() for e in pairs if e not in known}
    assert not left


@pytest.mark.parametrize("language", sorted(WORDS))
def test_translations_are_whole(language: str) -> None:
    for pairs in WORDS[language].values():
        for english, text in pairs.items():
            assert text.strip(), english
            places = re.findall(r"{[^}]*}", english)
            assert sorted(re.findall(r"{[^}]*}", text)) == sorted(places), english


def test_there_are_german_and_japanese() -> None:
    assert sorted(WORDS) == ["de_DE", "ja_JP"]
