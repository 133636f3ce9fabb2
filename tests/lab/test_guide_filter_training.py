"""The filter's training: it learns of noisy pairs alone, stops and goes on exactly."""

from __future__ import annotations

import json
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from xrds_blender.command import main
from xrds_core.errors import Cancelled, PictureError, UsageError
from xrds_core.superres.weights import load_guide_filter
from xrds_lab.training import guide_filter as module
from xrds_lab.training.guide_filter import (
    Learner,
    error_left,
    read_pairs,
    train_guide_filter,
)

pytestmark = [pytest.mark.nightly, pytest.mark.usefixtures("one_thread")]

SIDE = 72


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Smooth albedo and normals, with the noise of one and of four samples."""
    folder = tmp_path_factory.mktemp("data")
    for seed in range(4):
        random = np.random.default_rng(seed)
        clean = np.tile(np.linspace(0.2, 0.7, SIDE)[:, None, None], (1, SIDE, 6))
        arrays = {
            name: (clean + random.normal(0, 0.1 / samples**0.5, clean.shape))
            for name, samples in (("guides_a", 1), ("guides_b", 4))
        }
        path = folder / ("validation" if seed == 3 else "train") / f"{seed}.npz"
        path.parent.mkdir(exist_ok=True)
        meta = json.dumps({"guide_spp": [1, 4], "blender_series": "4.5"})
        half = {name: x.astype(np.float16) for name, x in arrays.items()}
        np.savez_compressed(path, meta=meta, **half)
    return folder


def weights_of(path: Path) -> list[torch.Tensor]:
    return list(load_guide_filter(path.parent).state_dict().values())


def test_noise_falls_though_no_clean_guide_was_seen(data: Path, tmp_path: Path) -> None:
    out = tmp_path / "guide_filter.safetensors"
    result = train_guide_filter([data], out, steps=60)
    assert result["windows"] == {"train": 3, "validation": 1}
    untrained = Learner(1, 0, tmp_path / "none").network
    before = error_left(untrained, read_pairs([data], "validation"))
    for name, left in result["error_left"].items():
        assert left < 0.25 < before[name] < 1.0
    assert [p.name for p in tmp_path.iterdir()] == [out.name]


def test_a_run_that_was_stopped_ends_as_one_that_was_not(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "CROP", 16)
    (tmp_path / "one").mkdir()
    (tmp_path / "two").mkdir()
    whole, broken = (tmp_path / n / "guide_filter.safetensors" for n in ("one", "two"))
    train_guide_filter([data], whole, steps=8)
    learn_from = Learner.learn_from

    def interrupted(self: Learner, batch: Any) -> float:
        if self.step == 3:
            signal.raise_signal(signal.SIGINT)
        return learn_from(self, batch)

    with monkeypatch.context() as patch:
        patch.setattr(Learner, "learn_from", interrupted)
        with pytest.raises(Cancelled, match="step 4; the same command goes on"):
            train_guide_filter([data], broken, steps=8)
    assert not broken.exists()
    with pytest.raises(UsageError, match="is of seed 0"):
        train_guide_filter([data], broken, steps=8, seed=1)
    train_guide_filter([data], broken, steps=8)
    pairs = zip(weights_of(whole), weights_of(broken), strict=True)
    assert all(torch.equal(a, b) for a, b in pairs)
    assert not list(broken.parent.glob("*.pt"))


def test_faults_are_told_before_any_work(data: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot write"):
        train_guide_filter([data], tmp_path / "missing" / "f.safetensors")
    with pytest.raises(UsageError, match="no windows in the train folder"):
        train_guide_filter([tmp_path], tmp_path / "f.safetensors")
    (tmp_path / "train").mkdir()
    (tmp_path / "train" / "a.npz").write_bytes(b"nothing")
    with pytest.raises(PictureError, match=r"a\.npz"):
        train_guide_filter([tmp_path], tmp_path / "f.safetensors")


def test_the_command_tells_what_is_left(
    data: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(module, "CROP", 16)
    out = tmp_path / "guide_filter.safetensors"
    assert (
        main.main(["train-filter", str(data), "--out", str(out), "--steps", "2"]) == 0
    )
    assert "2 steps; squared error left: " in capsys.readouterr().out
    assert load_guide_filter(tmp_path).training is False
