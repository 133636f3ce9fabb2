"""Training: crops stay aligned, normals turn with the picture, runs resume exactly."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from xrds_core import weights
from xrds_core.errors import PictureError, UsageError
from xrds_core.training.config import TrainingConfig, read_config
from xrds_core.training.data import (
    Crop,
    Variation,
    draw,
    random_rotation,
    transpose_and_flip,
)
from xrds_core.training.losses import LOSSES
from xrds_core.training.train import CHECKPOINT, Trainer, train
from xrds_core.training.validation import Scores, validate
from xrds_core.training.windows import WindowSet, read_window

SIZE = 32
TINY = {"channels": 8, "guide_channels": 8, "window_size": 4, "tail_channels": 4}
FULL_VARIATION = Variation(
    noisy=0.3,
    exposure_stops=1,
    tint_stops=0.5,
    rotated_normals=0.2,
    black=0.1,
    shaded=0.3,
    symmetries=True,
)


def write_window(path: Path, seed: int, scale: int = 2) -> None:
    """A window whose reference is its albedo under one light: exactly demodulable."""
    random = np.random.default_rng(seed)
    albedo = random.uniform(0.1, 1, (SIZE, SIZE, 3))
    normal = random.uniform(-1, 1, (SIZE, SIZE, 3))
    reference = 2 * albedo
    half = SIZE // scale
    low = reference.reshape(half, scale, half, scale, 3).mean((1, 3))
    guides = np.concatenate((albedo, normal), axis=-1)
    arrays = {"reference": reference, "guides_a": guides, "guides_b": guides}
    arrays |= {"guide_radiance_a": reference, "guide_radiance_b": reference}
    for i in (0, 1):
        arrays |= {f"low{scale}_{i}": low, f"low{scale}_{i}_noisy": low}
    meta = {"guide_spp": [1, 4], "blender_series": "4.5"}
    path.parent.mkdir(parents=True, exist_ok=True)
    half_floats = {k: v.astype(np.float16) for k, v in arrays.items()}
    np.savez_compressed(path, meta=json.dumps(meta), **half_floats)


@pytest.fixture
def config(tmp_path: Path) -> TrainingConfig:
    for seed in range(4):
        split = "validation" if seed == 3 else "train"
        write_window(tmp_path / "data" / split / f"{seed}.npz", seed)
    return TrainingConfig(
        data=(str(tmp_path / "data"),),
        network=TINY,
        steps=6,
        batch=2,
        crop=16,
        validate_every=3,
        variation=FULL_VARIATION,
    )


@pytest.mark.parametrize("guides", ["fast", "full"])
def test_crops_stay_aligned(config: TrainingConfig, guides: str) -> None:
    window = read_window(Path(config.data[0]) / "train" / "0.npz", 2, guides)
    for seed in range(20):
        random = np.random.default_rng(seed)
        variation = replace(FULL_VARIATION, black=0.0, shaded=0.0)
        batch = draw(window, 2, guides, variation, random, 16)
        assert batch.guides.shape == (1, 9 if guides == "full" else 6, 16, 16)
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
        whole = Crop(marked, marked, marked, dome, None, 1.0)
        turned = transpose_and_flip(whole, random)
        np.testing.assert_allclose(turned.normal, dome, atol=1e-6)
        seen.add(turned.low.tobytes())
    assert len(seen) == 8


def test_shaded_crops_are_albedo_under_smooth_light(config: TrainingConfig) -> None:
    window = read_window(Path(config.data[0]) / "train" / "0.npz", 2, "fast")
    random = np.random.default_rng(1)
    batch = draw(window, 2, "fast", Variation(shaded=1.0), random)
    reference, low = torch.expm1(batch.reference), torch.expm1(batch.radiance)
    means = torch.nn.functional.avg_pool2d(reference, 2)
    torch.testing.assert_close(means, low, rtol=1e-3, atol=1e-4)
    light = reference / batch.guides[:, :3]
    steps = light.diff(dim=-1).abs().mean() / light.mean()
    texture = reference.diff(dim=-1).abs().mean() / reference.mean()
    assert steps < 0.5 * texture
    assert light.std() / light.mean() > 0.1


def test_rotations_are_rotations() -> None:
    rotation = random_rotation(np.random.default_rng(3))
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-6)
    assert np.linalg.det(rotation) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("name", LOSSES)
def test_losses_are_zero_only_without_error(name: str) -> None:
    picture = torch.rand(1, 3, 8, 8)
    assert LOSSES[name](picture, picture).item() == pytest.approx(0, abs=1e-7)
    assert LOSSES[name](picture, picture.flip(-1)).item() > 0


def test_resumed_run_equals_an_unbroken_one(
    config: TrainingConfig, tmp_path: Path
) -> None:
    unbroken = Trainer(config, tmp_path / "unbroken")
    losses = [unbroken.train_step() for _ in range(6)]

    first = Trainer(config, tmp_path / "broken")
    for _ in range(3):
        first.train_step()
    first.save_checkpoint()
    second = Trainer(config, tmp_path / "broken")
    second.resume()
    assert second.step == 3
    assert [second.train_step() for _ in range(3)] == losses[3:]


def test_run_writes_weights_that_load(config: TrainingConfig, tmp_path: Path) -> None:
    result = train(config, tmp_path / "run")
    assert result["step"] == 6
    assert (tmp_path / "run" / CHECKPOINT).exists()
    lines = (tmp_path / "run" / "stats.jsonl").read_text().splitlines()
    assert [json.loads(line)["step"] for line in lines] == [3, 6]
    network, record = weights.load(tmp_path / "run" / "weights.safetensors")
    assert network.config.scale == 2
    assert record["blender_series"] == "4.5"
    assert json.loads(record["training"])["config"]["variation"]["symmetries"]


def test_training_lowers_the_loss(config: TrainingConfig, tmp_path: Path) -> None:
    network = {**TINY, "base": False}  # which knows nothing before it is trained
    config = replace(config, steps=60, warmup=5, variation=Variation(), network=network)
    trainer = Trainer(config, tmp_path / "run")
    losses = [trainer.train_step() for _ in range(60)]
    assert np.mean(losses[-10:]) < 0.8 * np.mean(losses[:10])


def test_weights_start_another_scale(config: TrainingConfig, tmp_path: Path) -> None:
    train(config, tmp_path / "x2")
    write_window(tmp_path / "data4" / "train" / "0.npz", 9, scale=4)
    write_window(tmp_path / "data4" / "validation" / "1.npz", 8, scale=4)
    source = tmp_path / "x2" / "weights.safetensors"
    data = (str(tmp_path / "data4"),)
    other = Trainer(
        replace(config, data=data, scale=4, start=str(source)), tmp_path / "x4"
    )
    ours, theirs = other.network.state_dict(), weights.load(source)[0].state_dict()
    assert torch.equal(ours["fuse.weight"], theirs["fuse.weight"])
    assert (
        ours["radiance_head.1.weight"].shape != theirs["radiance_head.1.weight"].shape
    )


def test_folders_are_read_together_and_windows_without_the_scale_left_out(
    config: TrainingConfig, tmp_path: Path
) -> None:
    for split in ("train", "validation"):
        write_window(tmp_path / "more" / split / "0.npz", 7)
        write_window(tmp_path / "more" / split / "1.npz", 7, scale=4)
    data = (*config.data, str(tmp_path / "more"))
    first = Trainer(replace(config, data=data), tmp_path / "run").windows
    assert [path.stem for path in first["train"].paths] == ["0", "1", "2", "0"]
    assert first["train"].paths[-1].is_relative_to(tmp_path / "more")
    write_window(tmp_path / "more" / "train" / "9.npz", 9)
    again = Trainer(replace(config, data=data), tmp_path / "run").windows
    assert again["train"].paths == first["train"].paths  # a run keeps its windows


def test_windows_beyond_the_memory_are_read_again(config: TrainingConfig) -> None:
    paths = sorted((Path(config.data[0]) / "train").glob("*.npz"))
    size = read_window(paths[0], 2, "fast", noisy=False).size
    windows = WindowSet(paths, 2, "fast", noisy=False, memory=2.5 * size)
    kept = [windows[i] is windows[i] for i in range(len(paths))]
    assert kept == [True, True, False]
    again = windows[2]
    np.testing.assert_array_equal(
        again.array("reference"), windows[2].array("reference")
    )


def test_validation_knows_where_demodulation_is_exact(config: TrainingConfig) -> None:
    paths = sorted((Path(config.data[0]) / "train").glob("*.npz"))
    windows = WindowSet(paths, 2, "fast", noisy=False, memory=0)
    scores = validate(lambda batch: batch.reference, windows, 2, 2, "fast")
    for name, means in scores.means().items():
        assert means["xrds"] == np.inf
        assert means["demodulated"] > means["bicubic"] + 10, name
    again = validate(lambda batch: batch.reference, windows, 2, 2, "fast")
    assert again.psnr == scores.psnr  # the same crops, the same light


def test_gain_is_over_the_better_enlargement_of_each_window() -> None:
    rows = {"xrds": [30.0, 31.0], "bicubic": [29.0, 20.0], "demodulated": [10.0, 33.0]}
    shaded = {
        "xrds": [40.0, 40.0],
        "bicubic": [30.0, 30.0],
        "demodulated": [43.0, 43.0],
    }
    scores = Scores({"rendered": rows, "shaded": shaded})
    assert scores.gain() == pytest.approx((1 - 2 - 3 - 3) / 4)


def test_damaged_window_is_named(config: TrainingConfig) -> None:
    path = Path(config.data[0]) / "train" / "0.npz"
    path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(PictureError, match=r"0\.npz"):
        read_window(path, 2, "fast")


def test_missing_scale_is_named(config: TrainingConfig) -> None:
    with pytest.raises(PictureError, match="scale 4"):
        read_window(Path(config.data[0]) / "train" / "0.npz", 4, "fast")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("steps = ", "cannot read"),
        ("preset = 'fast'", "data"),
        ("data = '.'\nstpes = 3", "stpes"),
        ("data = '.'\n[loss]\nl3 = 1.0", "l3"),
        ("data = '.'\n[variation]\nnoise = 1.0", "noise"),
        ("data = '.'\ncrop = 33", "crop 33"),
    ],
)
def test_wrong_configuration_is_named(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "run.toml"
    path.write_text(text)
    with pytest.raises(UsageError, match=message):
        read_config(path)


def test_configuration_paths_are_relative_to_the_file(tmp_path: Path) -> None:
    path = tmp_path / "run.toml"
    path.write_text("data = 'windows'\nscale = 4\n[loss]\nl1 = 2.0\n")
    config = read_config(path)
    assert config.data == (str(tmp_path / "windows"),)
    assert config.loss == {"l1": 2.0}


def test_no_windows_is_said(config: TrainingConfig, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no windows"):
        Trainer(replace(config, data=(str(tmp_path),)), tmp_path / "run")
