"""A card accumulates what the processor does; a software driver plays the card."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from shots import PIXEL, World, camera, vector, view

from xrds_core.gpu import accumulate as on_card
from xrds_core.gpu.accumulate import CardAccumulator
from xrds_core.gpu.card import Card, CardLost, find_adapters
from xrds_core.temporal import accumulate as processor
from xrds_core.temporal.accumulate import Accumulated, accumulate
from xrds_core.temporal.frame import Frame, Stored, store

STEP = 3.3 * 5 * PIXEL  # of the moving thing in a frame: 3.3 pixels


@pytest.fixture(scope="module")
def card() -> CardAccumulator:
    adapters = find_adapters(software=True)
    if not adapters:
        pytest.skip("no software Vulkan here: install mesa-vulkan-drivers")
    return CardAccumulator(Card(adapters[0]))


@pytest.fixture(autouse=True)
def as_few_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    """Kernels take no offsets out: their frames have few samples for the method."""
    monkeypatch.setattr(processor, "FEW_SAMPLES", np.inf)


def shot(pan: float, turn: float = 0.0, **more: Any) -> list[Frame]:
    """Nine noisy frames of a wall with something in front of it that moves."""
    return [
        view(
            k,
            camera(pan * k, yaw=turn * k),
            World(card=(STEP * (k - 4), 0.0)),
            noise=0.4,
            **more,
        ).frame
        for k in range(9)
    ]


def followed(pan: float) -> list[Frame]:
    worlds = [World(card=(STEP * (k - 4), 0.0)) for k in range(9)]
    shown = [view(k, camera(pan * k), worlds[k], noise=0.4) for k in range(9)]
    return [
        replace(x.frame, vector=vector(shown, k, worlds)) for k, x in enumerate(shown)
    ]


def mirrored(pan: float, orthographic: bool = False) -> list[Frame]:
    """A mirror that shows a wall as far behind it as the wall is away."""
    frames = []
    for k in range(9):
        eye = camera(pan * k, orthographic=orthographic)
        shown = view(k, eye, World(wall_half=90.0), noise=0.4).frame
        depth = view(k, eye, World(card=(0.0, 0.0), card_half=1.6)).frame.depth
        length = shown.depth / eye.depth_per_length(shown.shape)
        frames.append(replace(shown, depth=depth, path_length=length, samples=4.0))
    return frames


def with_alpha(frames: Sequence[Frame]) -> list[Frame]:
    """Half of the picture is transparent."""
    alpha = np.ones(frames[0].shape, np.float32)
    alpha[:, :20], alpha[:, 20:24] = 0.0, 0.4
    return [replace(x, alpha=alpha) for x in frames]


def spoilt(frames: Sequence[Frame]) -> list[Frame]:
    """Pixels that are no numbers, and others without a depth or samples."""
    rng, result = np.random.default_rng(3), []
    for frame in frames:
        assert frame.radiance is not None
        radiance, depth = frame.radiance.copy(), frame.depth.copy()
        radiance[rng.random(frame.shape) < 0.05] = np.nan
        depth[rng.random(frame.shape) < 0.05] = np.nan
        counts = rng.integers(0, 9, frame.shape).astype(np.float32)
        result.append(replace(frame, radiance=radiance, depth=depth, counts=counts))
    return result


SHOTS: dict[str, Callable[[], list[Frame]]] = {
    "still": lambda: shot(0.0, still=True),
    "by whole pixels": lambda: shot(10 * PIXEL, samples=1.0),
    "slow": lambda: shot(0.021, samples=16.0),
    "fast": lambda: shot(0.21, samples=2.0),
    "turning": lambda: shot(0.05, 0.013, samples=64.0),
    "followed": lambda: followed(0.05),
    "mirror": lambda: mirrored(0.23),
    "orthographic mirror": lambda: mirrored(0.23, orthographic=True),
    "alpha": lambda: with_alpha(shot(0.05, samples=4.0)),
    "spoilt": lambda: spoilt(shot(0.05, samples=4.0)),
}


def both_ways(
    card: CardAccumulator, frames: Sequence[Frame], dtype: type = np.float16
) -> tuple[Accumulated, Accumulated]:
    """What the processor and the card make of the middle frame."""
    stored = [store(x, dtype) for x in frames]
    middle = len(stored) // 2
    others = [x for k, x in enumerate(stored) if k != middle]
    assert card.takes(stored[middle], others)
    expected = accumulate(stored[middle], others)
    found = accumulate(stored[middle], others, card=card)
    assert not card.is_lost
    return expected, found


def check_alike(expected: Accumulated, found: Accumulated) -> None:
    """In all but one pixel of 10,000 within 1e-4 of the mean, and as many samples."""
    for name in ("radiance", "albedo", "normal", "alpha"):
        one, other = getattr(expected, name), getattr(found, name)
        if one is None:
            assert other is None
            continue
        assert one.shape == other.shape
        np.testing.assert_array_equal(np.isnan(one), np.isnan(other))
        apart = np.nan_to_num(np.abs(one - other)) > 1e-4 * np.nanmean(np.abs(one))
        assert apart.mean() <= 1e-4, name
    samples = np.abs(expected.samples - found.samples) > 1e-3 * expected.samples
    assert samples.mean() <= 1e-4
    assert found.rejected == pytest.approx(expected.rejected, abs=1e-4)
    assert found.frames == expected.frames


@pytest.mark.parametrize("dtype", [np.float16, np.float32])
@pytest.mark.parametrize("name", SHOTS)
def test_a_card_finds_what_the_processor_does(
    card: CardAccumulator, name: str, dtype: type
) -> None:
    expected, found = both_ways(card, SHOTS[name](), dtype)
    # neighbours do lend, or nothing would be compared
    assert expected.rejected < 0.95
    check_alike(expected, found)


@pytest.mark.parametrize("dtype", [np.float16, np.float32])
def test_parts_of_the_light_have_the_weights_of_the_whole(
    card: CardAccumulator, dtype: type, monkeypatch: pytest.MonkeyPatch
) -> None:
    frames = spoilt(shot(0.05, samples=4.0))
    for k, frame in enumerate(frames):
        assert frame.radiance is not None
        light = np.nan_to_num(frame.radiance)
        share = np.random.default_rng(k).uniform(size=(*frame.shape, 1))
        parts = {"key": light * share, "rest": light * (1 - share)}
        parts["late"] = light * (k > 4)  # dark in the frame itself
        parts["never"] = light * 0
        parts = {name: x.astype(np.float32) for name, x in parts.items()}
        frames[k] = replace(frame, parts=parts)
    for band in (1 << 30, 64 * 40):
        monkeypatch.setattr(on_card, "_BAND", band)
        expected, found = both_ways(card, frames, dtype)
        check_alike(expected, found)
        assert list(found.parts) == list(expected.parts)
        for name, part in expected.parts.items():
            assert part.any() == (name != "never")
            np.testing.assert_allclose(found.parts[name], part, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("shape", [(1, 1), (1, 2), (2, 1), (3, 5)])
def test_small_pictures_have_parts(
    card: CardAccumulator, shape: tuple[int, int]
) -> None:
    height, width = shape
    frames = []
    for k in range(3):
        light = np.full((*shape, 3), 0.5 + k, np.float32)
        normal = np.broadcast_to(np.float32([0, 0, -1]), (*shape, 3))
        eye = replace(camera(0.0), size=(width, height))
        depth = np.full(shape, 5.0, np.float32)
        frames.append(Frame(k, eye, light, light, normal, depth, parts={"Emit": light}))
    stored = [store(x) for x in frames]
    expected = accumulate(stored[1], [stored[0], stored[2]])
    found = accumulate(stored[1], [stored[0], stored[2]], card=card)
    assert found.device == card.name
    np.testing.assert_allclose(found.parts["Emit"], expected.parts["Emit"], rtol=1e-4)


def test_offsets_are_left_to_the_processor(
    card: CardAccumulator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(processor, "FEW_SAMPLES", 2.0)
    for samples, device in ((2.0, card.name), (3.0, "cpu")):
        frames = [store(x) for x in shot(0.05, samples=samples)]
        assert accumulate(frames[1], frames[::2], card=card).device == device


def test_a_picture_in_bands_is_the_same(
    card: CardAccumulator, monkeypatch: pytest.MonkeyPatch
) -> None:
    frames = followed(0.05)
    _, whole = both_ways(card, frames)
    monkeypatch.setattr(on_card, "_BAND", 64 * 40)
    expected, found = both_ways(card, frames)
    check_alike(expected, found)
    np.testing.assert_allclose(found.radiance, whole.radiance, rtol=1e-5)


def test_neighbours_of_another_format_and_size_of_samples(
    card: CardAccumulator,
) -> None:
    frames = shot(0.05, samples=4.0)
    target = store(frames[1], np.float32)
    others = [store(replace(x, samples=9.0)) for x in frames[:3:2]]
    check_alike(accumulate(target, others), accumulate(target, others, card=card))


def test_what_a_card_does_not_do_is_left_to_the_processor(
    card: CardAccumulator,
) -> None:
    frames = [store(x) for x in shot(0.05)]
    guides = [store(replace(x, radiance=None)) for x in shot(0.05)]
    assert card.takes(frames[1], frames[::2])
    assert not card.takes(guides[1], guides[::2])
    assert not card.takes(frames[1], [])


def test_a_card_that_is_lost_leaves_the_rest_to_the_processor(
    card: CardAccumulator,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    lost = CardAccumulator(card.card)

    def fail(*_: object) -> None:
        raise CardLost("graphics card Fake failed (device lost)")

    frames: list[Stored] = [store(x) for x in shot(0.05)]
    monkeypatch.setattr(card.card, "start", fail)
    found = [accumulate(frames[1], frames[::2], card=lost) for _ in range(2)]
    expected = accumulate(frames[1], frames[::2])
    for each in found:
        np.testing.assert_array_equal(each.radiance, expected.radiance)
    said = capsys.readouterr().err.splitlines()
    assert said == [
        "xrds: graphics card Fake failed (device lost); the processor accumulates "
        "instead"
    ]


def test_what_the_library_raises_is_one_line(card: CardAccumulator) -> None:
    with pytest.raises(CardLost, match=r"^graphics card .* failed \(.*\)$"):
        card.card.empty(1 << 44)
