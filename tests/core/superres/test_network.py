"""What the network and its presets promise; `test_info` holds the paper's counts."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from torch.nn import functional as F

from xrds_core.superres.network import XRDS, NetworkConfig, preset_config
from xrds_core.superres.regression import explain

TINY = NetworkConfig(groups=1, blocks=1, channels=8, guide_channels=4, window_size=4)


@pytest.mark.parametrize("scale", [1, 2, 4, 8, 16])
def test_every_scale_and_odd_sizes(scale: int) -> None:
    network = XRDS(replace(TINY, scale=scale, cell=scale))
    out = network(torch.rand(2, 3, 5, 7), torch.rand(2, 6, 5 * scale, 7 * scale))
    assert out.shape == (2, 3, 5 * scale, 7 * scale)


@pytest.mark.parametrize("block", ["rdst", "rdb", "rstb"])
@pytest.mark.parametrize("cross_attention", [True, False])
def test_ablations_train_every_weight(block: str, cross_attention: bool) -> None:
    network = XRDS(replace(TINY, block=block, cross_attention=cross_attention))
    out = network(torch.rand(1, 3, 8, 8), torch.rand(1, 6, 32, 32))
    out.square().mean().backward()
    assert all(p.grad is not None for p in network.parameters())


def test_shifted_windows_do_not_wrap_around() -> None:
    network = XRDS(replace(TINY, scale=1, cell=1, cross_attention=False)).eval()
    radiance, guides = torch.rand(1, 3, 32, 32), torch.rand(1, 6, 32, 32)
    before = network(radiance, guides)
    radiance[..., -1:] += 1.0  # the right edge must not reach the left one
    after = network(radiance, guides)
    assert torch.equal(before[..., :4], after[..., :4])
    assert not torch.equal(before[..., -4:], after[..., -4:])


@pytest.mark.parametrize("preset", ["fast", "balanced"])
@pytest.mark.parametrize("scale", [1, 2, 4, 8])
def test_untrained_presets_are_what_the_guides_explain(preset: str, scale: int) -> None:
    torch.manual_seed(1)
    network = XRDS(preset_config(preset, scale)).eval()
    low = torch.rand(1, 3, 16, 16) + 0.5
    low = F.avg_pool2d(F.pad(low, (2, 2, 2, 2), mode="replicate"), 5, stride=1)
    guides = torch.rand(1, 6, 16 * scale, 16 * scale)
    with torch.inference_mode():
        out = torch.expm1(network(torch.log1p(low), guides))
        explained = explain(low, low, guides, scale).factor
        rest = low / F.avg_pool2d(explained, scale)
        base = F.interpolate(rest, scale_factor=scale, mode="bilinear") * explained
        relative = (out - base).abs().mean() / base.mean()
    assert relative < 0.1  # kernels keep all sources within reach: not exactly


@pytest.mark.parametrize("preset", ["fast", "balanced"])
def test_presets_keep_black_and_grey(preset: str) -> None:
    torch.manual_seed(2)
    network = XRDS(preset_config(preset, 2)).eval()
    for parameter in network.parameters():  # as far from the base as training can go
        torch.nn.init.normal_(parameter, std=0.2)
    stack = torch.rand(1, 6, 32, 32)
    black = network(torch.zeros(1, 3, 16, 16), stack)
    assert torch.equal(black, torch.zeros_like(black))
    grey_stack = stack[:, :1].expand_as(stack)
    grey = network(torch.rand(1, 1, 16, 16).expand(-1, 3, -1, -1), grey_stack)
    assert (grey.amax(1) - grey.amin(1)).max() < 1e-5
    assert grey.min() >= 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"scale": 3}, "scale is 3"),
        ({"cell": 2}, "cell 2"),
        ({"block": "resnet"}, "'resnet'"),
        ({"heads": 3}, "multiple of heads 3"),
    ],
)
def test_wrong_configurations_say_what_is_wrong(change: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        NetworkConfig(**change)


def test_wrong_guides_are_refused() -> None:
    with pytest.raises(ValueError, match="guides are"):
        XRDS(TINY)(torch.rand(1, 3, 8, 8), torch.rand(1, 6, 16, 16))


def test_configuration_round_trip() -> None:
    config = preset_config("fast", 2)
    assert NetworkConfig.from_dict(config.to_dict()) == config


@pytest.mark.parametrize("scale", [2, 4, 8])
def test_areas_are_of_no_matter_to_the_picture(scale: int) -> None:
    network = XRDS(preset_config("fast", scale)).eval()
    for parameter in network.tail.parameters():  # those of new weights are all zero
        torch.nn.init.normal_(parameter, std=0.05)
    size = 11 * network.config.cell
    radiance = torch.rand(1, 3, size // scale, size // scale)
    stack = torch.rand(1, 6, size, size)
    with torch.inference_mode():
        whole = network(radiance, stack)
        network.tail.area_side = 3
        parts = network(radiance, stack)
    torch.testing.assert_close(parts, whole, rtol=0.0, atol=2e-6)


@pytest.mark.parametrize("preset", ["fast", "paper"])
def test_strips_are_of_no_matter_to_the_picture(
    preset: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    torch.manual_seed(3)
    shape = replace(preset_config(preset, 2), groups=1, blocks=1)
    network = XRDS(shape).eval()
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter, std=0.1)
    radiance, guides = torch.rand(1, 3, 64, 64), torch.rand(1, 6, 128, 128)
    with torch.inference_mode():
        whole = network(radiance, guides)
        monkeypatch.setattr("xrds_core.superres.network.STRIP_CELLS", 1)
        parts = network(radiance, guides)
    assert (parts - whole).abs().max() < 1e-5 * whole.abs().max()
