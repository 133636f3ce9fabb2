"""The first-order regression under the base of the small presets."""

from __future__ import annotations

import pytest
import torch
from torch import Tensor
from torch.nn import functional as F

from xrds_core.superres.regression import (
    ALBEDO_EPSILON,
    GRAIN_LIMIT,
    RESTORED_LIMIT,
    blur,
    explain,
    find_grain,
    solve,
)


def smooth(*shape: int) -> Tensor:
    return blur(blur(blur(torch.rand(*shape))))


def explained(
    radiance: Tensor, guides: Tensor, scale: int, noisy: Tensor | None = None
) -> Tensor:
    """The radiance over what the guides explain of it, enlarged, times that again."""
    found = explain(radiance, radiance if noisy is None else noisy, guides, scale)
    rest = found.low / F.avg_pool2d(found.factor, scale)
    return F.interpolate(rest, scale_factor=scale, mode="bilinear") * found.factor


def error(picture: Tensor, reference: Tensor) -> float:
    return float((picture - reference).abs().mean() / reference.mean())


@pytest.mark.parametrize("scale", [1, 2, 4])
def test_texture_under_even_light_comes_back_sharp(scale: int) -> None:
    torch.manual_seed(0)
    albedo = torch.rand(2, 3, 32 * scale, 32 * scale).round() * 0.6 + 0.2
    reference = albedo * (0.5 + smooth(2, 1, 32 * scale, 32 * scale))
    low = F.avg_pool2d(reference, scale)
    guides = torch.cat((albedo, torch.zeros_like(albedo)), dim=1)
    plain = F.interpolate(low, scale_factor=scale, mode="bilinear")
    result = explained(low, guides, scale)
    assert error(result, reference) < max(0.3 * error(plain, reference), 0.01)


def test_shading_by_the_normal_is_found() -> None:
    torch.manual_seed(1)
    tilt = (smooth(1, 1, 64, 64) - 0.5) * 3 + torch.rand(1, 1, 64, 64).round() * 0.6
    normal = torch.cat((tilt, torch.zeros_like(tilt), (1 - tilt**2).clamp(0).sqrt()), 1)
    reference = (2 * tilt).exp().expand(-1, 3, -1, -1)
    guides = torch.cat((torch.full_like(normal, 0.5), normal), dim=1)
    low = F.avg_pool2d(reference, 2)
    plain = F.interpolate(low, scale_factor=2, mode="bilinear")
    result = explained(low, guides, 2)
    assert error(result, reference) < 0.7 * error(plain, reference)


def test_texture_that_a_denoiser_took_away_comes_back() -> None:
    torch.manual_seed(4)
    albedo = torch.rand(1, 3, 128, 128).round() * 0.6 + 0.2
    reference = albedo * (0.5 + smooth(1, 1, 128, 128))
    low = F.avg_pool2d(reference, 4)
    denoised = blur(low)
    noisy = low * (0.5 + torch.rand_like(low))
    guides = torch.cat((albedo, torch.zeros_like(albedo)), dim=1)
    without = explained(denoised, guides, 4)
    result = explained(denoised, guides, 4, noisy)
    assert error(result, reference) < 0.6 * error(without, reference)


def test_fireflies_leave_a_bounded_grain() -> None:
    low = torch.full((1, 3, 4, 4), 0.5)
    noisy = low.clone()
    noisy[..., 0, 0], noisy[..., 1, 1] = 1e30, 0.0
    grain = find_grain(low, noisy)
    assert grain[..., 0, 0].max() == GRAIN_LIMIT
    assert -1 <= grain[..., 1, 1].min() < -0.9
    assert grain.count_nonzero() == 6


def test_guides_that_say_nothing_are_left_out() -> None:
    torch.manual_seed(2)
    low = 0.3 + smooth(1, 3, 24, 24)
    guides = torch.rand(1, 6, 48, 48)
    guides[:, 3:] = 0
    slopes = explain(low, low, guides, 2).slopes
    lying = F.interpolate(low, scale_factor=2) * (guides[:, :3] + ALBEDO_EPSILON)
    lying = F.avg_pool2d(lying, 2)
    believed = explain(lying, lying, guides, 2).slopes
    assert slopes[:, 0].mean() < 0.1
    assert believed[:, 0].mean() > 0.5


def test_grey_stays_grey_and_channels_may_be_exchanged() -> None:
    torch.manual_seed(3)
    low, noisy = torch.rand(2, 1, 3, 16, 16)
    guides = torch.rand(1, 6, 32, 32)
    found = explain(low, noisy, guides, 2)
    order = [2, 0, 1]
    exchanged = torch.cat((guides[:, order], guides[:, 3:]), dim=1)
    other = explain(low[:, order], noisy[:, order], exchanged, 2)
    torch.testing.assert_close(other.low, found.low[:, order])
    torch.testing.assert_close(other.factor, found.factor[:, order])
    torch.testing.assert_close(other.slopes, found.slopes)
    grey = torch.cat((guides[:, :1].expand(-1, 3, -1, -1), guides[:, 3:]), dim=1)
    found = explain(*(x[:, :1].expand(-1, 3, -1, -1) for x in (low, noisy)), grey, 2)
    for x in (found.low, found.factor):
        torch.testing.assert_close(x, x[:, :1].expand_as(x))


@pytest.mark.parametrize("scale", [2.0**-40, 1.0, 2.0**40])
@pytest.mark.parametrize("spread", [0.0, 12.0])
def test_factors_stay_finite_and_bounded(scale: float, spread: float) -> None:
    torch.manual_seed(5)
    low, noisy = scale * 10 ** (spread * (torch.rand(2, 1, 3, 16, 16) - 0.5))
    low[..., :8, :8] = 0
    guides = torch.rand(1, 6, 32, 32) * 2 - 1
    guides[:, :3] = guides[:, :3].clamp(min=0)
    found = explain(low, noisy, guides, 2)
    assert all(x.isfinite().all() for x in found)
    assert found.factor.min() > 1e-6
    assert found.factor.max() < 1e6
    assert not found.low[..., :8, :8].any()  # what is black stays black
    lit = low > 0
    assert (found.low[lit] / low[lit]).log().abs().max() <= 2 * RESTORED_LIMIT + 1e-3


def test_restored_radiance_keeps_its_means_and_what_was_not_denoised() -> None:
    torch.manual_seed(7)
    low = 0.3 + smooth(1, 3, 24, 24)
    guides = torch.cat((torch.rand(1, 3, 96, 96), torch.zeros(1, 3, 96, 96)), dim=1)
    torch.testing.assert_close(explain(low, low, guides, 4).low, low)
    texture = F.avg_pool2d(guides[:, :3], 4) + 0.1
    found = explain(low, low * texture / texture.mean(), guides, 4)
    assert (found.low / low - 1).abs().mean() > 0.02
    torch.testing.assert_close(blur(found.low), blur(low), rtol=0.03, atol=0)


def test_solver_agrees_with_lapack() -> None:
    torch.manual_seed(6)
    roots = torch.rand(2, 3, 5, 4, 4)
    matrix = roots @ roots.mT + 0.05 * torch.eye(4)
    right = torch.rand(2, 3, 5, 4)
    planes = {
        (i, j): (matrix[..., i, j] if j < 4 else right[..., i])[:, None]
        for i in range(4)
        for j in range(i, 5)
    }
    ours = torch.stack([x[:, 0] for x in solve(planes, 4)], dim=-1)
    torch.testing.assert_close(ours, torch.linalg.solve(matrix, right))


@pytest.mark.parametrize("scale", [1, 2, 4])
def test_bands_are_of_no_matter(scale: int, monkeypatch: pytest.MonkeyPatch) -> None:
    torch.manual_seed(6)
    low, noisy = torch.rand(2, 1, 3, 50, 10)
    guides = torch.rand(1, 6, 50 * scale, 10 * scale)
    whole = explain(low, noisy, guides, scale)
    monkeypatch.setattr("xrds_core.superres.regression.BAND", 7)
    for part, expected in zip(explain(low, noisy, guides, scale), whole, strict=True):
        torch.testing.assert_close(part, expected)
