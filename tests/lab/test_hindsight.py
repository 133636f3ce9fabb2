"""What a time budget could have chosen at best."""

from __future__ import annotations

from typing import Any

import pytest

from xrds_lab.bench import hindsight


def way(samples: int, denoiser: str, seconds: float, psnr: float) -> dict[str, Any]:
    """A point whose samples take two seconds each."""
    beauty = 2.0 * samples
    stages = {"beauty": beauty, "denoise": seconds, "total": beauty + seconds + 0.5}
    settings = {"method": "full_size", "samples": samples, "denoiser": denoiser}
    label = f"{samples} {denoiser}"
    return {"method": "full_size", "settings": settings, "label": label,
            "seconds": stages, "psnr": psnr}  # fmt: skip


WAYS = [
    way(2, "high", 6.0, 30.0),
    way(4, "fast", 1.0, 31.0),
    way(4, "high", 6.0, 33.0),
    way(8, "high", 6.0, 36.0),
]


def pick(budget: float, per_sample: float, denoise: float) -> dict[str, Any]:
    """Three samples and `high`, as they were rendered; half a second is the rest."""
    taken = way(3, "high", denoise, 31.5)
    beauty = 3 * per_sample
    total = {"beauty": beauty, "denoise": denoise, "total": beauty + denoise + 0.5}
    return taken | {"seconds": total, "budget": budget}


@pytest.mark.parametrize(
    ("budget", "per_sample", "denoise", "best"),
    [
        (15.0, 2.0, 6.0, "4 high"),  # as quick as when it was timed: 14.5 s
        (15.0, 3.0, 6.0, "4 fast"),  # three samples took 15.5 s: four and fast 13.5
        (19.0, 3.0, 9.0, "3 high"),  # 18.5 s, and 21.5 with four
        (23.0, 2.0, 6.0, "8 high"),
    ],
)
def test_ways_take_the_seconds_of_the_frame_that_was_rendered(
    budget: float, per_sample: float, denoise: float, best: str
) -> None:
    found = hindsight.best(pick(budget, per_sample, denoise), WAYS)
    assert found is not None
    assert found["label"] == best


def test_nothing_is_said_where_nothing_fits_or_nothing_was_picked() -> None:
    assert hindsight.best(pick(4.0, 2.0, 6.0), WAYS) is None
    assert hindsight.best(None, WAYS) is None
    enlarged = pick(15.0, 2.0, 6.0)
    enlarged["settings"] = {"method": "xrds"}
    assert hindsight.best(enlarged, WAYS) is None
