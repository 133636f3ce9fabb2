"""Training configurations: one TOML file, changes to it, and wrong ones named."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import xrds_lab.training
from xrds_core.errors import UsageError
from xrds_core.superres.network import NetworkConfig, preset_config
from xrds_lab.training.config import TrainingConfig, read_config, to_toml
from xrds_lab.training.data import Variation

CONFIGS = sorted((Path(xrds_lab.training.__file__).parent / "configs").glob("*.toml"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("steps = ", "cannot read"),
        ("preset = 'fast'", "data"),
        ("data = '.'\nstpes = 3", "stpes"),
        ("data = '.'\n[loss]\nl3 = 1.0", "l3"),
        ("data = '.'\n[variation]\nnoise = 1.0", "noise"),
        ("data = '.'\ncrop = 33", "crop 33"),
        ("data = '.'\nworkers = 0", "workers is 0"),
        ("data = '.'\npreset = 'best'", "best"),
        ("data = '.'\n[network]\nwidth = 3", "width"),
        ("data = '.'\nscale = 3\ncrop = 33", "scale is 3"),
        ("data = '.'\nprecision = 'fp8'", "fp8"),
        ("data = 5", "data = 5 names no folders"),
        ("data = [5]", "names no folders"),
        ("data = ''", "names no folders"),
        ("data = '.'\nscale = 'x'", "scale = 'x' is not of type int"),
        ("data = '.'\nscale = 0", "scale is 0"),
        ("data = '.'\nsteps = -5", "steps is -5"),
        ("data = '.'\nbetas = 5", "not iterable"),
        ("data = '.'\nloss = 3", "loss = 3"),
        ("data = '.'\n[loss]\nl1 = 'a'", "no table of numbers"),
        ("data = '.'\nvariation = 1", "no table"),
        ("data = '.'\n[variation]\nnoisy = 'a'", "noisy = 'a'"),
        ("data = '.'\n[network]\ngroups = 'a'", "groups = 'a'"),
    ],
)
def test_wrong_configuration_is_named(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "run.toml"
    path.write_text(text)
    with pytest.raises(UsageError, match=message):
        read_config(path)


def test_paths_are_relative_to_the_file(tmp_path: Path) -> None:
    path = tmp_path / "run.toml"
    path.write_text("data = ['a', '../b']\nstart = 'w'\n[loss]\nl1 = 2.0\n")
    config = read_config(path)
    assert config.data == (str(tmp_path / "a"), str(tmp_path / "../b"))
    assert config.start == str(tmp_path / "w")
    assert config.loss == {"l1": 2.0}


def test_changes_come_in_the_place_of_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "run.toml").write_text(
        "data = 'a'\nscale = 4\n[variation]\nblack = 0.5\nnoisy = 0.5"
    )
    monkeypatch.chdir(tmp_path.parent)
    changes = ["scale = 8", "variation.black=0.0", "start = 'b'"]
    config = read_config(tmp_path / "run.toml", changes)
    assert (config.scale, config.start) == (8, str(tmp_path.parent / "b"))
    assert config.variation == Variation(noisy=0.5, black=0.0)
    with pytest.raises(UsageError, match="no line of TOML"):
        read_config(tmp_path / "run.toml", ["scale"])


def test_written_configuration_is_read_as_it_was(tmp_path: Path) -> None:
    config = TrainingConfig(
        data=(str(tmp_path / "a b"), str(tmp_path / 'q"\\')),
        network={"channels": 8, "base": False},
        learning_rate=1e-7,
        betas=(0.8, 0.9),
        variation=Variation(symmetries=True),
    )
    (tmp_path / "config.toml").write_text(to_toml(config))
    assert read_config(tmp_path / "config.toml") == config


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_shipped_recipes_are_whole(path: Path) -> None:
    config = read_config(path)
    assert config.network_config == preset_config(config.preset, config.scale)


def test_paper_recipe_is_the_papers() -> None:
    config = read_config(next(path for path in CONFIGS if path.stem == "paper"))
    assert config.network_config == NetworkConfig(scale=4)
    assert (config.loss, config.crop, config.batch) == ({"robust": 1.0}, 256, 16)
    rates = {config.learning_rate_at(step) for step in range(0, config.steps, 1000)}
    assert rates == {1e-4}


def test_learning_rate_rises_and_falls_along_a_cosine() -> None:
    config = TrainingConfig(data=(), steps=110, warmup=10, learning_rate=1.0)
    assert config.learning_rate_at(0) == pytest.approx(0.1)
    assert config.learning_rate_at(9) == config.learning_rate_at(10) == 1
    assert config.learning_rate_at(60) == pytest.approx(0.5, abs=1e-5)
    assert config.learning_rate_at(110) == pytest.approx(config.final_learning_rate)
    longer = replace(config, steps=210)
    assert longer.learning_rate_at(110) == pytest.approx(0.5, abs=1e-5)
