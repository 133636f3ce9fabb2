"""Guides of few samples: what the filter does to them, and when it is asked."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from torch.nn import functional

from xrds_core.errors import UsageError, WeightsError
from xrds_core.superres import guide_filter, guide_noise
from xrds_core.superres.exr_upscale import upscale_file
from xrds_core.superres.guide_filter import (
    FEW_SAMPLES,
    STRENGTH,
    GuideFilter,
    filter_guides,
)
from xrds_core.superres.upscaler import Upscaler
from xrds_core.superres.weights import load_guide_filter
from xrds_core.superres.weights_header import GUIDE_FILTER, guide_filter_record
from xrds_lab.weights import save_guide_filter


@pytest.fixture(scope="module")
def shipped() -> GuideFilter:
    return load_guide_filter()


def random_guides(height: int, width: int, seed: int = 0) -> torch.Tensor:
    torch.manual_seed(seed)
    return torch.cat(
        (torch.rand(1, 3, height, width), 2 * torch.rand(1, 3, height, width) - 1), 1
    )


def edges(seed: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Two surfaces with a soft border, and one sample of each pixel of it."""
    torch.manual_seed(seed)
    cover = torch.linspace(-2, 3, 64).clamp(0, 1).expand(1, 1, 64, 64)
    first, second = (torch.rand(1, 6, 1, 1) * 0.8 + 0.1 for _ in range(2))
    sampled = (torch.rand(1, 1, 64, 64) < cover).float()
    return tuple(first + (second - first) * share for share in (cover, sampled))


# --- the filter -----------------------------------------------------------------------


def test_even_guides_stay_as_they_are(shipped: GuideFilter) -> None:
    even = torch.rand(1, 6, 1, 1).expand(1, 6, 40, 30).contiguous()
    torch.testing.assert_close(filter_guides(shipped, even), even)


def test_every_value_is_among_its_neighbours(shipped: GuideFilter) -> None:
    guides = random_guides(33, 47)
    padded = functional.pad(guides, (1, 1, 1, 1), mode="replicate")
    largest = functional.max_pool2d(padded, 3, 1)
    least = -functional.max_pool2d(-padded, 3, 1)
    found = filter_guides(shipped, guides)
    assert (found <= largest + 1e-6).all()
    assert (found >= least - 1e-6).all()


@pytest.mark.parametrize("seed", range(4))
def test_noise_of_one_sample_is_halved(shipped: GuideFilter, seed: int) -> None:
    truth, noisy = edges(seed)
    before, after = (
        (x - truth).square().mean() for x in (noisy, filter_guides(shipped, noisy))
    )
    assert after < 0.5 * before


@pytest.mark.parametrize("band", [8, 24, 64])
def test_bands_are_those_of_the_whole(
    shipped: GuideFilter, monkeypatch: pytest.MonkeyPatch, band: int
) -> None:
    guides = random_guides(51, 21)
    whole = shipped.band(guides)
    monkeypatch.setattr(guide_filter, "BAND", band)
    torch.testing.assert_close(shipped(guides), whole)


def test_strength_is_the_way_from_the_guides_to_their_means(
    shipped: GuideFilter,
) -> None:
    guides = random_guides(16, 16)
    way = filter_guides(shipped, guides) - guides
    torch.testing.assert_close(way, STRENGTH * (shipped(guides) - guides))


# --- when it is asked -----------------------------------------------------------------


@pytest.fixture
def no_library(monkeypatch: pytest.MonkeyPatch) -> None:
    """Open Image Denoise, which does more, is missing."""
    monkeypatch.setattr(guide_noise, "_denoiser", lambda *_: None)


def arrays(side: int = 40) -> tuple[np.ndarray, ...]:
    random = np.random.default_rng(0)
    low = random.random((side, side, 3), np.float32)
    albedo, normal = random.random((2, 2 * side, 2 * side, 3), np.float32)
    return low, albedo, normal


@pytest.mark.usefixtures("no_library")
def test_only_few_samples_are_filtered(upscaler: Upscaler) -> None:
    low, albedo, normal = arrays()
    many = upscaler(low, albedo, normal).radiance
    for samples in (FEW_SAMPLES, 64):
        found = upscaler(low, albedo, normal, guide_samples=samples).radiance
        np.testing.assert_array_equal(found, many)
    few = upscaler(low, albedo, normal, guide_samples=FEW_SAMPLES - 1).radiance
    guides = np.concatenate((albedo, normal), axis=-1).transpose(2, 0, 1)[None]
    quiet = filter_guides(upscaler.guide_filter, torch.from_numpy(guides))
    quiet = quiet[0].permute(1, 2, 0).numpy()
    expected = upscaler(low, quiet[..., :3], quiet[..., 3:]).radiance
    np.testing.assert_allclose(few, expected, rtol=1e-4, atol=1e-5)
    assert np.abs(few - many).max() > 1e-2


@pytest.mark.nightly
def test_tiles_show_no_seams(upscaler: Upscaler) -> None:
    low, albedo, normal = arrays(224)
    whole = upscaler(low, albedo, normal, guide_samples=1)
    tiled = upscaler(low, albedo, normal, guide_samples=1, tile=192)
    plain = upscaler(low, albedo, normal, tile=192).radiance
    assert tiled.tiles > whole.tiles == 1
    apart = np.abs(tiled.radiance - whole.radiance).max()
    usual = np.abs(plain - upscaler(low, albedo, normal).radiance).max()
    assert apart < 2 * usual + 1e-5


def test_guides_of_no_samples_are_refused(upscaler: Upscaler) -> None:
    with pytest.raises(UsageError, match="guide_samples is 0"):
        upscaler(*arrays(), guide_samples=0)


@pytest.mark.usefixtures("no_library")
def test_files_tell_no_samples(tmp_path: Path) -> None:
    """So the command is told of them; without, guides are taken as they are."""
    from xrds_core.exr import read_beauty, write_picture

    low, albedo, normal = arrays(16)
    write_picture(tmp_path / "low.exr", planes("Combined", low, "RGB"))
    guides = planes("Denoising Albedo", albedo, "RGB")
    guides |= planes("Denoising Normal", normal, "XYZ")
    write_picture(tmp_path / "guides.exr", guides)
    pictures = {}
    for samples in (None, 1, FEW_SAMPLES):
        out = tmp_path / f"{samples}.exr"
        upscale_file(
            tmp_path / "low.exr", tmp_path / "guides.exr", out, guide_samples=samples
        )
        pictures[samples] = read_beauty(out).radiance
    np.testing.assert_array_equal(pictures[None], pictures[FEW_SAMPLES])
    assert np.abs(pictures[1] - pictures[None]).max() > 1e-2


def planes(name: str, picture: np.ndarray, channels: str) -> dict[str, np.ndarray]:
    """As Blender names a pass."""
    return {f"ViewLayer.{name}.{c}": picture[..., i] for i, c in enumerate(channels)}


# --- its file -------------------------------------------------------------------------


def test_a_folder_may_bring_its_own(tmp_path: Path) -> None:
    own = GuideFilter()
    save_guide_filter(own, tmp_path / GUIDE_FILTER.name, {})
    found = load_guide_filter(tmp_path).state_dict()
    assert all(
        torch.equal(found[k], v.half().float()) for k, v in own.state_dict().items()
    )
    assert guide_filter_record(tmp_path) != guide_filter_record()
    assert guide_filter_record(tmp_path / "without") == guide_filter_record()
    other = load_guide_filter(tmp_path / "without").state_dict()
    assert not all(torch.equal(found[k], v) for k, v in other.items())


def test_a_damaged_file_is_named(tmp_path: Path) -> None:
    path = tmp_path / GUIDE_FILTER.name
    path.write_bytes(GUIDE_FILTER.read_bytes()[:200])
    with pytest.raises(WeightsError, match=GUIDE_FILTER.name):
        load_guide_filter(tmp_path)


def test_a_file_of_another_network_is_refused(tmp_path: Path) -> None:
    path = tmp_path / GUIDE_FILTER.name
    path.write_bytes((GUIDE_FILTER.parent / "fast_x2.safetensors").read_bytes())
    with pytest.raises(WeightsError, match="tensor"):
        load_guide_filter(tmp_path)
