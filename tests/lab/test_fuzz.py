"""Odd shots by chance: the same again by their number, and none is a fault."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

pytest.importorskip("mitsuba_oidn")
if os.name == "nt":
    pytest.skip("processes are forked", allow_module_level=True)

from xrds_lab.stability.fuzz import fuzz, run_case, summary
from xrds_lab.stability.odd_shots import make_case

SEED = 7


def test_a_case_is_told_by_its_number(tmp_path: Path) -> None:
    contents = []
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        case = make_case(tmp_path / name, SEED, 3)
        files = sorted(x for x in (case.folder / "in").iterdir() if x.is_file())
        contents.append((case.words, [x.read_bytes() for x in files]))
    assert contents[0] == contents[1]


def test_no_case_is_a_fault() -> None:
    outcomes = list(fuzz(8.0, SEED))
    told = summary(outcomes, SEED)
    assert told["cases"] > 1
    assert not told["wrong"]


def test_faults_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from xrds_core.sequence import denoise

    def fail(*_: object) -> None:
        raise KeyError("a bug")

    case = make_case(tmp_path, SEED, 0)
    case.words[1:] = ["in/####.exr", "-o", "out/####.exr"]
    monkeypatch.setattr(denoise.Files, "check", fail)
    assert run_case(0, case).faults == ["traceback"]
