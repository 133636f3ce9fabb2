"""Training runs: they learn, stop when asked, and go on exactly where they were."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from PIL import Image

from xrds_core.errors import Cancelled, UsageError, WeightsError
from xrds_core.superres import weights
from xrds_lab.training.config import TrainingConfig, read_config, to_toml
from xrds_lab.training.data import Variation
from xrds_lab.training.interruption import Interruption
from xrds_lab.training.losses import LOSSES
from xrds_lab.training.train import Run, train
from xrds_lab.training.validation import Score, Validation, in_order, summary
from xrds_lab.training.windows import WindowSet

ROOT = Path(__file__).resolve().parents[2]


pytestmark = [pytest.mark.nightly, pytest.mark.usefixtures("one_thread")]


@pytest.fixture
def _undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Drawing takes longer than all else in a run of six tiny steps."""
    for name in ("write_curve", "write_samples"):
        monkeypatch.setattr(f"xrds_lab.training.train.{name}", lambda *_: None)


undrawn = pytest.mark.usefixtures("_undrawn")


def records(folder: Path) -> list[dict[str, Any]]:
    """The statistics but for the clock."""
    lines = [json.loads(line) for line in lines_of(folder)]
    for line in lines:
        line.pop("seconds_per_step")
    return lines


def lines_of(folder: Path) -> list[str]:
    stats = folder / "stats.jsonl"
    return stats.read_text().splitlines() if stats.exists() else []


def stop_at(run: Run, step: int) -> None:
    """Let Ctrl-C come while a run waits for the crops of a step."""
    batch = run.loader.batch

    def interrupted(at: int) -> Any:
        if at == step:
            signal.raise_signal(signal.SIGINT)
        return batch(at)

    run.loader.batch = interrupted


# --- what is learnt -------------------------------------------------------------------


@pytest.mark.parametrize("name", LOSSES)
def test_losses_are_zero_only_without_error(name: str) -> None:
    picture = torch.rand(1, 3, 8, 8)
    assert LOSSES[name](picture, picture).item() == pytest.approx(0, abs=1e-7)
    assert LOSSES[name](picture, picture.flip(-1)).item() > 0


def test_training_lowers_the_loss(config: TrainingConfig, tmp_path: Path) -> None:
    network = {**config.network, "base": False}  # knows nothing before it is trained
    config = replace(config, steps=60, warmup=5, variation=Variation(), network=network)
    run = Run(config, tmp_path / "run")
    for _ in range(60):
        run.train_step()
    assert np.mean(run.losses[-10:]) < 0.8 * np.mean(run.losses[:10])


def test_mixed_precision_keeps_weights_whole(
    config: TrainingConfig, tmp_path: Path
) -> None:
    config = replace(config, variation=Variation())
    losses = {}
    for precision in ("fp32", "bf16"):
        run = Run(replace(config, precision=precision), tmp_path / precision)
        for _ in range(6):
            run.train_step()
        losses[precision] = run.losses
        state = run.learner.network.state_dict().values()
        assert {x.dtype for x in state} == {torch.float32}
    assert losses["bf16"] != losses["fp32"]
    np.testing.assert_allclose(losses["bf16"], losses["fp32"], rtol=0.05)


def test_average_follows_and_is_what_is_validated(
    config: TrainingConfig, tmp_path: Path
) -> None:
    run = Run(replace(config, average=0.5), tmp_path / "run")
    learner = run.learner
    before = {k: v.clone() for k, v in learner.average.items()}
    run.train_step()
    learnt = {k: v.clone() for k, v in learner.network.state_dict().items()}
    decay = 1 / 11  # a young average follows closely
    for name, value in learnt.items():
        expected = decay * before[name] + (1 - decay) * value
        torch.testing.assert_close(learner.average[name], expected)
    with learner.averaged():
        own = learner.network.state_dict()
        assert all(torch.equal(own[k], v) for k, v in learner.average.items())
    own = learner.network.state_dict()
    assert all(torch.equal(own[k], v) for k, v in learnt.items())
    exact = Run(replace(config, average=0.0), tmp_path / "exact")
    exact.train_step()
    own = exact.learner.network.state_dict()
    assert all(torch.equal(own[k], v) for k, v in exact.learner.average.items())


@undrawn
def test_weights_start_another_scale(
    config: TrainingConfig, tmp_path: Path, write_window: Any
) -> None:
    train(config, tmp_path / "x2")
    for split in ("train", "validation"):
        write_window(tmp_path / "data4" / split / "0.npz", 9, scale=4)
    source = tmp_path / "x2" / "weights.safetensors"
    data = (str(tmp_path / "data4"),)
    other = Run(replace(config, data=data, scale=4, start=str(source)), tmp_path / "x4")
    ours = other.learner.network.state_dict()
    theirs = weights.load(source)[0].state_dict()
    assert torch.equal(ours["fuse.weight"], theirs["fuse.weight"])
    assert (
        ours["radiance_head.1.weight"].shape != theirs["radiance_head.1.weight"].shape
    )


def test_divergence_is_said_and_not_kept(
    config: TrainingConfig, tmp_path: Path
) -> None:
    run = Run(config, tmp_path / "run")
    with torch.no_grad():
        next(run.learner.network.parameters()).fill_(torch.inf)
    with pytest.raises(WeightsError, match=r"step 0 .* lower learning_rate"):
        run.train_step()


# --- what is written ------------------------------------------------------------------


def test_run_writes_its_folder(config: TrainingConfig, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    result = train(config, folder)
    assert {path.name for path in folder.iterdir()} == {
        "config.toml",
        "windows.json",
        "stats.jsonl",
        "curve.png",
        "samples.png",
        "checkpoint.pt",
        "weights.safetensors",
    }
    assert read_config(folder / "config.toml") == config
    lines = records(folder)
    assert [line["step"] for line in lines] == [0, 3, 6]
    assert lines[0]["loss"] is None
    assert result["gain"] == lines[-1]["gain"]
    assert result["best"]["gain"] == max(line["gain"] for line in lines)
    with Image.open(folder / "samples.png") as samples:
        assert samples.size == (5 * 256, 2 * (256 + 24))  # one window, both sets
    with Image.open(folder / "curve.png") as curve:
        assert len(curve.getcolors(1 << 20)) > 100
    network, record = weights.load(folder / "weights.safetensors")
    assert network.config.scale == 2
    assert record["blender_series"] == "4.5"
    training = json.loads(record["training"])
    assert training["step"] == result["best"]["step"]
    assert training["windows"] == {"train": 3, "validation": 1}
    assert training["config"]["variation"]["symmetries"]


@undrawn
def test_folder_of_another_run_is_refused(
    config: TrainingConfig, tmp_path: Path
) -> None:
    folder = tmp_path / "run"
    train(config, folder)
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    with pytest.raises(UsageError, match=r"learning_rate = 0\.0005, not 0\.1"):
        train(replace(config, learning_rate=0.1), folder)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


@undrawn
def test_finished_run_is_left_alone_and_can_be_made_longer(
    config: TrainingConfig, tmp_path: Path
) -> None:
    folder = tmp_path / "run"
    result = train(config, folder)
    assert train(config, folder) == result
    longer = train(replace(config, steps=8), folder)
    assert longer["step"] == 8
    assert [line["step"] for line in records(folder)] == [0, 3, 6, 8]


def test_run_keeps_its_windows(
    config: TrainingConfig, tmp_path: Path, write_window: Any
) -> None:
    before = Run(config, tmp_path / "run").windows["train"].paths
    write_window(Path(config.data[0]) / "train" / "9.npz", 9)
    assert Run(config, tmp_path / "run").windows["train"].paths == before


def test_run_that_cannot_begin_writes_nothing(
    config: TrainingConfig, tmp_path: Path
) -> None:
    with pytest.raises(UsageError, match="no windows in the train folder"):
        Run(replace(config, data=(str(tmp_path),)), tmp_path / "run")
    with pytest.raises(WeightsError, match="no weights file"):
        Run(replace(config, start=str(tmp_path / "w")), tmp_path / "run")
    assert not (tmp_path / "run").exists()


# --- stopping and going on ------------------------------------------------------------


def assert_same_run(folder: Path, other: Path) -> None:
    assert records(folder) == records(other)
    ours, theirs = (
        torch.load(path / "checkpoint.pt", weights_only=True)
        for path in (folder, other)
    )
    for part in ("network", "average"):
        for name, value in theirs[part].items():
            assert torch.equal(ours[part][name], value), name
    first, second = (
        weights.load(path / "weights.safetensors") for path in (folder, other)
    )
    assert first[1] == second[1]
    for name, value in second[0].state_dict().items():
        assert torch.equal(first[0].state_dict()[name], value), name


@undrawn
def test_run_stopped_at_any_step_goes_on_as_if_unbroken(
    config: TrainingConfig, tmp_path: Path
) -> None:
    train(config, tmp_path / "unbroken")
    handler = signal.getsignal(signal.SIGINT)
    for step in (0, 1, 2, 4, 5):  # one after the other, in the same folder
        run = Run(config, tmp_path / "broken")
        stop_at(run, step)
        with pytest.raises(Cancelled, match=f"step {step + 1}; the same command"):
            run.go()
        assert signal.getsignal(signal.SIGINT) is handler
    train(config, tmp_path / "broken")
    assert_same_run(tmp_path / "broken", tmp_path / "unbroken")


@undrawn
@pytest.mark.parametrize("step", [0, 3])
def test_run_killed_while_it_validates_goes_on_as_if_unbroken(
    config: TrainingConfig, tmp_path: Path, step: int
) -> None:
    train(config, tmp_path / "unbroken")
    for when in ("score", "samples"):
        run = Run(config, tmp_path / "broken")
        before = getattr(run.validation, when)

        def killed(*given: Any, run: Run = run, before: Any = before) -> Any:
            if run.step == step:
                raise KeyboardInterrupt
            return before(*given)

        setattr(run.validation, when, killed)
        with pytest.raises(KeyboardInterrupt):
            run.go()
    train(config, tmp_path / "broken")
    assert_same_run(tmp_path / "broken", tmp_path / "unbroken")


@undrawn
def test_statistics_beyond_the_checkpoint_are_written_anew(
    config: TrainingConfig, tmp_path: Path
) -> None:
    train(config, tmp_path / "unbroken")
    run = Run(replace(config), tmp_path / "broken")
    saved = run.folder.save

    def killed(state: dict[str, Any]) -> None:
        if state["validated"] == 3:
            raise KeyboardInterrupt
        saved(state)

    run.folder.save = killed
    with pytest.raises(KeyboardInterrupt):
        run.go()
    assert records(tmp_path / "broken")[-1]["step"] == 3
    train(config, tmp_path / "broken")
    assert_same_run(tmp_path / "broken", tmp_path / "unbroken")


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT to send")
def test_command_stops_on_ctrl_c_and_keeps_its_steps(
    config: TrainingConfig, tmp_path: Path
) -> None:
    (tmp_path / "run.toml").write_text(to_toml(replace(config, steps=10_000)))
    command = ["-c", "from xrds_blender.command.main import program; program()"]
    with subprocess.Popen(
        [sys.executable, *command, "train", "run.toml"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"},
        stderr=subprocess.PIPE,
        text=True,
    ) as child:
        folder = tmp_path / "runs" / "run"
        while child.poll() is None and len(lines_of(folder)) < 2:
            time.sleep(0.1)
        child.send_signal(signal.SIGINT)
        _, errors = child.communicate()
    assert child.returncode == 130
    assert errors.endswith("xrds: interrupted\n")
    state = torch.load(folder / "checkpoint.pt", weights_only=True)
    assert state["step"] >= 3
    assert "the same command goes on" in errors


@pytest.fixture
def _ctrl_c() -> Iterator[None]:
    """Ctrl-C raises, also where a shell started the tests in the background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("_ctrl_c")
def test_later_signal_acts_as_before(monkeypatch: pytest.MonkeyPatch) -> None:
    with Interruption() as stop:
        signal.raise_signal(signal.SIGINT)
        assert stop.wished
        signal.raise_signal(signal.SIGINT)  # the same wish, handed on
        monkeypatch.setattr("xrds_lab.training.interruption.SAME_WISH", 0.0)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


@undrawn
@pytest.mark.skipif(os.name == "nt", reason="gloo over localhost is tested on POSIX")
def test_two_processes_learn_what_one_does(
    config: TrainingConfig, tmp_path: Path
) -> None:
    config = replace(config, batch=4, precision="fp32", learning_rate=1e-2)
    train(config, tmp_path / "one")
    (tmp_path / "run.toml").write_text(to_toml(config))
    launcher = ["torch.distributed.run", "--standalone", "--nproc-per-node", "2"]
    command = ["-m", "xrds_blender.command.main", "train", "run.toml", "--out", "two"]
    subprocess.run(
        [sys.executable, "-m", *launcher, *command],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"},
        check=True,
    )
    ours, theirs = records(tmp_path / "two"), records(tmp_path / "one")
    assert [line["step"] for line in ours] == [line["step"] for line in theirs]
    for line, expected in zip(ours[1:], theirs[1:], strict=True):
        assert line["loss"] == pytest.approx(expected["loss"], rel=1e-5)
        assert line["gain"] == pytest.approx(expected["gain"], abs=1e-3)


def test_batch_that_processes_cannot_share_is_said() -> None:
    from xrds_lab.training.processes import Processes

    second = Processes(1, 2, torch.device("cpu"))
    assert list(second.places(6)) == [1, 3, 5]
    with pytest.raises(UsageError, match="batch 5 cannot be shared by 2"):
        second.places(5)


# --- validation -----------------------------------------------------------------------


def test_validation_knows_where_demodulation_is_exact(config: TrainingConfig) -> None:
    paths = sorted((Path(config.data[0]) / "train").glob("*.npz"))
    windows = WindowSet(paths, 2, memory=0)
    validation = Validation(windows, 2, 2)

    def scores() -> list[Score]:
        places = reversed(validation.places)
        return in_order(validation.score(lambda b: b.reference, *p) for p in places)

    first = scores()
    assert [(s.set_name, s.index) for s in first] == validation.places
    for score in first:
        assert score.psnr["xrds"] == np.inf
        assert score.psnr["demodulated"] > score.psnr["bicubic"] + 10
    assert scores() == first  # the same renders, the same light


def test_gain_is_over_the_better_enlargement_of_each_window() -> None:
    def score(name: str, index: int, *psnr: float) -> Score:
        methods = ("xrds", "bicubic", "demodulated")
        return Score(name, index, dict(zip(methods, psnr, strict=True)))

    result = summary(
        [
            score("rendered", 0, 30.0, 29.0, 10.0),
            score("rendered", 1, 31.0, 20.0, 33.0),
            score("shaded", 0, 40.0, 30.0, 43.0),
            score("shaded", 1, 41.0, 30.0, 42.0),
        ]
    )
    assert result["gain"] == pytest.approx((1 - 2 - 3 - 1) / 4)
    assert result["gains"] == {"rendered": -0.5, "shaded": -2.0}
    assert result["worst"] == {"rendered": -2.0, "shaded": -3.0}
    assert result["psnr"]["rendered"]["demodulated"] == 21.5
