"""A frame that lacks neighbours in a part of the picture."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from shots import camera, view

pytest.importorskip("mitsuba_oidn")

from xrds_core import finish
from xrds_core.accumulation.frame import Frame, store
from xrds_core.accumulation.object_motion import Movement
from xrds_core.denoising import Denoiser
from xrds_core.finish import finish_frame

SHAPE = (320, 480)
CAMERA = replace(camera(), size=SHAPE[::-1])
PART = (slice(40, 90), slice(400, 470))


def frame(number: int) -> Frame:
    """A still camera's; what it lends is missing in PART."""
    made = view(number, CAMERA, noise=0.2, shape=SHAPE, samples=4, still=True).frame
    if number != 1:
        radiance = made.radiance.copy()
        radiance[PART] = np.nan
        made = replace(made, radiance=radiance)
    return made


class Counting:
    """A denoiser that notes the sizes of what it denoises."""

    def __init__(self) -> None:
        self.denoiser = Denoiser("fast", "cpu")
        self.sizes: list[tuple[int, ...]] = []

    def __call__(self, *passes: NDArray[np.float32], **rest: Any) -> Any:
        self.sizes.append(passes[0].shape[:2])
        return self.denoiser(*passes, **rest)


def test_only_the_part_that_lacks_neighbours_is_denoised_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    own, others = store(frame(1)), [store(frame(n)) for n in range(2, 6)]
    counting, told = Counting(), []

    def keep(done: float) -> bool:
        told.append(done)
        return True

    parts = finish_frame(own, others, counting, Movement(), keep).picture
    assert counting.sizes[0] == SHAPE
    assert len(counting.sizes) == 2
    assert np.prod(counting.sizes[1]) < 0.6 * np.prod(SHAPE)
    assert told == sorted(told)
    assert told[-1] == 1.0

    monkeypatch.setattr(finish, "_PART", 0.0)
    whole = finish_frame(own, others, Counting(), Movement()).picture
    alone = finish_frame(own, [], Counting(), Movement()).picture
    rows, columns = PART
    inside = slice(rows.start + 8, rows.stop - 8), slice(columns.start + 8, 462)
    np.testing.assert_array_equal(whole[inside], alone[inside])
    # a part has another exposure for the denoiser, and nothing else
    assert np.abs(parts - whole)[inside].mean() < 0.02 * whole[inside].mean()
    far = np.ones(SHAPE, bool)
    far[:192, 288:] = False
    np.testing.assert_array_equal(parts[far], whole[far])
