"""The report of `xrds stability`: failures first, and what one run adds to another."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from xrds_core.errors import UsageError
from xrds_core.superres import weights
from xrds_lab.stability import report, suite
from xrds_lab.stability.measured import Measured
from xrds_lab.stability.subject import Subject


def even(subject: Subject) -> Iterator[Measured]:
    yield Measured("energy.smooth", 0.001)
    yield Measured("firefly.far_change", 0.0, {1e2: 0.0, 1e4: 0.0})


def uneven(subject: Subject) -> Iterator[Measured]:
    yield Measured("energy.smooth", 0.5)
    yield Measured("grey.chroma", float(subject.scale))


def measure(
    monkeypatch: pytest.MonkeyPatch, out: Path, *works: suite.Work, **choices: Any
) -> dict:
    """Judge the small networks alone: every one of them is loaded each time."""
    monkeypatch.setattr(suite, "GROUPS", {"some": works})
    small = out / "small"
    small.mkdir(exist_ok=True)
    for path in weights.DIRECTORY.glob("fast_x*.safetensors"):
        shutil.copy(path, small)
    return suite.stability(
        out, parts=["arrays"], device="cpu", weights=small, **choices
    )


def test_failures_come_first(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    result = measure(monkeypatch, tmp_path, uneven)
    assert not result["passed"]
    assert result == json.loads((tmp_path / "results.json").read_text())
    page = (tmp_path / "report.md").read_text()
    failures = page[page.index("## Failures") : page.index("## All values")]
    assert "| `grey.chroma` | fast x4 bf16 | 4 | 0.001 | **none** |" in failures
    assert {"name", "preset", "scale", "precision", "value", "bound", "passed"} < set(
        result["checks"][0]
    )


def test_a_second_run_adds_to_the_first(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    first = measure(monkeypatch, tmp_path, even)
    assert first["passed"]
    assert (tmp_path / "firefly_far_change.png").is_file()
    both = measure(monkeypatch, tmp_path, uneven)
    names = [check["name"] for check in both["checks"]]
    assert len(names) == 3 * len(first["checks"]) // 2
    values = {c["value"] for c in both["checks"] if c["name"] == "energy.smooth"}
    assert values == {0.5}
    assert both["curves"] == first["curves"]


def test_what_blender_prints_is_kept_in_a_file(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    def loud(subject: Subject) -> Iterator[Measured]:
        os.write(1, b"Fra:1\n")  # as a library in C does
        yield from even(subject)

    measure(monkeypatch, tmp_path, loud)
    assert "Fra:1" in (tmp_path / "blender.log").read_text()
    assert "Fra:1" not in capfd.readouterr().out


def test_other_weights_start_anew(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    result = measure(monkeypatch, tmp_path, even)
    result["weights"] = []
    (tmp_path / "results.json").write_text(json.dumps(result))
    names = {c["name"] for c in measure(monkeypatch, tmp_path, uneven)["checks"]}
    assert names == {"energy.smooth", "grey.chroma"}


def test_a_check_that_is_no_more_leaves_the_others(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    result = measure(monkeypatch, tmp_path, even)
    result["checks"][0]["name"] = "energy.of.old"
    (tmp_path / "results.json").write_text(json.dumps(result))
    names = {c["name"] for c in measure(monkeypatch, tmp_path, uneven)["checks"]}
    assert names == {"energy.smooth", "firefly.far_change", "grey.chroma"}


def test_a_page_without_failures_says_so(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    measure(monkeypatch, tmp_path, even)
    assert "## Failures\n\nNone." in (tmp_path / "report.md").read_text()
    assert set(report.PLOTS[0]) >= {"firefly.far_change"}


def test_what_is_measured_is_not_measured_again(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    lines: list[str] = []
    subjects = []

    def counted(subject: Any) -> Iterator[Measured]:
        subjects.append(subject.name)
        if len(subjects) == 2:
            raise KeyboardInterrupt
        yield from even(subject)

    with pytest.raises(KeyboardInterrupt):
        measure(monkeypatch, tmp_path, counted, progress=lines.append)
    assert "left, about" in lines[-1]
    first = json.loads((tmp_path / "results.json").read_text())
    measure(monkeypatch, tmp_path, counted, resume=True)
    assert subjects.count(subjects[0]) == 1
    assert subjects.count(subjects[1]) == 2
    both = json.loads((tmp_path / "results.json").read_text())
    assert len(both["checks"]) > len(first["checks"]) > 0
    measure(monkeypatch, tmp_path, counted)
    assert subjects.count(subjects[0]) == 2


def test_one_network_is_enough_for_a_quick_look(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    result = measure(monkeypatch, tmp_path, even, quick=True)
    found = {(x["preset"], x["scale"], x["precision"]) for x in result["checks"]}
    assert found == {("fast", 2, "fp32")}


def test_unknown_parts_are_wrong_usage(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="everything"):
        suite.stability(tmp_path, parts=["everything"])
