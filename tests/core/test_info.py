"""What `xrds info` says of the networks, against the paper's printed figures."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

from xrds_core import info
from xrds_core.denoising import oidn_device
from xrds_core.errors import UsageError, WeightsError
from xrds_core.superres import weights_header
from xrds_core.superres.devices import choose_device, device_name
from xrds_core.superres.network import PRESETS, NetworkConfig, preset_config
from xrds_core.superres.weights_header import DIRECTORY
from xrds_lab import operations

# (RDST per XDG, XDG): parameters (M), MACs (G), FLOPs (T) as the paper prints them.
PRINTED = {
    (5, 3): ("9.36", "723.68", "1.45"),
    (3, 3): ("6.21", "519.13", "1.04"),
    (1, 3): ("3.06", "314.59", "0.63"),
    (5, 2): ("6.42", "507.86", "1.02"),
    (5, 1): ("3.49", "292.04", "0.59"),
}


def test_paper_table_is_the_papers() -> None:
    told = {
        (row["rdst"], row["xdg"]): (
            f"{row['parameters'] / 1e6:.2f}",
            f"{row['macs'] / 1e9:.2f}",
            f"{row['flops'] / 1e12:.2f}",
        )
        for row in info.shipped_costs()["paper_table"]
    }
    assert told == PRINTED


@pytest.mark.nightly
def test_attention_products_are_counted_beside() -> None:
    cost = operations.count(NetworkConfig())
    # 66 layers, each 2 products of 64 tokens x 64 channels for 256 x 256 tokens
    assert cost.macs_with_attention - cost.macs == 66 * 2 * 64 * 64 * 256 * 256


def test_counts_grow_with_the_picture_alone() -> None:
    small, large = (
        operations.count(NetworkConfig(blocks=1), size) for size in (256, 512)
    )
    assert large.parameters == small.parameters
    assert large.macs == 4 * small.macs


@pytest.mark.nightly
@pytest.mark.parametrize("scale", operations.SCALES)
def test_presets_cost_what_their_names_say(scale: int) -> None:
    costs = {
        name: operations.count(preset_config(name, scale), 512) for name in PRESETS
    }
    order = sorted(costs, key=lambda name: costs[name].macs)
    assert order == ["fast", "balanced", "paper"]


@pytest.mark.nightly
def test_what_is_shipped_is_what_is_counted() -> None:
    assert info.shipped_costs() == operations.costs(), "call write_costs()"


def test_what_has_no_weights_counts_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    config = preset_config("fast", 4)
    left_out = operations.count(config, 64)
    operations.count.cache_clear()
    monkeypatch.setattr(operations, "_leave_out_the_weightless", lambda _: None)
    assert operations.count(config, 64) == left_out


def test_a_folder_that_is_not_there_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for name in ("none", "file"):
        with pytest.raises(WeightsError, match=name):
            info.info(weights=tmp_path / name)


def test_lines_show_missing_blender_and_weights() -> None:
    told = {
        "version": "1.2",
        "blender": None,
        "torch": "2.0",
        "torch_error": None,
        "devices": ["cpu", "metal"],
        "denoiser": ["metal", "cpu"],
        "paper_table": [],
        "presets": {},
        "weights": [],
    }
    text = "\n".join(info.lines(told))
    assert "Blender not found" in text
    assert "weights: none" in text
    assert "denoiser: metal, cpu" in text
    assert "network: torch 2.0 on cpu, metal" in text


def test_a_torch_that_cannot_be_loaded_is_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(
        info, "network_devices", lambda: (_ for _ in ()).throw(OSError("no\nlibrary"))
    )
    told = info.info()
    assert (told["torch"], told["devices"]) == (None, [])
    assert told["denoiser"][-1] == "cpu"
    assert {each["preset"] for each in told["weights"]} == set(PRESETS)
    text = "\n".join(info.lines(told))
    assert "network: none (no library); pip install xrds[network] brings it" in text


def test_an_apple_chip_has_one_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.backends.mps, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 0)
    assert info.network_devices() == ["cpu", "metal"]
    assert device_name(choose_device("auto")) == "metal"
    assert "metal" in oidn_device.DEVICES
    with pytest.raises(UsageError, match="use metal"):
        choose_device("mps")


def test_a_weights_file_that_is_cut_short_is_an_error(tmp_path: Path) -> None:
    whole = (DIRECTORY / "fast_x2.safetensors").read_bytes()
    (tmp_path / "fast_x2.safetensors").write_bytes(whole[:-1])
    with pytest.raises(WeightsError, match=r"fast_x2.safetensors is not a complete"):
        info.info(weights=tmp_path)


def test_names_of_networks_are_those_of_their_classes() -> None:
    assert set(weights_header.PRESETS) == set(PRESETS)
