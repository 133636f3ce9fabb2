"""`xrds denoise --halves`: a second file of other samples of each frame."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sequences import CYCLES, frame, write

from xrds_core.accumulation.noise import brightness
from xrds_core.errors import PictureError, UsageError
from xrds_core.shot_files.frame_file import Reading, read_frame
from xrds_core.shot_files.sequence import Files

NUMBERS = range(1, 6)


def written(folder: Path) -> tuple[Path, Reading]:
    """Five frames in two halves each."""
    for number in NUMBERS:
        one = frame(number)
        other = replace(one, radiance=one.radiance[:, ::-1].copy())
        write(folder / "a", one)
        write(folder / "b", other)
    return folder / "a", Reading(halves=str(folder / "b" / "####.exr"))


def test_a_frame_is_the_mean_of_its_halves(tmp_path: Path) -> None:
    folder, reading = written(tmp_path)
    alone = read_frame(folder / "0003.exr", 3, Reading()).stored
    both = read_frame(folder / "0003.exr", 3, reading).stored
    assert both.samples == 2 * alone.samples
    picture = alone.picture.reshape(*alone.shape, -1)[..., :3].astype(np.float32)
    mean = (picture + picture[:, ::-1]) / 2
    found = both.picture.reshape(*both.shape, -1)[..., :3]
    assert found == pytest.approx(mean, abs=2e-3)
    # and its noise is what the halves say, not the pixels around
    assert both.noise is not None
    told = both.noise.difference.reshape(both.shape)
    halves = (brightness(picture) - brightness(picture[:, ::-1])) / 2
    assert told == pytest.approx(halves, abs=2e-3)


def test_a_half_that_is_missing_or_of_other_passes_is_told(tmp_path: Path) -> None:
    folder, reading = written(tmp_path)
    names = CYCLES | {"alpha": "ViewLayer.Noisy Image.A"}
    odd = frame(2)
    write(tmp_path / "b", odd, names, alpha=np.ones(odd.shape, np.float32))
    with pytest.raises(PictureError, match="no half of"):
        read_frame(folder / "0002.exr", 2, reading)
    (tmp_path / "b" / "0004.exr").unlink()
    with pytest.raises(PictureError, match="the frame's other half"):
        read_frame(folder / "0004.exr", 4, reading)


def test_halves_are_not_written_over(tmp_path: Path) -> None:
    folder, reading = written(tmp_path)
    files = Files(str(folder / "####.exr"), reading.halves, halves=reading.halves)
    with pytest.raises((UsageError, PictureError)):
        files.check([3], list(NUMBERS))
