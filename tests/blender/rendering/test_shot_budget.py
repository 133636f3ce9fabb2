"""A time budget or a quality for a shot: one choice for all its frames."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from channels import read_channels

bpy = pytest.importorskip("bpy")
pytest.importorskip("mitsuba_oidn")

from xrds_blender.command.render_file import render_file
from xrds_blender.interface.registration import ensure_registered
from xrds_blender.planning import budget
from xrds_blender.planning.budget import Costs, Curve, ErrorModel
from xrds_blender.planning.request import render_request
from xrds_blender.planning.settings import Denoising, Mode, Settings
from xrds_blender.rendering import choose, probing
from xrds_blender.rendering.explain import explain

FRAMES = [1, 2, 3]
FULL = Settings(Mode.FULL_SIZE, None, Denoising.XRDS_FAST).family
LOW = Settings(Mode.X4, None, Denoising.HIGH_FAST, "fast", 1)
# So dear that two samples are many: no test depends on how busy the machine is.
COSTS = Costs(
    fixed=1.0,
    beauty=100.0,
    guide=10.0,
    denoise=dict.fromkeys(Denoising, 10.0),
    network={LOW.network: 1.0},
)


@pytest.fixture
def probed(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The frames that were probed."""
    numbers: list[int] = []

    def probe(passes: Any, *_: Any) -> Costs:
        numbers.append(passes._depsgraph.scene_eval.frame_current)
        return COSTS

    monkeypatch.setattr(choose, "probe", probe)
    monkeypatch.setattr(choose, "with_guides", lambda costs, _: costs)
    monkeypatch.setattr(probing, "network_seconds_per_pixel", lambda *_: 1e-6)
    return numbers


@pytest.fixture
def best(monkeypatch: pytest.MonkeyPatch, probed: list[int]) -> Callable[..., None]:
    """Let one family be the best, whatever it costs."""

    def leave(family: Settings) -> None:
        psnr = dict.fromkeys((FULL, LOW), 20.0) | {family: 40.0}
        curves = {c: Curve((1, 16), (p - 4, p)) for c, p in psnr.items()}
        speed = dict.fromkeys(COSTS.network, 0.1)
        model = replace(
            budget.shipped(), errors=ErrorModel(curves), network_speed=speed
        )
        monkeypatch.setattr(budget, "shipped", lambda: model)
        monkeypatch.setattr(choose, "_networks", lambda _: tuple(COSTS.network))

    leave(FULL)
    return leave


def rendered(blend: Path, radius: int = 1, **more: Any) -> dict[str, Any]:
    job = render_request(temporal_radius=radius, **{"time_budget": 300.0, **more})
    frames = str(blend.parent / "command" / "#.exr")
    return render_file(blend, frames, job, frames=FRAMES, resume=True)


def test_a_shot_is_probed_once_and_reused(
    blend: Path, probed: list[int], best: Callable[..., None]
) -> None:
    result = rendered(blend)
    assert probed == [1]
    reused = [frame["temporal"]["frames"] for frame in result["frames"]]
    assert reused == [(1, 2), (1, 2, 3), (2, 3)]
    first, *rest = result["plan"]
    assert first["decision"] == "time budget"
    assert first["value"] == "full size, 2 samples, fast denoising"
    assert "accumulation" in [each["decision"] for each in rest]
    assert "denoise in time" not in [each["decision"] for each in rest]
    assert result["scale"] == 1
    result = rendered(blend)
    assert probed == [1]  # nothing is left to render
    assert result["kept"] == FRAMES


def test_frames_of_super_resolution_are_reused_as_well(
    blend: Path, probed: list[int], best: Callable[..., None]
) -> None:
    best(LOW)
    result = rendered(blend)
    assert result["plan"][0]["value"].startswith("fast x4")
    assert result["frames"][1]["temporal"]["frames"] == (1, 2, 3)


def test_an_animation_is_the_shot_of_the_command(
    blend: Path, probed: list[int], best: Callable[..., None]
) -> None:
    rendered(blend)
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    scene = bpy.context.scene
    scene.render.engine = "XRDS"
    scene.frame_start, scene.frame_end = 1, 3
    settings = scene.xrds
    settings.mode, settings.temporal_radius = "automatic", 1
    settings.use_time_budget, settings.time_budget = True, 300.0
    image = scene.render.image_settings
    image.file_format, image.color_depth = "OPEN_EXR", "32"
    scene.render.filepath = str(blend.parent / "f12" / "#.exr")
    bpy.ops.render.render(animation=True)
    assert probed == [1, 1]
    for number in FRAMES:
        ours, theirs = (
            read_channels(blend.parent / folder / f"{number}.exr")
            for folder in ("f12", "command")
        )
        for name in "RGB":
            np.testing.assert_allclose(ours[name], theirs[name], atol=2e-3)


def test_each_frame_is_chosen_for_where_none_is_reused(
    blend: Path, probed: list[int], best: Callable[..., None]
) -> None:
    assert rendered(blend, radius=0)["frames"][1]["temporal"] is None
    assert probed == FRAMES


@pytest.mark.parametrize("goal", [{"time_budget": 300.0}, {"quality": 36.0}])
def test_the_plan_told_is_the_one_rendered(
    blend: Path, probed: list[int], best: Callable[..., None], goal: dict[str, float]
) -> None:
    ensure_registered()
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    job = render_request(temporal_radius=1, **goal)
    told = explain(bpy.context.scene, job, FRAMES)["decisions"]
    plan = rendered(blend, **({"time_budget": None} | goal))["plan"]
    assert told[0] == plan[0]
