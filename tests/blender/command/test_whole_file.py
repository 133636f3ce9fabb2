"""A half-written file is never taken for a picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from xrds_blender.command.picture_file import is_whole
from xrds_core import exr

SIZE = (62, 40)


@pytest.fixture(params=["frame.exr", "frame.png"])
def frame(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    path = tmp_path / request.param
    width, height = SIZE
    # packs well: what OpenEXR cannot pack has no checksum
    noise = np.random.default_rng(0).integers(0, 9, (height, width, 3)) / np.float32(8)
    if path.suffix == ".png":
        Image.fromarray((255 * noise).astype(np.uint8)).save(path)
    else:
        exr.write_picture(
            path,
            dict(zip("RGB", np.moveaxis(noise.astype(np.float32), 2, 0), strict=True)),
        )
    return path


def test_a_whole_file_of_the_size(frame: Path) -> None:
    assert is_whole(frame, SIZE)
    assert not is_whole(frame, (40, 62))
    assert not is_whole(frame.with_stem("none"), SIZE)
    assert not is_whole(frame.parent, SIZE)


@pytest.mark.parametrize("rest", ["missing", "zero"])
def test_half_a_file_is_none(frame: Path, rest: str) -> None:
    whole = frame.read_bytes()
    for percent in (*range(0, 100, 5), 99):
        at = len(whole) * percent // 100
        left = bytes(len(whole) - at) if rest == "zero" else b""
        frame.write_bytes(whole[:at] + left)
        assert not is_whole(frame, SIZE), percent
    frame.write_bytes(whole[:-1])
    assert not is_whole(frame, SIZE)


def test_another_format_under_its_name_is_none(frame: Path) -> None:
    other = frame.with_suffix({".exr": ".png", ".png": ".exr"}[frame.suffix])
    frame.rename(other)
    assert not is_whole(other, SIZE)


@pytest.mark.parametrize("seed", range(5))
def test_random_bytes_after_a_signature(tmp_path: Path, seed: int) -> None:
    path = tmp_path / "frame.png"
    noise = np.random.default_rng(seed).bytes(900)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + noise)
    assert not is_whole(path, SIZE)
