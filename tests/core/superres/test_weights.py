from __future__ import annotations

import json
import pickle
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors import safe_open
from safetensors.torch import save_file

from xrds_core.errors import WeightsError
from xrds_core.superres import weights
from xrds_core.superres.network import XRDS, NetworkConfig
from xrds_core.superres.weights_header import available
from xrds_lab.weights import save_network

CONFIG = NetworkConfig(
    scale=2,
    groups=1,
    blocks=1,
    channels=4,
    guide_channels=4,
    window_size=2,
    dense_layers=1,
    tail_channels=2,
    base=True,
)
RECORD = {"preset": "fast", "blender_series": "4.5"}


@pytest.fixture
def network() -> XRDS:
    torch.manual_seed(1)
    return XRDS(CONFIG)


@pytest.fixture
def path(network: XRDS, tmp_path: Path) -> Path:
    file = tmp_path / "fast_x2.safetensors"
    save_network(network, file, RECORD)
    return file


def test_saved_weights_come_back_to_eight_bits(network: XRDS, path: Path) -> None:
    loaded, metadata = weights.load(path)
    assert loaded.config == CONFIG
    assert metadata.items() >= RECORD.items()
    for name, value in network.state_dict().items():
        back = loaded.state_dict()[name]
        if value.dim() < 2:
            assert torch.equal(back, value.half().float())
            continue
        rows, errors = value.flatten(1), (back - value).flatten(1)
        most = rows.abs().amax(1)
        assert (errors.abs().amax(1) <= 0.505 * most / 127 + most * 2**-10).all()
    assert not any(p.requires_grad for p in loaded.parameters())


def test_packing_again_changes_nothing(path: Path, tmp_path: Path) -> None:
    network, _ = weights.load(path)
    with torch.no_grad():
        network.fuse.weight[0] = 0  # a channel without any weight
    save_network(network, tmp_path / "again.safetensors", RECORD)
    again, _ = weights.load(tmp_path / "again.safetensors")
    for name, value in network.state_dict().items():
        torch.testing.assert_close(again.state_dict()[name], value, rtol=1e-3, atol=0)


def test_halves_are_read_as_they_are(network: XRDS, path: Path) -> None:
    halves = {name: value.half() for name, value in network.state_dict().items()}
    with safe_open(path, framework="pt") as file:
        record = file.metadata()
    save_file(halves, path, record)
    loaded, _ = weights.load(path)
    for name, value in halves.items():
        assert torch.equal(loaded.state_dict()[name], value.float())


@pytest.mark.parametrize("factors", [None, torch.ones(1)])
def test_eight_bits_without_their_factors(
    path: Path, factors: torch.Tensor | None
) -> None:
    with safe_open(path, framework="pt") as file:
        record = file.metadata()
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    del tensors["fuse.weight.factors"]
    if factors is not None:
        tensors["fuse.weight.factors"] = factors
    save_file(tensors, path, record)
    with pytest.raises(WeightsError, match=r"fuse\.weight lacks its factors"):
        weights.load(path)


def test_saving_leaves_one_file_that_others_may_read(path: Path) -> None:
    assert list(path.parent.iterdir()) == [path]
    assert path.stat().st_mode & 0o044 == Path(__file__).stat().st_mode & 0o044


def test_diverged_weights_are_not_saved(network: XRDS, tmp_path: Path) -> None:
    with torch.no_grad():
        network.fuse.bias[0] = 1e6
    with pytest.raises(WeightsError, match=r"fuse\.bias"):
        save_network(network, tmp_path / "x.safetensors", {})
    assert not list(tmp_path.iterdir())


def test_every_truncation_is_a_weights_error(path: Path) -> None:
    whole = path.read_bytes()
    for percent in range(100):
        path.write_bytes(whole[: len(whole) * percent // 100])
        with pytest.raises(WeightsError, match="fast_x2"):
            weights.load(path)


@pytest.mark.parametrize("seed", range(20))
def test_random_bytes_are_a_weights_error(path: Path, seed: int) -> None:
    path.write_bytes(np.random.default_rng(seed).bytes(900))
    with pytest.raises(WeightsError, match="fast_x2"):
        weights.load(path)


def test_a_pickle_is_never_run(path: Path, tmp_path: Path) -> None:
    class Attack:
        def __reduce__(self) -> tuple[object, ...]:
            return Path.touch, (tmp_path / "owned",)

    path.write_bytes(pickle.dumps(Attack()))
    with pytest.raises(WeightsError, match="safetensors"):
        weights.load(path)
    assert not (tmp_path / "owned").exists()


def rewrite(path: Path, config: object, **tensors: torch.Tensor | None) -> None:
    """Write the file anew with another configuration or other tensors."""
    state = {**weights.load(path)[0].state_dict(), **tensors}
    kept = {name: x for name, x in state.items() if x is not None}
    save_file(kept, path, {"config": json.dumps(config)})


@pytest.mark.parametrize(
    ("tensors", "message"),
    [
        ({"fuse.bias": None}, r"lacks the tensor fuse\.bias"),
        ({"fuse.bias": torch.zeros(5)}, r"fuse\.bias .* has shape \(5,\)"),
        ({"foreign": torch.zeros(5)}, "unexpected tensor foreign"),
        ({"fuse.bias": torch.full((4,), torch.nan)}, r"fuse\.bias"),
        ({"fuse.bias": torch.zeros(4, dtype=torch.int32)}, r"fuse\.bias"),
    ],
)
def test_tensors_that_do_not_fit_the_configuration(
    path: Path, tensors: dict[str, torch.Tensor | None], message: str
) -> None:
    rewrite(path, CONFIG.to_dict(), **tensors)
    with pytest.raises(WeightsError, match=message):
        weights.load(path)


@pytest.mark.parametrize(
    "change",
    [
        {"groups": 2},
        {"groups": 4000, "blocks": 4000, "dense_layers": 0},
        {"channels": 10**9},
        {"channels": 0},
        {"heads": 0},
        {"scale": 3},
        {"window_size": 4096},
        {"future": 1},
        {"channels": "many"},
        {"channels": None},
    ],
)
def test_configurations_that_the_file_cannot_be_of(
    path: Path, change: dict[str, object]
) -> None:
    rewrite(path, {**CONFIG.to_dict(), **change})
    with pytest.raises(WeightsError, match="fast_x2"):
        weights.load(path)


def test_other_guides_are_told_by_name(path: Path) -> None:
    rewrite(path, {**CONFIG.to_dict(), "guides": "fast"})
    assert weights.load(path)[0].config == CONFIG
    rewrite(path, {**CONFIG.to_dict(), "guides": "full"})
    with pytest.raises(WeightsError, match=r"fast_x2.* does not render \('full'\)"):
        weights.load(path)


@pytest.mark.parametrize("config", [None, [], "{", 7])
def test_a_configuration_that_is_no_table(path: Path, config: object) -> None:
    rewrite(path, config)
    with pytest.raises(WeightsError, match="a network that this version does not"):
        weights.load(path)


def test_a_file_of_another_program(path: Path) -> None:
    save_file({"x": torch.zeros(3)}, path)
    with pytest.raises(WeightsError, match="no config"):
        weights.load(path)


def test_presets_are_found_by_name(path: Path) -> None:
    loaded, _ = weights.load_preset("fast", 2, directory=path.parent)
    assert loaded.config == CONFIG
    with pytest.raises(WeightsError, match="it holds: fast_x2"):
        weights.load_preset("balanced", 4, directory=path.parent)


def test_a_preset_under_a_false_name(path: Path) -> None:
    wrong = path.rename(path.with_name("fast_x4.safetensors"))
    with pytest.raises(WeightsError, match="is for scale 2"):
        weights.load_preset("fast", 4, directory=wrong.parent)


def test_what_is_available_is_told(path: Path) -> None:
    for other in ("notes_x2", "fast_full_x2"):
        (path.parent / f"{other}.safetensors").write_text("not ours")
    (record,) = available(path.parent)
    assert record == {
        "preset": "fast",
        "scale": 2,
        "file": "fast_x2.safetensors",
        "sha256": record["sha256"],
        "blender_series": "4.5",
    }
    assert len(record["sha256"]) == 64


def test_file_names() -> None:
    assert weights.file_name("fast", 4) == "fast_x4.safetensors"
