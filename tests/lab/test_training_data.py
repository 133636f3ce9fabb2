"""Training crops: aligned, varied alike, normals turning with the picture."""

from __future__ import annotations

import multiprocessing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from xrds_core.errors import PictureError, UsageError
from xrds_lab.training.augmentation import (
    over_denoised,
    random_rotation,
    transpose_and_flip,
)
from xrds_lab.training.config import TrainingConfig
from xrds_lab.training.crop import Batch, Crop
from xrds_lab.training.data import Variation, draw, with_noise_of
from xrds_lab.training.loader import CropLoader
from xrds_lab.training.train import crop_size
from xrds_lab.training.windows import WindowSet, find_windows, paths_of, read_window


def first_window(config: TrainingConfig) -> Path:
    return Path(config.data[0]) / "train" / "0.npz"


def test_crops_stay_aligned(config: TrainingConfig, full_variation: Variation) -> None:
    window = read_window(first_window(config), 2)
    variation = replace(full_variation, black=0.0, shaded=0.0)
    for seed in range(20):
        random = np.random.default_rng(seed)
        batch = draw(window, 2, variation, random, 16)
        assert batch.guides.shape == (1, 6, 16, 16)
        reference = torch.expm1(batch.reference)
        low = torch.expm1(batch.radiance)
        means = torch.nn.functional.avg_pool2d(reference, 2)
        torch.testing.assert_close(means, low, rtol=2e-2, atol=1e-3)
        ratio = reference / batch.guides[:, :3]
        assert ratio.std() / ratio.mean() < 1e-2  # one light, whatever the variation


def test_normals_turn_with_the_picture() -> None:
    """A dome stays a dome under every symmetry: its normals point outwards."""
    axis = np.linspace(-0.7, 0.7, 8, dtype=np.float32)
    x, y = np.meshgrid(axis, -axis)  # y up, rows downwards
    dome = np.stack((x, y, np.sqrt(1 - x**2 - y**2)), axis=-1)
    seen = set()
    for seed in range(64):
        random = np.random.default_rng(seed)
        marked = np.arange(64, dtype=np.float32).reshape(8, 8, 1)
        whole = Crop(marked, marked, marked, marked, dome, 1.0)
        turned = transpose_and_flip(whole, random)
        np.testing.assert_allclose(turned.normal, dome, atol=1e-6)
        seen.add(turned.low.tobytes())
    assert len(seen) == 8


def test_over_denoised_radiance_loses_a_part_of_its_texture() -> None:
    low = np.random.default_rng(0).random((24, 24, 3)).astype(np.float32)
    random = np.random.default_rng(1)
    spreads = [over_denoised(low, random).std() / low.std() for _ in range(200)]
    assert min(spreads) < 0.3
    assert 0.9 < max(spreads) < 1
    flat = np.full((8, 8, 3), 0.7, np.float32)
    np.testing.assert_allclose(over_denoised(flat, random), flat, rtol=1e-6)


def test_crops_lit_anew_are_over_denoised_only_where_asked(
    config: TrainingConfig,
) -> None:
    window = read_window(first_window(config), 2)

    def differs(variation: Variation, seed: int) -> bool:
        batch = draw(window, 2, variation, np.random.default_rng(seed))
        means = torch.nn.functional.avg_pool2d(torch.expm1(batch.reference), 2)
        return not torch.allclose(means, torch.expm1(batch.radiance), rtol=1e-2)

    half = Variation(shaded=1.0, over_denoised=0.5)
    assert 5 < sum(differs(half, seed) for seed in range(30)) < 25
    assert not any(differs(Variation(shaded=1.0), seed) for seed in range(30))
    assert not any(differs(Variation(over_denoised=1.0), seed) for seed in range(9))


def test_shaded_crops_are_albedo_under_smooth_light(config: TrainingConfig) -> None:
    window = read_window(first_window(config), 2)
    random = np.random.default_rng(1)
    batch = draw(window, 2, Variation(shaded=1.0), random)
    reference, low = torch.expm1(batch.reference), torch.expm1(batch.radiance)
    means = torch.nn.functional.avg_pool2d(reference, 2)
    torch.testing.assert_close(means, low, rtol=1e-3, atol=1e-4)
    light = reference / batch.guides[:, :3]
    steps = light.diff(dim=-1).abs().mean() / light.mean()
    texture = reference.diff(dim=-1).abs().mean() / reference.mean()
    assert steps < 0.5 * texture
    assert light.std() / light.mean() > 0.1


def test_light_of_our_own_keeps_the_noise_of_what_was_rendered() -> None:
    random = np.random.default_rng(2)
    rendered, reference = random.uniform(1, 2, (2, 8, 8, 3)).astype(np.float32)
    noise = random.exponential(1, (8, 8, 3)).astype(np.float32)
    lit = with_noise_of(rendered * noise, rendered, reference, exposure=1.0)
    np.testing.assert_allclose(lit, reference * noise, atol=0.05)
    dark = with_noise_of(rendered * 0, rendered * 0, reference, exposure=1.0)
    np.testing.assert_allclose(dark, reference)


def test_rotations_are_rotations() -> None:
    rotation = random_rotation(np.random.default_rng(3))
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-6)
    assert np.linalg.det(rotation) == pytest.approx(1, abs=1e-6)


def test_crops_to_pad_are_smaller_in_whole_low_resolution_pixels(
    config: TrainingConfig,
) -> None:
    config = replace(config, crop=64, scale=4, variation=Variation(padded=0.25))
    sizes = [crop_size(config, step) for step in range(400)]
    smaller = [size for size in sizes if size != 64]
    assert 0.15 < len(smaller) / len(sizes) < 0.35
    assert set(smaller) == {48, 52, 56, 60}
    assert [crop_size(config, step) for step in range(400)] == sizes
    whole = replace(config, variation=Variation())
    assert {crop_size(whole, step) for step in range(100)} == {64}


@pytest.mark.parametrize("workers", [1, 2])
def test_loader_gives_the_crops_of_each_step_in_order(workers: int) -> None:
    def crop(step: int, place: int) -> Batch:
        marked = torch.full((1, 3, 2, 2), float(10 * step + place))
        return Batch(marked, marked, marked, marked)

    loader = CropLoader(crop, range(1, 4, 2), workers)
    for step in (4, 5, 6, 3):  # a run that goes on begins anywhere
        values = loader.batch(step).reference[:, 0, 0, 0].tolist()
        assert values == [10 * step + 1, 10 * step + 3]
    loader.close()
    assert not multiprocessing.active_children()


def test_loader_tells_what_went_wrong() -> None:
    def crop(step: int, place: int) -> Batch:
        raise PictureError(f"window of step {step} is damaged")

    with pytest.raises(PictureError, match=r"^window of step 3 is damaged$"):
        CropLoader(crop, range(2)).batch(3)


def test_windows_beyond_the_memory_are_read_again(config: TrainingConfig) -> None:
    paths = sorted((Path(config.data[0]) / "train").glob("*.npz"))
    size = read_window(paths[0], 2).size
    windows = WindowSet(paths, 2, memory=2.5 * size)
    kept = [windows[i] is windows[i] for i in range(len(paths))]
    assert kept == [True, True, False]
    again = windows[2]
    np.testing.assert_array_equal(
        again.array("reference"), windows[2].array("reference")
    )


def test_radiance_before_denoising_comes_with_its_render(
    config: TrainingConfig,
) -> None:
    window = read_window(first_window(config), 2)
    rough = {f"low2_{i}_noisy": window.arrays[f"low2_{i}"] * i for i in range(2)}
    window = replace(window, arrays=window.arrays | rough)

    def drawn(variation: Variation) -> list[float]:
        """Of each crop, how bright the noisy radiance is beside the denoised."""
        crops = [
            draw(window, 2, variation, np.random.default_rng(seed))
            for seed in range(12)
        ]
        means = [(torch.expm1(x).mean() for x in (b.noisy, b.radiance)) for b in crops]
        return [round(float(noisy / low), 2) for noisy, low in means]

    assert set(drawn(Variation())) == {0.0, 1.0}
    assert set(drawn(Variation(denoised_only=1.0))) == {1.0}
    lit_anew = drawn(Variation(shaded=1.0))
    assert min(lit_anew) < 0.2
    assert max(lit_anew) == pytest.approx(1.0)


def test_windows_without_the_scale_are_left_out(
    tmp_path: Path, write_window: object
) -> None:
    for name, scale in (("0", 2), ("1", 4), ("2", 2)):
        write_window(tmp_path / "a" / "train" / f"{name}.npz", 1, scale=scale)
    write_window(tmp_path / "b" / "train" / "0.npz", 1)
    folders = [tmp_path / "a", tmp_path / "b"]
    found = find_windows(folders, "train", ["low2_0"])
    assert found == [["0.npz", "2.npz"], ["0.npz"]]
    assert paths_of(folders, "train", found)[-1] == folders[1] / "train" / "0.npz"
    with pytest.raises(UsageError, match=r"4 windows in the train folder .* none with"):
        find_windows(folders, "train", ["low8_0"])


def test_damaged_window_is_named(config: TrainingConfig) -> None:
    path = first_window(config)
    path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(PictureError, match=r"0\.npz"):
        read_window(path, 2)
    with pytest.raises(PictureError, match=r"0\.npz"):
        find_windows([Path(config.data[0])], "train", ["low2_0"])


def test_window_smaller_than_a_crop_is_named(config: TrainingConfig) -> None:
    window = read_window(first_window(config), 2)
    with pytest.raises(PictureError, match=r"0\.npz is smaller than a crop of 64"):
        draw(window, 2, Variation(), np.random.default_rng(0), 64)


def test_missing_scale_is_named(config: TrainingConfig) -> None:
    with pytest.raises(PictureError, match="scale 4"):
        read_window(first_window(config), 4)
