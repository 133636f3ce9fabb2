"""Stiff and extreme input: shipped weights against the table of bounds.

The same checks as `xrds stability`, on small pictures; fewer cases in bf16.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from xrds_core.errors import Cancelled
from xrds_lab.stability import light, sameness, suite
from xrds_lab.stability.bounds import BOUNDS, EXEMPTIONS, Exemption, bound, judge
from xrds_lab.stability.measured import Measured, distance, worst
from xrds_lab.stability.pictures import constant, textured
from xrds_lab.stability.subject import Subject, shipped

Work = Callable[[Subject], Iterator[Measured]]

# The preset that is used; `xrds stability` judges the larger ones, which take long.
SUBJECTS = [subject for subject in shipped(device="cpu") if subject.preset == "fast"]
EVERY: list[Work] = list(chain.from_iterable(suite.GROUPS.values()))
# What half the digits could spoil, beside what compares them.
IN_BF16: list[Work] = [light.scaling, light.constants, light.black, *sameness.CHECKS]


def cases() -> Iterator[Any]:
    for subject in SUBJECTS:
        for work in EVERY if subject.precision == "fp32" else IN_BF16:
            name, marks = f"{subject.name} {work.__name__}", []
            if subject.scale > 2:
                marks = [pytest.mark.nightly]
            yield pytest.param(subject, work, id=name, marks=marks)


@pytest.fixture(autouse=True)
def one_thread() -> Iterator[None]:
    """Small pictures lose more to waiting threads than they gain from them."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


def test_weights_are_shipped() -> None:
    assert {s.scale for s in SUBJECTS} >= {2, 4}


@pytest.mark.parametrize(("subject", "work"), [*cases()])
def test_bounds_hold(subject: Subject, work: Work) -> None:
    found = [check for check, _ in suite.checks(subject, work)]
    assert found or (work is sameness.precisions and subject.precision == "fp32")
    for check in found:
        assert check.holds, f"{check.name} is {check.value:.4g}, not {check.bound:g}"


# --- the checks can fail --------------------------------------------------------------


class Wrong:
    """Stands for an upscaler with a fault."""

    def __init__(self, right: Subject, spoil: Callable[[Any], Any]) -> None:
        self.right, self.spoil = right.upscaler, spoil
        self.network, self.device = self.right.network, self.right.device

    def __call__(self, *inputs: Any, **options: Any) -> Any:
        found = self.right(*inputs, **options)
        return replace(found, radiance=self.spoil(found.radiance.copy()))


def tinted(picture: Any) -> Any:
    picture[..., 0] *= 1.05
    return picture


def lifted(picture: Any) -> Any:
    return picture + np.float32(1e-3)


def holed(picture: Any) -> Any:
    picture[-1, -1] = np.nan
    return picture


def flipped(picture: Any) -> Any:
    return picture[:, ::-1]


FAULTS = [
    (tinted, "hues", {"grey.chroma", "colour.permutation"}),
    (lifted, "light", {"range.scaling", "black.all", "black.half", "lit_pixel.away"}),
    (holed, "spoilt", {"invalid.faults"}),
    (holed, "shapes", {"shapes.faults"}),
    (flipped, "lies", {"guides.constant", "guides.albedo_0"}),
]


@pytest.mark.parametrize(
    ("spoil", "group", "names"), FAULTS, ids=[f"{f.__name__} {g}" for f, g, _ in FAULTS]
)
def test_a_fault_is_found(
    spoil: Callable[[Any], Any], group: str, names: set[str]
) -> None:
    right = SUBJECTS[0]
    wrong = Subject(right.preset, right.scale, "fp32", Wrong(right, spoil))  # type: ignore[arg-type]
    found = chain.from_iterable(
        suite.checks(wrong, work) for work in suite.GROUPS[group]
    )
    assert names <= {check.name for check, _ in found if not check.passed}


def test_a_value_is_judged_by_its_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    name, limit = "grey.chroma", BOUNDS["grey.chroma"].limit
    assert judge(name, limit, "fast", 2, "fp32").passed
    worse = judge(name, limit * 2, "fast", 2, "fp32")
    assert (worse.passed, worse.holds, worse.exception) == (False, False, None)
    assert not judge(name, float("nan"), "fast", 2, "fp32").holds
    exempt = Exemption("fast x4 *", limit * 2, "so it is")
    monkeypatch.setitem(EXEMPTIONS, name, (exempt,))
    assert judge(name, limit * 2, "fast", 4, "bf16").exception == "so it is"
    assert not judge(name, limit * 3, "fast", 4, "bf16").holds
    assert not judge(name, limit * 2, "fast", 2, "fp32").holds


def test_nan_is_the_worst_of_a_curve() -> None:
    assert worst("grey.chroma", {0: 1.0, 1: float("nan")}).value == float("inf")


def test_distance_is_from_the_footprint() -> None:
    away = distance(12, 2, [(2, 3)])
    assert away[4:6, 6:8].max() == 0
    assert away[3, 6] == away[6, 7] == 1
    assert away[0, 0] == 6


def test_exemptions_name_bounds() -> None:
    for name, exempt in EXEMPTIONS.items():
        limit = bound(name).limit
        assert limit is not None
        assert all(x.limit > limit and x.reason for x in exempt)


def test_scenes_share_a_bound() -> None:
    assert bound("stiff.hair.faults") is BOUNDS["stiff.*.faults"]
    assert bound("shot.turntable.exposure").limit == 0.1
    with pytest.raises(KeyError):
        bound("stiff.hair.beauty")


# --- cancel ---------------------------------------------------------------------------


def test_cancel_takes_less_than_half_of_the_run() -> None:
    subject = SUBJECTS[0]
    inputs = textured(256, subject.scale)
    seconds = []
    for limit in (2.0, 0.1):
        start = time.process_time()
        with suppress(Cancelled):
            subject(inputs, progress=lambda x, limit=limit: x < limit)
        seconds.append(time.process_time() - start)
    whole, cancelled = seconds
    assert cancelled < 0.5 * whole


# --- the document ---------------------------------------------------------------------

DOCUMENT = Path(__file__).parents[3] / "docs" / "lab" / "stability.md"


def test_the_document_lists_every_bound() -> None:
    rows = re.findall(r"^\| `([a-z0-9_.*]+)` \| ([^|]+) \|", DOCUMENT.read_text(), re.M)
    told = {name: limit.strip() for name, limit in rows}
    assert told == {
        name: "reported" if bound.limit is None else f"{bound.limit:g}"
        for name, bound in BOUNDS.items()
    }


def test_constant_pictures_are_constant() -> None:
    assert np.ptp(constant(3, 4, 0.5)) == 0
    assert constant(3, 4, (0.0, 0.0, 1.0)).shape == (3, 4, 3)
