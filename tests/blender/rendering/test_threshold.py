"""What a file with a noise threshold asks for, learnt from a frame of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

pytest.importorskip("bpy")

from shots import World, camera, view

from xrds_blender.rendering.pace.threshold import (
    Threshold,
    learn_threshold,
)
from xrds_core.accumulation.frame import Stored, store
from xrds_core.accumulation.local_filters import BLOCK
from xrds_core.accumulation.noise import Noise

SHAPE = (64, 192)
LEAST, MOST = 48, 4096


def stored(noise: NDArray[np.float32]) -> Stored:
    """A frame whose halves' roots of luminance differ by so much."""
    frame = store(view(1, camera(), World(), shape=SHAPE).frame)
    assert frame.noise is not None
    light, guides = (
        x.astype(np.float32) for x in (frame.noise.brightness, frame.noise.guides)
    )
    return replace(frame, noise=Noise.of(light, noise.ravel(), guides))


def test_noisy_blocks_take_more_samples() -> None:
    noise = np.full(SHAPE, 0.01, np.float32)
    noise[:, : 2 * BLOCK] = 0.02  # four times the samples
    frame = stored(noise)
    asked = np.full(SHAPE, LEAST, np.float32)
    asked[:, : 2 * BLOCK] = 4 * LEAST
    found = learn_threshold(frame, asked)
    assert found.samples == pytest.approx(asked.mean())
    density = found.density(frame)
    assert density[:, 0] * found.samples == pytest.approx(4 * LEAST, rel=0.1)
    assert density[:, -1] * found.samples == pytest.approx(LEAST, rel=0.1)
    # never more than a pixel has taken, and never less than the least
    loud = found.density(stored(10 * noise))
    assert loud * found.samples == pytest.approx(4 * LEAST)
    quiet = found.density(stored(noise / 10))
    assert quiet * found.samples == pytest.approx(LEAST)


def test_what_was_not_measured_does_not_count() -> None:
    frame = stored(np.full(SHAPE, 0.01, np.float32))
    asked = np.zeros(SHAPE, np.float32)
    asked[:, : 2 * BLOCK] = 2 * LEAST
    assert learn_threshold(frame, asked).samples == 2 * LEAST


@pytest.mark.parametrize(
    ("samples", "share", "expected"),
    [
        (54.0, 0.25, True),
        (54.0, 1.0, True),  # two halves under a threshold would have 64
        (70.0, 1.0, False),  # the file's own way
        (300.0, 0.15, True),
        (300.0, 0.25, False),  # enough for Cycles to find where noise is
    ],
)
def test_few_samples_are_even(samples: float, share: float, expected: bool) -> None:
    assert Threshold(samples, LEAST, MOST, 1.0).is_few(share) is expected
