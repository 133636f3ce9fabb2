"""Whether a scene is to be rendered as a shot, and how long finding out takes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from xrds_lab.bench.windows import Shot, Window
from xrds_lab.shots import answer, estimate
from xrds_lab.shots.crops import REFERENCE, SIZE, crop_key
from xrds_lab.shots.methods import DEFAULT, XRDS


def pair(gain: float, samples: int = 2) -> list[dict[str, Any]]:
    """Cycles + OIDN at 30 dB, and XRDS."""
    both = ((DEFAULT, 0, 30.0, 9.0), (XRDS, 4, 30.0 + gain, 10.0))
    return [
        {
            "scene": "room",
            "motion": "pan",
            "method": method,
            "radius": radius,
            "samples": samples,
            "psnr": psnr,
            "seconds_per_frame": seconds,
        }
        for method, radius, psnr, seconds in both
    ]


@pytest.mark.parametrize(
    ("gain", "begins"),
    [
        (4.4, "2 samples a frame: Render it as a shot. +4.4 dB with"),
        (-0.3, "2 samples a frame: A shot changes little. -0.3 dB with"),
        (-0.9, "2 samples a frame: Render frames alone. -0.9 dB with"),
    ],
)
def test_the_sentence_follows_the_gain(gain: float, begins: str) -> None:
    assert answer.sentence(*pair(gain)).startswith(begins)


def test_equal_seconds_decide_where_they_are_known() -> None:
    known = {"at": XRDS, "samples": 2, "gain": -1.0}
    said = answer.sentence(*pair(0.8), [known])
    assert said.endswith("Render frames alone. -1.0 dB in the same seconds.")
    for other in (known | {"samples": 4}, known | {"gain": None}):
        assert "with the same samples" in answer.sentence(*pair(0.8), [other])


def test_a_picture_shows_each_number_of_samples(tmp_path: Path) -> None:
    found = [*pair(4.0), *pair(2.0, samples=16)]
    shown = {DEFAULT: 60, XRDS: 120}
    crops = {}
    for point in found:
        crops[crop_key(point)] = tmp_path / f"{len(crops)}.webp"
        pixels = np.full((SIZE, SIZE, 3), shown[point["method"]], np.uint8)
        Image.fromarray(pixels).save(crops[crop_key(point)], lossless=True)
    true = tmp_path / "reference.webp"
    Image.fromarray(np.full((SIZE, SIZE, 3), 200, np.uint8)).save(true, lossless=True)
    answer.write(tmp_path, found, [], crops | {("room", "pan", *REFERENCE): true})
    with Image.open(tmp_path / "answer-room.webp") as picture:
        pixels = np.asarray(picture.convert("L"))
    assert pixels.shape[1] > 3 * 2 * SIZE
    half = pixels.shape[0] // 2
    for row in (pixels[half // 2], pixels[half + half // 2]):
        middles = row[SIZE :: 2 * SIZE + 6][:3].astype(int)
        assert np.abs(middles - [60, 120, 200]).max() < 8
    answer.write(tmp_path / "none", found, [], crops)  # no reference: no picture
    assert not (tmp_path / "none").exists()


def test_the_estimate_is_of_all_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    window = Window(64, 48, 0, 0, 64, 48)
    shots = [Shot(Path(f"{name}.blend"), window, None, name) for name in "ab"]
    monkeypatch.setattr(
        estimate, "_sample_seconds", lambda shot: {"a": 1.0, "b": 30.0}[shot.name]
    )
    said = estimate.sentence(dict(zip(shots, (60.0, 10.0), strict=True)))
    assert said.startswith("about 6 min of rendering, b the longest")
    assert "longest" not in estimate.sentence({shots[0]: 60.0})
