"""Samples where they pay: the same picture, in parts, and when they stay even."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")
pytest.importorskip("mitsuba_oidn")

from xrds_blender import render
from xrds_blender.cycles import allotted, session
from xrds_blender.cycles.pass_names import NOISY
from xrds_blender.cycles.samples import sample_layer
from xrds_blender.cycles.settings import has_subsets
from xrds_blender.frame import allotting
from xrds_blender.frame.rendering import call_engine
from xrds_core.allocation import Rectangle
from xrds_core.errors import Cancelled


@pytest.fixture
def fixed(life: Any) -> Any:
    """A fixed count of samples, of nothing but the picture."""
    life.cycles.use_adaptive_sampling = False
    life.cycles.samples = 8
    life.view_layers[0].use_pass_z = False
    for item in life.objects:
        item.is_shadow_catcher = False
    return life


@pytest.fixture
def steady(fixed: Any) -> Any:
    """The same, where Cycles can take its samples in parts."""
    if not has_subsets(fixed):
        pytest.skip("this Blender continues no sequence")
    return fixed


def both(scene: Any, samples: int) -> tuple[Any, Any]:
    even, _ = call_engine(
        scene, lambda *given: sample_layer(*given, samples=samples, seed=2)
    )
    parts, _ = call_engine(
        scene, lambda *given: allotted.sample_allotted(*given, samples, 2)
    )
    return even[""], parts[""]


def test_parts_lie_where_they_belong(
    steady: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Many samples in some rectangles, few in others: both near the even picture."""
    given = [(Rectangle(5, 4, 17, 13), 30), (Rectangle(26, 18, 15, 10), 30)]
    monkeypatch.setattr(allotted, "allot", lambda *_: given)
    even, parts = both(steady, 32)
    near = apart = 0.0
    for place, _ in given:
        rows = slice(place.y, place.y + place.height)
        columns = slice(place.x, place.x + place.width)
        for one, other in ((even.albedo, parts.albedo), (even.normal, parts.normal)):
            shifted = np.roll(one, 1, axis=1)[rows, columns]
            near += np.abs(one[rows, columns] - other[rows, columns]).mean()
            apart += np.abs(shifted - other[rows, columns]).mean()
    assert near < 0.5 * apart


def test_the_border_counts(steady: Any) -> None:
    render_settings = steady.render
    render_settings.use_border = render_settings.use_crop_to_border = True
    render_settings.border_min_x, render_settings.border_max_x = 0.3, 0.9
    render_settings.border_min_y, render_settings.border_max_y = 0.2, 0.8
    even, parts = both(steady, 32)
    assert even.picture.shape == parts.picture.shape
    near = np.abs(even.albedo - parts.albedo).mean()
    assert near < 0.5 * np.abs(np.roll(even.albedo, 1, axis=1) - parts.albedo).mean()
    assert render_settings.border_min_x == pytest.approx(0.3)


def taken(scene: Any, **choices: Any) -> str:
    picture = render(scene, 1, **choices)
    decision = next(d for d in picture.plan if d.decision == "samples")
    return f"{decision.value}: {decision.reason}"


def test_what_decides(steady: Any) -> None:
    assert taken(steady).startswith("where they pay")
    assert taken(steady, samples=4).startswith("even")
    assert taken(steady, savings=()).startswith("even")
    steady.view_layers[0].use_pass_z = True
    assert taken(steady).startswith("even")
    steady.view_layers[0].use_pass_z = False
    steady.cycles.use_adaptive_sampling = True
    assert taken(steady).startswith("even")
    assert taken(steady, samples=8).startswith("where they pay")


def test_samples_stay_even_where_they_cannot_be_parted(
    fixed: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As before Blender 4.4."""
    monkeypatch.setattr(allotting, "has_subsets", lambda _: False)
    assert taken(fixed) == "even: this Blender continues no sequence"


def test_the_noisy_image_holds_all_samples(steady: Any) -> None:
    """Cycles makes that pass wherever its denoiser is on, as it is in a new file."""
    steady.cycles.use_denoising = steady.view_layers[0].cycles.use_denoising = True

    def work(engine: Any, depsgraph: Any) -> Any:
        views, _ = allotted.sample_allotted(engine, depsgraph, 16, 2)
        result = engine.get_result()
        size = result.resolution_x, result.resolution_y
        return session.read_pass(result.layers[0], NOISY, "", size), views[""].picture

    noisy, picture = call_engine(steady, work)
    np.testing.assert_array_equal(noisy, picture)
    assert taken(steady, samples=16).startswith("where they pay")


def test_settings_return(steady: Any) -> None:
    render(steady, 1)
    assert not steady.render.use_border
    assert steady.cycles.samples == 8
    assert not steady.cycles.use_sample_subset


def test_stopped_in_the_middle(steady: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    stops = iter([False] * 5 + [True] * 1000)
    monkeypatch.setattr(session, "is_stopped", lambda _: next(stops))
    with pytest.raises(Cancelled):
        render(steady, 1)
    assert not steady.render.use_border
