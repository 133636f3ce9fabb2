"""Which card is chosen, and that it is checked before it is believed."""

from __future__ import annotations

import subprocess
import sys

import pytest

from xrds_core.errors import UsageError
from xrds_core.gpu import card
from xrds_core.gpu import choose as choosing
from xrds_core.gpu.accumulate import CardAccumulator
from xrds_core.gpu.card import CardLost, find_adapters
from xrds_core.sequence import accumulator
from xrds_core.temporal.accumulate import Means

SOFTWARE = find_adapters(software=True)
needs_card = pytest.mark.skipif(not SOFTWARE, reason="no software Vulkan here")


def play(monkeypatch: pytest.MonkeyPatch, cards: int) -> None:
    """Let so many software drivers be cards."""
    monkeypatch.setattr(choosing, "find_adapters", lambda: SOFTWARE[:1] * cards)
    monkeypatch.setattr(choosing, "card_names", lambda: ["Soft"] * cards)


def test_without_a_card_the_processor_accumulates(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    play(monkeypatch, 0)
    assert choosing.choose("auto") is None


def test_a_package_that_cannot_be_loaded_is_told_and_does_without(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As cffi where the system's own _cffi_backend was loaded before ours."""

    def mismatch(name: str) -> None:
        raise Exception("Version mismatch: this is the 'cffi' package")

    monkeypatch.setattr(card, "import_module", mismatch)
    assert choosing.choose("auto") is None
    told = capsys.readouterr().err
    assert "no graphics card is used" in told
    assert "Version mismatch" in told
    with pytest.raises(UsageError, match="no graphics card 'gpu'"):
        choosing.choose("gpu")


@pytest.mark.parametrize("name", ["gpu", "Radeon"])
def test_a_card_asked_for_must_be_here(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    play(monkeypatch, 0)
    with pytest.raises(UsageError, match=f"no graphics card '{name}'.*use auto or cpu"):
        choosing.choose(name)


@needs_card
def test_a_card_is_found_by_a_part_of_its_name(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    play(monkeypatch, 2)
    found = choosing.choose(SOFTWARE[0].info["device"][:5].upper())
    assert found is not None
    assert found.card.name == SOFTWARE[0].info["device"]


@needs_card
def test_a_card_that_computes_wrongly_is_not_used(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    play(monkeypatch, 1)
    right = CardAccumulator._means

    def wrong(self: CardAccumulator, *args: object) -> Means:
        found = right(self, *args)  # type: ignore[arg-type]
        found.passes[0][:, :32] *= 1.1
        return found

    monkeypatch.setattr(CardAccumulator, "_means", wrong)
    assert choosing.choose("auto") is None
    assert "computes something else than the processor" in capsys.readouterr().err
    with pytest.raises(CardLost, match="update its driver"):
        choosing.choose("gpu")


def test_nothing_is_loaded_before_frames_are_accumulated() -> None:
    code = (
        "import sys, xrds_core.sequence.denoise, xrds_core.sequence.accumulator as a;"
        "a.Accumulator(); assert 'wgpu' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@needs_card
def test_an_accumulator_says_what_it_has_used(monkeypatch: pytest.MonkeyPatch) -> None:
    play(monkeypatch, 1)
    accumulator.open_card.cache_clear()
    frames = [choosing._frame(number) for number in range(3)]
    accumulate = accumulator.Accumulator("gpu")
    accumulate(frames[1])
    assert accumulate.device == "cpu"  # nothing to accumulate: no card was opened
    accumulate(frames[1], frames[::2])
    assert accumulate.device == SOFTWARE[0].info["device"]
    accumulator.open_card.cache_clear()
