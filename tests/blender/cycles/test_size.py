"""The sizes that `xrds render --resume` expects are those that Blender renders."""

from __future__ import annotations

from typing import Any

import bpy
import pytest

from xrds_blender import run_job
from xrds_blender.cycles.passes import CyclesPasses
from xrds_blender.cycles.view import frame_size, picture_size

SIZES = [(1280, 720), (1920, 1080), (333, 777)]


def result_size(passes: CyclesPasses) -> tuple[int, int]:
    """Of the result that Blender itself made for this render."""
    result = passes._engine.get_result()
    return result.resolution_x, result.resolution_y


@pytest.fixture
def render() -> Any:
    bpy.ops.wm.read_factory_settings()
    return bpy.context.scene.render


def resize(render: Any, size: tuple[int, int], percentage: int) -> None:
    render.resolution_x, render.resolution_y = size
    render.resolution_percentage = percentage


@pytest.mark.parametrize("size", SIZES)
def test_every_percentage_is_cut_off_as_an_integer(
    render: Any, size: tuple[int, int]
) -> None:
    for percentage in range(1, 101):
        resize(render, size, percentage)
        expected = size[0] * percentage // 100, size[1] * percentage // 100
        assert frame_size(render) == picture_size(render) == expected


def test_where_a_product_of_floats_would_lose_a_row(render: Any) -> None:
    resize(render, (1280, 720), 70)
    assert picture_size(render) == (896, 504)
    assert int(720 * 0.7) == 503


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("percentage", [1, 7, 29, 58, 70, 99])
def test_blender_renders_that_size(
    render: Any, size: tuple[int, int], percentage: int
) -> None:
    resize(render, size, percentage)
    assert picture_size(render) == run_job(bpy.context.scene, result_size)


@pytest.mark.parametrize("percentage", [13, 70, 100])
def test_blender_renders_that_border(render: Any, percentage: int) -> None:
    resize(render, (333, 777), percentage)
    render.use_border = render.use_crop_to_border = True
    render.border_min_x, render.border_max_x = 0.123, 0.771
    render.border_min_y, render.border_max_y = 0.29, 0.9
    assert picture_size(render) == run_job(bpy.context.scene, result_size)
