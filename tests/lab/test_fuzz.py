"""Odd shots by chance: the same again by their number; planted faults are found."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

pytest.importorskip("mitsuba_oidn")
if os.name == "nt":
    pytest.skip("processes are forked", allow_module_level=True)

from xrds_core.shot_files import sequence
from xrds_lab.stability.fuzz import fuzz, run, run_case
from xrds_lab.stability.fuzz_shots import make_twice
from xrds_lab.stability.odd_shots import Case, make_case

SEED = 7
Make = Callable[[Path, int, int], Case]


@pytest.mark.parametrize("make", [make_case, make_twice])
def test_a_case_is_told_by_its_number(make: Make, tmp_path: Path) -> None:
    contents = []
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        case = make(tmp_path / name, SEED, 3)
        files = sorted(x for x in (case.folder / "in").iterdir() if x.is_file())
        contents.append((case.words, [x.read_bytes() for x in files]))
    assert contents[0] == contents[1]


def test_no_case_is_a_fault_and_the_next_run_goes_on(tmp_path: Path) -> None:
    first = fuzz(tmp_path, 0.1, seed=SEED)
    assert first["cases"] > 0
    second = fuzz(tmp_path, 0.02, seed=SEED, resume=True)
    assert second["cases"] > first["cases"]
    assert second["passed"]
    assert not (tmp_path / "fuzz.json").exists()


def test_tracebacks_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise KeyError("a bug")

    case = make_case(tmp_path, SEED, 0)
    case.words[1:] = ["in/####.exr", "-o", "out/####.exr"]
    monkeypatch.setattr(sequence.Files, "check", fail)
    assert run(case).faults == ["traceback"]


def test_frames_that_resume_believes_are_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sequence, "is_made_of", lambda path, _: path.is_file())
    _, resumed, _ = run_case(tmp_path, SEED, 4)  # in which an input is replaced
    assert resumed.faults == ["0002.exr differs"]
