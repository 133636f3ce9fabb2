"""The panels' words in other languages.

They have a context of their own: Blender's words of the same letters mean other things
(its German has "Hilfslinien", lines on a ruler, for guides).
"""

from __future__ import annotations

import bpy

CONTEXT = "XRDS"
_LANGUAGES = ("de_DE", "ja_JP")
_WORDS = {
    "Scale": ("Vergrößerung", "拡大率"),
    "Full Size": ("Volle Größe", "フルサイズ"),
    "Denoising": ("Entrauschen", "デノイズ"),
    "High": ("Hoch", "高"),
    "Best": ("Beste", "最高"),
    "Temporal Radius": ("Zeitlicher Radius", "時間半径"),
    "Accumulation": ("Akkumulation", "蓄積"),
    "Samples": ("Samples", "サンプル"),
    "Quality": ("Qualität", "品質"),
    "Fast": ("Schnell", "高速"),
    "Balanced": ("Ausgewogen", "バランス"),
    "Paper": ("Aufsatz", "論文"),
    "Time Budget": ("Zeitvorgabe", "時間予算"),
    "Plain Cycles": ("Nur Cycles", "Cyclesのみ"),
    "What Will Be Rendered": ("Was gerendert wird", "レンダリング内容"),
    "Small Render": ("Kleines Bild", "低解像度"),
    "Rays per Pixel": ("Strahlen je Pixel", "レイ/ピクセル"),
    "Memory": ("Speicher", "メモリ"),
    "Denoise": ("Entrauschen", "デノイズ"),
    "Network": ("Netz", "ネットワーク"),
    "Guides": ("Hilfsbilder", "ガイド"),
    "Guide Samples": ("Samples darin", "ガイドサンプル数"),
    "Full": ("Voll", "フル"),
    "Advanced": ("Erweitert", "詳細設定"),
    "Fixed Exposure": ("Feste Belichtung", "露出を固定"),
    "Last Render": ("Letztes Bild", "前回のレンダー"),
    "Scene": ("Szene", "シーン"),
    "Low Resolution": ("Kleines Bild", "低解像度"),
    "Writing": ("Schreiben", "書き込み"),
    "Total": ("Gesamt", "合計"),
}


def register() -> None:
    """Make the words known to Blender."""
    texts = {
        language: {(CONTEXT, word): words[index] for word, words in _WORDS.items()}
        for index, language in enumerate(_LANGUAGES)
    }
    bpy.app.translations.register(__name__, texts)


def unregister() -> None:
    """Take them back."""
    bpy.app.translations.unregister(__name__)
