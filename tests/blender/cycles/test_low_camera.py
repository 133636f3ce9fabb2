"""The low-resolution frame lies exactly on the full one, whatever the camera."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from xrds_blender.cycles.low_resolution import (
    CameraFrame,
    Lens,
    LowGrid,
    Region,
    widened,
)

bpy = pytest.importorskip("bpy")
SIDE = 48  # pixels of the windows in which shifts are measured

# frame size, sensor fit, lens shift, pixel aspect, camera type
CAMERAS = {
    "wide": ((1366, 768), "AUTO", (0, 0), (1, 1), "PERSP"),
    "portrait": ((766, 1365), "AUTO", (0.1, -0.2), (1, 1), "PERSP"),
    "vertical": ((1366, 769), "VERTICAL", (0.3, 0.1), (1, 1.5), "PERSP"),
    "horizontal": ((765, 1366), "HORIZONTAL", (-0.2, 0), (1.25, 1), "PERSP"),
    "ortho": ((1366, 769), "AUTO", (0.1, 0.1), (1, 1), "ORTHO"),
    "panorama": ((1366, 682), "AUTO", (0, 0), (1, 1), "PANO"),
}


def make_light_tell_position(scene: Any) -> None:
    """Directions for the world, positions for a wall: smooth, so shifts are slopes."""
    scene.world.cycles.sampling_method = "NONE"  # its map would take seconds
    tree = scene.world.node_tree
    coordinates = tree.nodes.new("ShaderNodeTexCoord").outputs["Generated"]
    tree.links.new(_lifted(tree, coordinates), tree.nodes["Background"].inputs["Color"])
    if scene.camera.data.type == "PANO":
        return
    material = bpy.data.materials.new("wall")
    if not material.node_tree:
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    light = tree.nodes.new("ShaderNodeEmission")
    position = tree.nodes.new("ShaderNodeNewGeometry").outputs["Position"]
    tree.links.new(_lifted(tree, position), light.inputs["Color"])
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(light.outputs[0], output.inputs["Surface"])
    mesh = bpy.data.meshes.new("wall")
    corners = [(-90, -90, -5), (90, -90, -5), (90, 90, -5), (-90, 90, -5)]
    mesh.from_pydata(corners, [], [(0, 1, 2, 3)])
    mesh.materials.append(material)
    scene.collection.objects.link(bpy.data.objects.new("wall", mesh))


def _lifted(tree: Any, vector: Any) -> Any:
    add = tree.nodes.new("ShaderNodeVectorMath")
    add.inputs[1].default_value = (50, 50, 50)
    tree.links.new(vector, add.inputs[0])
    return add.outputs[0]


def set_window(scene: Any, x: int, y: int) -> None:
    """A border of SIDE pixels whose top left corner is (x, y)."""
    render = scene.render
    width, height = render.resolution_x, render.resolution_y
    render.use_border = render.use_crop_to_border = True
    render.border_min_x = (x + 0.25) / width
    render.border_max_x = (x + SIDE + 0.25) / width
    render.border_min_y = (height - y - SIDE + 0.25) / height
    render.border_max_y = (height - y + 0.25) / height


def shift(low: np.ndarray, full: np.ndarray, scale: int) -> np.ndarray:
    """How far `low` lies beside the block means of `full`: (dy, dx), full pixels."""
    rows, columns = full.shape[0] // scale, full.shape[1] // scale
    blocks = full[: rows * scale, : columns * scale]
    means = blocks.reshape(rows, scale, columns, scale, -1).mean((1, 3))
    slopes = np.gradient(means, scale, axis=(0, 1))
    system = np.stack([s.ravel() for s in slopes], 1).astype(np.float64)
    assert np.abs(system).max(0).min() > 0  # else no shift could be seen
    difference = (low[:rows, :columns] - means).ravel()
    return np.linalg.lstsq(system, difference, rcond=None)[0]


@pytest.mark.parametrize("name", CAMERAS)
def test_corners_shift_less_than_a_tenth_of_a_pixel(
    name: str, empty_scene: Callable[..., Any]
) -> None:
    from xrds_blender import run_job

    (width, height), fit, lens_shift, aspect, kind = CAMERAS[name]
    scene = empty_scene(width, height, 1)
    camera = scene.camera.data
    camera.type, camera.sensor_fit = kind, fit
    camera.shift_x, camera.shift_y = lens_shift
    camera.sensor_width, camera.sensor_height = 30, 20
    # Blender 5 moved it from Cycles' settings to the camera's own.
    owner = camera if hasattr(camera, "panorama_type") else camera.cycles
    owner.panorama_type = "EQUIRECTANGULAR"
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = aspect
    make_light_tell_position(scene)

    def job(passes: Any) -> list[np.ndarray]:
        assert (passes.region.width, passes.region.height) == (SIDE, SIDE)
        full = passes.beauty(1, 16, denoise=False).radiance
        found = []
        for scale in (4, 8):
            beauty = passes.beauty(scale, 100, denoise=False)
            assert beauty.offset == (0, 0)
            found.append(shift(beauty.radiance, full, scale))
        return found

    last = [(n - SIDE) // 8 * 8 for n in (width, height)]
    for x, y in ((0, 0), last):
        set_window(scene, x, y)
        shifts = run_job(scene, job)
        assert np.abs(shifts).max() < 0.1, (x, y)


def test_a_frame_that_is_a_multiple_keeps_its_lens() -> None:
    frame = CameraFrame(1920, 1080)
    lens = Lens(36.0, 6.0, 0.1, -0.2)
    assert widened(lens, True, frame, frame.covered(4)) == lens


@pytest.mark.parametrize(("along_width", "fit"), [(True, 1368 / 1366), (False, 1.0)])
def test_the_lens_widens_with_the_fitted_side(along_width: bool, fit: float) -> None:
    frame = CameraFrame(1366, 768)
    lens = widened(Lens(36.0, 6.0, 0.0, 0.0), along_width, frame, frame.covered(4))
    assert lens.sensor == pytest.approx(36.0 * fit)
    assert lens.ortho_scale == pytest.approx(6.0 * fit)
    side = 1368 if along_width else 768
    assert lens.shift_x == pytest.approx(1 / side)  # half of two pixels
    assert lens.shift_y == 0.0


@pytest.mark.parametrize("scale", [2, 4, 8])
def test_a_region_is_covered_by_whole_pixels(scale: int) -> None:
    region = Region(13, 7, 50, 21)
    low = region.low(scale)
    grid = LowGrid(CameraFrame(100, 80), scale, low, exact=True)
    top, left = grid.offset(region)
    assert 0 <= top < scale
    assert 0 <= left < scale
    assert low.width == math.ceil((left + region.width) / scale)
    assert low.height == math.ceil((top + region.height) / scale)


def test_a_panorama_is_resampled_to_where_its_pixels_belong() -> None:
    """A ramp over the frame stays the same ramp on pixels of exactly the scale."""
    frame, scale = CameraFrame(1366, 682), 8
    width, height = frame.low_size(scale)
    grid = LowGrid(frame, scale, Region(0, 0, width, height), exact=False)
    x = (np.arange(width) + 0.5) / width * frame.width
    picture = np.broadcast_to(x[None, :, None], (height, width, 1)).astype(np.float32)
    wanted = (np.arange(width) + 0.5) * scale
    told = grid.resample(picture, grid.rendered((1366, 682)))[0, :, 0]
    # All but the last, which reaches beyond the frame.
    np.testing.assert_allclose(told[1:-1], wanted[1:-1], rtol=1e-5)
