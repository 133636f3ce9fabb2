"""The add-on's words in other languages.

Each file of `languages` holds one language: by context, English and its translation.
Labels have a context of their own: Blender's words of the same letters mean other
things (its German has "Hilfslinien", lines on a ruler, for guides). Blender looks
tooltips up in the context `*` and names of operators in `Operator`.
"""

from __future__ import annotations

import json
from pathlib import Path

import bpy

CONTEXT = "XRDS"
LANGUAGES = Path(__file__).with_name("languages")
Words = dict[str, dict[str, str]]


def read() -> dict[str, Words]:
    """By language and context, each English text's translation."""
    paths = sorted(LANGUAGES.glob("*.json"))
    return {path.stem: json.loads(path.read_text("utf-8")) for path in paths}


def register() -> None:
    """Make the words known to Blender."""
    texts = {
        language: {
            (context, english): text
            for context, pairs in words.items()
            for english, text in pairs.items()
        }
        for language, words in read().items()
    }
    bpy.app.translations.register(__name__, texts)


def unregister() -> None:
    """Take them back."""
    bpy.app.translations.unregister(__name__)
