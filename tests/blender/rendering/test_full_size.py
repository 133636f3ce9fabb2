"""Scale 1: Cycles' samples at full size, denoised in this process."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from channels import read_channels

bpy = pytest.importorskip("bpy")
pytest.importorskip("mitsuba_oidn")

from xrds_blender import render, run_job
from xrds_blender.cycles import session
from xrds_blender.rendering import loading
from xrds_core.denoising import Denoiser
from xrds_core.errors import Cancelled, UsageError, XRDSError


def noisy_passes(scene: Any, seed: int) -> Any:
    """Noisy radiance, alpha, albedo and normal by the passes of another render."""
    return run_job(
        scene,
        lambda passes: (
            passes.beauty(1, denoise=False, seed=seed),
            passes.low_samples(1, seed=seed)[""].samples,
        ),
    )


def test_the_picture_is_cycles_samples_denoised(life: Any) -> None:
    picture = render(life, 1, seed=3)
    beauty, samples = noisy_passes(life, 3)
    noisy = np.dstack((beauty.radiance, beauty.alpha))
    expected = Denoiser()(noisy, samples.albedo, samples.normal).radiance
    np.testing.assert_allclose(picture.radiance, expected[..., :3], atol=1e-5)
    np.testing.assert_array_equal(picture.alpha, beauty.alpha)
    assert np.abs(picture.radiance - beauty.radiance).mean() > 1e-3
    assert picture.seconds["denoise"] > 0.0
    assert picture.seconds["network"] == 0.0
    assert [d.value for d in picture.plan[:2]] == ["full size", "high"]


@pytest.mark.skipif(bpy.app.version < (4, 3), reason="Cycles has no blue noise")
@pytest.mark.parametrize("choices", [{"scale": 1}, {"scale": 2}, {"plain": True}])
def test_files_with_the_classic_pattern_get_blue_noise_unless_plain(
    life: Any, choices: dict[str, Any]
) -> None:
    made = []
    for pattern in ("AUTOMATIC", "TABULATED_SOBOL"):
        life.cycles.sampling_pattern = pattern
        made.append(render(life, seed=3, **choices).radiance)
        assert life.cycles.sampling_pattern == pattern
    assert np.array_equal(*made) is ("plain" not in choices)


@pytest.mark.parametrize("quality", ["best", "medium", "balanced", "fast"])
def test_qualities_differ(life: Any, quality: str) -> None:
    high = render(life, 1, seed=3).radiance
    other = render(life, 1, seed=3, denoise=quality).radiance
    assert 1e-5 < np.abs(high - other).mean() < 0.1


def test_an_unknown_quality_is_named(life: Any) -> None:
    with pytest.raises(UsageError, match="denoise 'finest' is not one of best"):
        render(life, 1, denoise="finest")


def channels(scene: Any, engine: str, path: Path) -> dict[str, np.ndarray]:
    """Every channel of a multilayer EXR that Blender writes."""
    scene.render.engine = engine
    scene.xrds.mode = "full_size"
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format, settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    return read_channels(path)


@pytest.fixture
def full_of_passes(life: Any) -> Any:
    layer = life.view_layers[0]
    for name in ("z", "position", "normal", "uv", "object_index", "cryptomatte_object"):
        setattr(layer, f"use_pass_{name}", True)
    layer.use_pass_diffuse_direct = layer.use_pass_glossy_indirect = True
    life.render.film_transparent = True
    life.render.use_border = life.render.use_crop_to_border = True
    life.render.border_min_x, life.render.border_max_x = 0.21, 0.83
    life.render.border_min_y, life.render.border_max_y = 0.1, 0.77
    return life


def test_every_other_pass_is_cycles_own(full_of_passes: Any, tmp_path: Path) -> None:
    full_of_passes.cycles.use_denoising = False
    own = channels(full_of_passes, "CYCLES", tmp_path / "cycles.exr")
    ours = channels(full_of_passes, "XRDS", tmp_path / "xrds.exr")
    assert set(own) <= set(ours)
    changed = {
        name for name, pixels in own.items() if not np.array_equal(pixels, ours[name])
    }
    combined = {name for name in own if ".Combined." in name and name[-1] in "RGB"}
    assert combined
    assert changed == combined


def test_noisy_image_is_there_when_asked_for(life: Any, tmp_path: Path) -> None:
    if not session.has_denoiser():
        pytest.skip("Cycles cannot render it here without its denoiser")
    life.cycles.use_denoising = True
    life.view_layers[0].cycles.denoising_store_passes = True
    ours = channels(life, "XRDS", tmp_path / "xrds.exr")
    own = channels(life, "CYCLES", tmp_path / "cycles.exr")
    (name,) = [n for n in ours if n.endswith("Noisy Image.R")]
    np.testing.assert_array_equal(ours[name], own[name])
    (combined,) = [n for n in ours if n.endswith("Combined.R")]
    assert not np.array_equal(ours[combined], ours[name])


def test_plain_is_cycles_to_the_bit(life: Any, written: Callable[..., Any]) -> None:
    life.xrds.mode = "cycles_only"
    np.testing.assert_array_equal(written(life), written(life, "CYCLES"))


def test_both_views_are_denoised(life: Any) -> None:
    life.render.use_multiview = True
    life.camera.data.stereo.interocular_distance = 0.5
    left = render(life, 1, seed=1).radiance
    life.render.use_multiview = False
    np.testing.assert_allclose(left.mean(), render(life, 1).radiance.mean(), rtol=0.2)


def test_cancelling_writes_nothing(life: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    written = []
    calls = iter([False] * 2 + [True] * 1000)
    monkeypatch.setattr(session, "is_stopped", lambda _: next(calls))
    monkeypatch.setattr(session, "write_pass", lambda *_: written.append(1))
    with pytest.raises(Cancelled):
        render(life, 1)
    assert not written


def test_a_missing_library_costs_no_render(
    life: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    loading._open_denoiser.cache_clear()
    monkeypatch.setitem(sys.modules, "mitsuba_oidn", None)
    monkeypatch.setattr(session, "run", lambda *_: pytest.fail("rendered"))
    with pytest.raises(XRDSError, match="pip install mitsuba-oidn"):
        render(life, 1)


@pytest.mark.parametrize("has_own", [True, False])
def test_the_low_resolution_picture_is_denoised_in_any_blender(
    life: Any, network: Any, monkeypatch: pytest.MonkeyPatch, has_own: bool
) -> None:
    monkeypatch.setattr(session, "has_denoiser", lambda: has_own)
    picture = render(life, 2, samples=2, seed=1)
    (call,) = network[0].calls
    rough, smooth = (
        np.abs(np.diff(x[..., :3], axis=0)).mean()
        for x in (call["noisy"], call["radiance"])
    )
    assert smooth < 0.9 * rough
    (decision,) = [each for each in picture.plan if each.decision == "denoise"]
    assert decision.value == "low resolution"
    assert picture.seconds["denoise"] > 0.0
