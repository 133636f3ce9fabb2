"""`xrds try`, end to end."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from channels import read_channels

bpy = pytest.importorskip("bpy")
pytest.importorskip("mitsuba_oidn")

from xrds_blender.command import main
from xrds_blender.command.labels import draw_label


@pytest.fixture
def shot(blend: Path, capfd: pytest.CaptureFixture[str]) -> Path:
    """Five frames in a file."""
    bpy.context.scene.frame_end = 5
    bpy.ops.wm.save_mainfile()
    capfd.readouterr()
    return blend


def run(blend: Path, out: Path) -> int:
    words = ["--frame", "2", "--temporal-radius", "1", "--json"]
    return main.main(["try", str(blend), "-o", str(out), *words])


@pytest.mark.parametrize("suffix", [".webp", ".jpg", ".png"])
def test_a_picture_with_labels(
    suffix: str,
    shot: Path,
    load: Callable[..., np.ndarray],
    capfd: pytest.CaptureFixture[str],
) -> None:
    out = shot.parent / "new" / f"try{suffix}"
    assert run(shot, out) == 0
    told, said = capfd.readouterr()
    result = json.loads(told)
    assert (result["frame"], result["resolution"]) == (2, [64, 48])
    assert result["cycles"]["samples"] == 1
    assert result["xrds"]["frames"] == [1, 2, 3]
    assert result["xrds"]["samples"] >= 2
    assert "frame 3, " in said
    assert "left" in said
    picture = load(out)[..., :3]
    assert picture.shape == (48, 64, 3)
    for half in np.split(picture, 2, axis=1):
        assert half[:30].std() > 0.02  # a scene
        assert np.ptp(half[-10:].mean(axis=2)) > 0.3  # letters on a dark ground
    assert list(out.parent.iterdir()) == [out]


def test_layers_of_an_exr(shot: Path) -> None:
    out = shot.parent / "try.exr"
    assert run(shot, out) == 0
    channels = read_channels(out)
    assert sorted(channels) == sorted(
        f"{n}.{c}" for n in ("Cycles", "XRDS") for c in "RGB"
    )
    assert not np.array_equal(channels["Cycles.R"], channels["XRDS.R"])


@pytest.mark.parametrize(
    ("out", "frame", "status", "line"),
    [
        ("try.gif", "2", 2, "must end in .webp, .png, .jpg or .exr"),
        ("try.png", "900", 1, "frame 900 has no neighbours among frames 1 to 5"),
    ],
)
def test_bad_input_is_one_line(
    shot: Path,
    out: str,
    frame: str,
    status: int,
    line: str,
    capfd: pytest.CaptureFixture[str],
) -> None:
    words = ["try", str(shot), "-o", str(shot.parent / out), "--frame", frame]
    assert main.main(words) == status
    said = [x for x in capfd.readouterr().err.splitlines() if x.startswith("xrds:")]
    assert len(said) == 1
    assert line in said[0]
    assert not (shot.parent / out).exists()


def test_labels_stand_in_the_corners() -> None:
    picture = np.full((270, 480, 4), 0.5, np.float32)
    draw_label(picture, "Cycles, 64 samples, 41 s", at_right=False)
    changed = (picture[..., :3] != 0.5).any(axis=2)
    rows, columns = np.nonzero(changed)
    assert rows.max() == 269
    assert rows.min() > 240
    assert columns.min() == 0
    assert columns.max() < 240
    assert picture.max() == 1.0
    other = np.full((270, 480, 4), 0.5, np.float32)
    draw_label(other, "Cycles, 64 samples, 41 s", at_right=True)
    assert np.nonzero((other != 0.5).any(axis=(0, 2)))[0].max() == 479
