"""Code that files of the laboratory hold is never run, whoever wrote them."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
import torch
from hostile import Trigger

from xrds_core.errors import WeightsError
from xrds_lab.studio import datasheet
from xrds_lab.training.run_folder import RunFolder
from xrds_lab.training.windows import read_arrays


def load_run(folder: Path) -> None:
    RunFolder(folder).load(torch.device("cpu"))


def test_a_checkpoint_runs_no_code(tmp_path: Path) -> None:
    mark = tmp_path / "it ran"
    torch.save({"step": Trigger(mark), "seed": 0}, tmp_path / "checkpoint.pt")
    with pytest.raises(WeightsError, match=r"checkpoint\.pt is damaged"):
        load_run(tmp_path)
    assert not mark.exists()


def damage(data: bytes) -> list[bytes]:
    """A file that is empty, cut off, or of text."""
    return [b"", data[: len(data) // 2], b"text"]


@pytest.mark.parametrize("kind", range(3))
def test_a_damaged_checkpoint_is_one_line(kind: int, tmp_path: Path) -> None:
    path = tmp_path / "checkpoint.pt"
    torch.save({"step": 3, "seed": 0}, path)
    path.write_bytes(damage(path.read_bytes())[kind])
    with pytest.raises(WeightsError, match=r"checkpoint\.pt is damaged") as error:
        load_run(tmp_path)
    assert "weights_only=False" not in str(error.value)


def read_window(path: Path) -> None:
    read_arrays(path, ["reference"], "this test")


def read_sheet(path: Path) -> None:
    datasheet.files(path.parents[1])


def draw_sheet(path: Path) -> None:
    meta = {"seed": 0, "exposure": 1.0}
    datasheet.contact_sheet([datasheet.File(path, meta)], path.with_suffix(".jpg"))


@pytest.mark.parametrize(
    ("read", "name"),
    [(read_window, "reference"), (read_sheet, "meta"), (draw_sheet, "reference")],
)
def test_a_window_runs_no_code(
    read: Callable[[Path], None], name: str, tmp_path: Path
) -> None:
    mark = tmp_path / "it ran"
    (tmp_path / "train").mkdir()
    path = tmp_path / "train" / "1.npz"
    arrays = {"meta": np.array(json.dumps({})), "reference": np.ones((4, 4, 3))}
    np.savez(path, **(arrays | {name: np.array([Trigger(mark)], object)}))
    with suppress(Exception):  # what it says is another test's
        read(path)
    assert not mark.exists()
