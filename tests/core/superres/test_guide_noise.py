"""Noise of few samples in guides, taken out by Open Image Denoise."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from xrds_core.denoising import Denoiser
from xrds_core.errors import Cancelled, UsageError
from xrds_core.exr import read_beauty, write_picture
from xrds_core.superres import guide_noise
from xrds_core.superres.exr_upscale import upscale_file
from xrds_core.superres.guide_noise import NOISY_SAMPLES, remover
from xrds_core.superres.upscaler import Upscaler

pytest.importorskip("mitsuba_oidn")
SIDE = 96
Guides = tuple[np.ndarray, np.ndarray]


def guides(noise: float) -> Guides:
    """Albedo and normal of two surfaces, as glass over them is seen by few samples."""
    random = np.random.default_rng(1)
    left = (np.arange(SIDE) < SIDE // 2)[None, :, None]
    albedo = np.where(left, (0.2, 0.4, 0.6), (0.7, 0.3, 0.2))
    normal = np.where(left, (0.0, 0.6, 0.8), (0.6, 0.0, 0.8))
    shape = (SIDE, SIDE, 3)
    noisy = (
        np.broadcast_to(x, shape) + noise * random.standard_normal(shape)
        for x in (albedo, normal)
    )
    albedo, normal = (x.astype(np.float32) for x in noisy)
    return albedo.clip(0, 1), normal.clip(-1, 1)


def error(found: Guides, truth: Guides) -> float:
    return float(
        np.mean([np.square(a - b).mean() for a, b in zip(found, truth, strict=True)])
    )


def test_most_of_the_noise_goes() -> None:
    quiet, truth, noisy = remover(4, "cpu"), guides(0.0), guides(0.1)
    assert quiet is not None
    assert error(quiet(*noisy), truth) < 0.2 * error(noisy, truth)


def test_what_is_given_stays_as_it_is() -> None:
    albedo, normal = guides(0.1)
    before = albedo.copy(), normal.copy()
    Denoiser(device="cpu").guides(albedo, normal)
    np.testing.assert_array_equal(albedo, before[0])
    np.testing.assert_array_equal(normal, before[1])


def test_clean_guides_are_returned_as_given() -> None:
    even = np.full((512, 512, 3), 0.5, np.float32)  # large enough to be judged
    noisy = even + np.random.default_rng(0).normal(0, 0.1, even.shape).astype("f4")
    found = Denoiser(device="cpu").guides(noisy, even)
    assert found[0] is not noisy
    assert found[1] is even


@pytest.mark.parametrize("samples", [None, NOISY_SAMPLES, 4096])
def test_more_samples_are_left_alone(samples: int | None) -> None:
    assert remover(samples, "cpu") is None


def test_a_picture_is_made_of_the_denoised_guides(upscaler: Upscaler) -> None:
    low = np.random.default_rng(0).random((SIDE // 2, SIDE // 2, 3), np.float32)
    noisy = guides(0.1)
    quiet = remover(1, "cpu")
    assert quiet is not None
    found = upscaler(low, *noisy, guide_samples=NOISY_SAMPLES - 1).radiance
    expected = upscaler(low, *quiet(*noisy)).radiance
    np.testing.assert_array_equal(found, expected)
    assert np.abs(found - upscaler(low, *noisy).radiance).max() > 1e-3


def test_guides_of_no_samples_are_refused(upscaler: Upscaler) -> None:
    low = np.ones((SIDE // 2, SIDE // 2, 3), np.float32)
    with pytest.raises(UsageError, match="guide_samples is 0"):
        upscaler(low, *guides(0.1), guide_samples=0)


def test_files_tell_no_samples(tmp_path: Path) -> None:
    """So the command is told of them; without, guides are taken as they are."""
    low = np.random.default_rng(0).random((SIDE // 2, SIDE // 2, 3), np.float32)
    albedo, normal = guides(0.1)
    write_picture(tmp_path / "low.exr", planes("Combined", low, "RGB"))
    written = planes("Denoising Albedo", albedo, "RGB")
    written |= planes("Denoising Normal", normal, "XYZ")
    write_picture(tmp_path / "guides.exr", written)
    pictures = {}
    for samples in (None, 1, NOISY_SAMPLES):
        out = tmp_path / f"{samples}.exr"
        upscale_file(
            tmp_path / "low.exr", tmp_path / "guides.exr", out, guide_samples=samples
        )
        pictures[samples] = read_beauty(out).radiance
    np.testing.assert_array_equal(pictures[None], pictures[NOISY_SAMPLES])
    assert np.abs(pictures[1] - pictures[None]).max() > 1e-3


def planes(name: str, picture: np.ndarray, channels: str) -> dict[str, np.ndarray]:
    """As Blender names a pass."""
    return {f"ViewLayer.{name}.{c}": picture[..., i] for i, c in enumerate(channels)}


def test_it_can_be_cancelled(upscaler: Upscaler) -> None:
    low = np.ones((SIDE // 2, SIDE // 2, 3), np.float32)
    with pytest.raises(Cancelled):
        upscaler(low, *guides(0.1), guide_samples=4, progress=lambda _: False)


def test_without_the_library_there_is_nothing_to_take_it_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def missing(*_: object, **__: object) -> None:
        raise UsageError("no such library")

    monkeypatch.setattr("xrds_core.denoising.Denoiser", missing)
    guide_noise._denoiser.cache_clear()
    try:
        assert remover(4, "cpu") is None
    finally:
        guide_noise._denoiser.cache_clear()


@pytest.fixture(autouse=True)
def nothing_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """No test finds what another one has denoised."""
    monkeypatch.setattr(guide_noise, "_CACHE", guide_noise._Cache())


def test_the_same_guides_are_denoised_once(monkeypatch: pytest.MonkeyPatch) -> None:
    noisy, quiet = guides(0.1), remover(1, "cpu")
    assert quiet is not None
    first = quiet(*noisy)
    monkeypatch.setattr(Denoiser, "guides", lambda *_, **__: pytest.fail("again"))
    again = quiet(*(guide.copy() for guide in noisy))
    np.testing.assert_array_equal(again[0], first[0])
    np.testing.assert_array_equal(again[1], first[1])
    with pytest.raises(pytest.fail.Exception, match="again"):
        quiet(noisy[0], noisy[1] + np.float32(1e-6))


def test_large_guides_are_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guide_noise, "CACHE_BYTES", 1)
    noisy, quiet = guides(0.1), remover(1, "cpu")
    assert quiet is not None
    quiet(*noisy)
    monkeypatch.setattr(Denoiser, "guides", lambda *_, **__: pytest.fail("again"))
    with pytest.raises(pytest.fail.Exception, match="again"):
        quiet(*noisy)
