"""What `xrds bench` understands: a bench by name, and its own options alone."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from xrds_blender.command import main
from xrds_lab.commands.measuring import BENCHES
from xrds_lab.shots import own_seconds

RESULT = {"parts": [1, 2], "failures": {"a": "no"}}


@pytest.fixture
def measured(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, int]]:
    """The sizes that our own seconds are asked for; nothing is measured."""
    sizes = []

    def note(_: Path, size: tuple[int, int], **__: object) -> dict[str, object]:
        sizes.append(size)
        return RESULT

    monkeypatch.setattr(own_seconds, "bench_own_seconds", note)
    return sizes


def test_every_bench_is_listed(capfd: pytest.CaptureFixture[str]) -> None:
    assert main.main(["bench", "--help"]) == 0
    listed = capfd.readouterr().out
    names = [add.__name__.removeprefix("add_").replace("_", "-") for add in BENCHES]
    assert len(names) == 8
    assert all(f"\n    {name}" in listed for name in names)


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        (["bench"], "required: WHAT"),
        (["bench", "a.blend", "-o", "out"], "invalid choice: 'a.blend'"),
        (["bench", "stills", "-o", "out"], "required: SCENE.blend"),
        (["bench", "gallery"], "required: -o/--out"),
        (["bench", "own-seconds", "8x8", "-o", "out", "--card"], "--card"),
    ],
)
def test_wrong_usage_is_told(
    words: list[str], fault: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert main.main(words) == 2
    assert fault in capfd.readouterr().err


def test_a_bench_says_how_much_it_measured(
    measured: list[tuple[int, int]], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    words = ["bench", "own-seconds", "64x48", "-o", str(tmp_path)]
    assert main.main(words) == 0
    assert capfd.readouterr().out.splitlines() == ["2 points", "left out: a: no"]
    assert measured == [(64, 48)]


@pytest.mark.parametrize("place", [1, 2, 5])
def test_json_may_stand_before_or_after_the_bench(
    place: int,
    measured: list[tuple[int, int]],
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
) -> None:
    words = ["bench", "own-seconds", "64x48", "-o", str(tmp_path)]
    words.insert(place, "--json")
    assert main.main(words) == 0
    assert json.loads(capfd.readouterr().out) == RESULT
    assert measured
