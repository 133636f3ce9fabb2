"""What `xrds info` says of the networks, against the paper's printed figures."""

from __future__ import annotations

from pathlib import Path

import pytest

from xrds_core import info
from xrds_core.errors import WeightsError
from xrds_core.superres.network import PRESETS, NetworkConfig, preset_config
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


@pytest.mark.parametrize("scale", operations.SCALES)
def test_presets_cost_what_their_names_say(scale: int) -> None:
    costs = {
        name: operations.count(preset_config(name, scale), 512) for name in PRESETS
    }
    order = sorted(costs, key=lambda name: costs[name].macs)
    assert order == ["fast", "balanced", "paper"]


@pytest.mark.timeout(600)
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
        "torch": "2.0",
        "blender": None,
        "devices": ["cpu"],
        "accumulation": ["Radeon", "cpu"],
        "paper_table": [],
        "presets": {},
        "weights": [],
        "guide_filter": {"file": "own.safetensors", "sha256": "0123456789abcdef01"},
    }
    text = "\n".join(info.lines(told))
    assert "Blender not found" in text
    assert "weights: none" in text
    assert "accumulation: Radeon, cpu" in text
    assert "own.safetensors  sha256 0123456789abcdef" in text
