from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from xrds_core.errors import PictureError, UsageError
from xrds_core.exr import read_beauty, write_picture
from xrds_core.superres import exr_upscale, weights
from xrds_core.superres.exr_upscale import upscale_file
from xrds_core.superres.network import XRDS, preset_config
from xrds_core.superres.upscaler import Upscaler
from xrds_lab.weights import save_network


def planes(name: str, letters: str, height: int, width: int) -> dict[str, np.ndarray]:
    generator = np.random.default_rng(len(name))
    size = (height, width)
    return {f"{name}{x}": generator.random(size, np.float32) for x in letters}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    torch.manual_seed(0)
    network = XRDS(preset_config("fast", 2))
    save_network(network, tmp_path / weights.file_name("fast", 2), {})
    passes = {
        **planes("ViewLayer.Combined.", "RGBA", 19, 16),
        **planes("ViewLayer.Noisy Image.", "RGB", 19, 16),
        **planes("ViewLayer.Denoising Albedo.", "RGB", 19, 16),
        **planes("ViewLayer.Denoising Normal.", "XYZ", 19, 16),
    }
    write_picture(tmp_path / "guides.exr", passes)
    for name, letters in (("opaque", "RGB"), ("low", "RGBA")):
        write_picture(tmp_path / f"{name}.exr", planes("", letters, 10, 8))
    return tmp_path


@pytest.mark.parametrize(("name", "channels"), [("opaque", 3), ("low", 4)])
def test_files_in_a_file_out(folder: Path, name: str, channels: int) -> None:
    told = upscale_file(
        folder / f"{name}.exr",
        folder / "guides.exr",
        folder / "out.exr",
        exposure=0.5,
        device="cpu",
        weights=folder,
    )
    assert told["output"] == str(folder / "out.exr")
    assert told["seconds"] > 0.0
    assert (told["bad_pixels"], told["tiles"]) == (0, 1)
    result = read_beauty(folder / "out.exr").picture
    assert result.shape == (19, 16, channels)

    passes = exr_upscale.read_guides(folder / "guides.exr")
    expected = Upscaler("fast", 2, "cpu", weights=folder)(
        read_beauty(folder / f"{name}.exr").picture,
        passes.albedo,
        passes.normal,
        guide_alpha=passes.alpha if channels == 4 else None,
        exposure=0.5,
    )
    np.testing.assert_array_equal(result, expected.radiance)


@pytest.mark.parametrize("output", ["low.exr/out.exr", ".", "low.exr"])
def test_an_output_that_cannot_be_is_told_before_the_work(
    folder: Path, output: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(exr_upscale, "Upscaler", None)
    low, guide = folder / "low.exr", folder / "guides.exr"
    with pytest.raises(PictureError, match="cannot write"):
        upscale_file(low, guide, folder / output, weights=folder)


@pytest.mark.parametrize("name", ["out.png", "out.jpg", "out"])
def test_no_exr_is_written_under_another_formats_name(folder: Path, name: str) -> None:
    low, guide = folder / "low.exr", folder / "guides.exr"
    with pytest.raises(UsageError, match=rf"{name}' must end in \.exr"):
        upscale_file(low, guide, folder / name, weights=folder)
    assert not (folder / name).exists()


def test_a_lost_alpha_is_counted_and_told_and_keeps_the_colour(folder: Path) -> None:
    from xrds_blender.command.upscale import _lines

    colour = planes("", "RGB", 10, 8)
    for name, alpha in (("lost", np.nan), ("whole", 1.0)):
        channels = {**colour, "A": np.full((10, 8), alpha, np.float32)}
        write_picture(folder / f"{name}.exr", channels)
    told = {
        name: upscale_file(
            folder / f"{name}.exr",
            folder / "guides.exr",
            folder / f"{name}.out.exr",
            weights=folder,
        )
        for name in ("lost", "whole")
    }
    assert (told["lost"]["bad_pixels"], told["whole"]["bad_pixels"]) == (80, 0)
    assert "replaced 80 bad pixels" in _lines(told["lost"])[1]
    assert len(_lines(told["whole"])) == 1
    results = [read_beauty(told[name]["output"]).radiance for name in told]
    assert results[0].mean() > 0.2
    np.testing.assert_array_equal(*results)


def test_bad_pixels_of_a_shot_are_told_by_frame() -> None:
    from xrds_blender.command.denoise import _lines

    frames = [{"frame": n, "bad_pixels": bad} for n, bad in ((3, 0), (4, 7))]
    told = _lines({"output": "out", "frames": frames, "kept": []})
    assert told[1:] == [
        "  frame 4: replaced 7 bad pixels: NaN, infinities or negative light"
    ]


def test_a_wrong_guide_file_writes_nothing(folder: Path) -> None:
    low = folder / "low.exr"
    with pytest.raises(PictureError, match="Denoising Albedo"):
        upscale_file(low, low, folder / "out.exr", weights=folder)
    assert not (folder / "out.exr").exists()
