"""Guides kept between renders: when they are used, and that they are the right ones."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from xrds_blender import render
from xrds_blender.cycles.pass_names import ALBEDO, NORMAL
from xrds_blender.frame import guide_cache
from xrds_blender.frame.guide_cache import CachedGuides, GuideCache
from xrds_blender.frame.job import Picture
from xrds_blender.interface.registration import ensure_registered
from xrds_blender.planning.plan import savings_but
from xrds_lab.studio import traps


@pytest.fixture(autouse=True)
def registered(network: Any) -> None:
    ensure_registered()


def shot(scene: Any, **choices: Any) -> Picture:
    return render(scene, 2, samples=1, guide_samples=2, **choices)


def cache_use(picture: Picture) -> str:
    return next(d.value for d in picture.plan if d.decision == "guide cache")


def test_a_relit_scene_uses_the_guides_of_before() -> None:
    scene = traps.trap("texture", 48, 36)
    first = shot(scene)
    bpy.data.objects["Lamp"].data.energy *= 3
    second = shot(scene)
    assert (cache_use(first), cache_use(second)) == ("kept 2 samples", "used 2 samples")
    np.testing.assert_array_equal(second.albedo, first.albedo)
    np.testing.assert_array_equal(second.normal, first.normal)
    assert second.radiance.mean() > 2 * first.radiance.mean()
    assert len(second.plan) == len(first.plan) - 1  # no second session to tell of


@pytest.mark.parametrize("name", ["mirrored_lamp", "seen_lamp"])
def test_a_lamp_that_is_seen_makes_them_anew(name: str) -> None:
    scene = traps.trap(name, 48, 36)
    first = shot(scene)
    bpy.data.objects["Lamp"].data.energy /= 40
    second = shot(scene)
    assert cache_use(second) == "kept 2 samples"
    assert np.abs(second.albedo.clip(0, 1) - first.albedo.clip(0, 1)).max() > 0.1


def test_what_moves_makes_them_anew_and_back_again_does_not() -> None:
    scene = traps.trap("texture", 48, 36)
    red = bpy.data.objects["Red"]
    pictures = []
    for x in (-1.2, 0.5, -1.2):
        red.location.x = x
        pictures.append(shot(scene, seed=1))
    assert [cache_use(p) for p in pictures] == [
        "kept 2 samples",
        "kept 2 samples",
        "used 2 samples",
    ]
    assert np.abs(pictures[0].albedo - pictures[1].albedo).max() > 0.1
    np.testing.assert_array_equal(pictures[0].albedo, pictures[2].albedo)
    guide_cache.CACHE.clear()
    np.testing.assert_array_equal(shot(scene, seed=1).albedo, pictures[2].albedo)


def test_samples_add_up_to_the_limit(network: Any) -> None:
    scene = traps.trap("texture", 48, 36)
    pictures = [shot(scene, seed=1, guide_limit=6) for _ in range(4)]
    assert [cache_use(p) for p in pictures] == [
        "kept 2 samples",
        "gathered 4 samples",
        "gathered 6 samples",
        "used 6 samples",
    ]
    # those of the cache decide whether their noise is filtered
    told_samples = [call["guide_samples"] for made in network for call in made.calls]
    assert told_samples == [2, 4, 6, 6]
    others = savings_but("guide cache")
    clean = render(scene, 2, samples=1, guide_samples=64, seed=9, savings=others).albedo
    noise = [np.abs(p.albedo - clean).mean() for p in pictures]
    assert noise[2] < 0.8 * noise[0]


def test_more_samples_asked_for_are_rendered_beside_those_kept() -> None:
    scene = traps.trap("texture", 48, 36)
    shot(scene)
    picture = render(scene, 2, samples=1, guide_samples=5)
    assert cache_use(picture) == "gathered 5 samples"


def test_the_result_holds_data_passes_of_kept_guides(written: Any) -> None:
    """Not the low-resolution picture's, which was rendered alone."""
    scene = traps.trap("texture", 48, 36)
    scene.xrds.scale = "4"
    written(scene)
    seen: list[np.ndarray] = []

    def look(engine: Any) -> None:
        layer = engine.get_result().layers[0]
        depth = layer.passes.find_by_name("Depth", "")
        pixels = np.empty(48 * 36, np.float32)
        depth.rect.foreach_get(pixels)
        seen.append(pixels)

    from xrds_blender.frame.super_resolution import _Enlargement

    scene.view_layers[0].use_pass_z = True
    old = _Enlargement.write
    try:
        _Enlargement.write = lambda part, *rest: (old(part, *rest), look(part.engine))
        written(scene)
        bpy.data.objects["Lamp"].data.energy *= 2
        written(scene)
    finally:
        _Enlargement.write = old
    np.testing.assert_array_equal(seen[0], seen[1])
    assert seen[0].min() > 1.0


def test_a_pass_that_holds_light_is_never_kept() -> None:
    scene = traps.trap("texture", 48, 36)
    scene.view_layers[0].use_pass_emit = True
    assert [cache_use(shot(scene)) for _ in range(2)] == ["not used"] * 2


def test_a_picture_may_be_changed_by_its_owner() -> None:
    scene = traps.trap("texture", 48, 36)
    for _ in range(2):
        shot(scene).albedo[:] = 7.0
    assert shot(scene).albedo.max() < 2.0


def test_without_the_cache_every_time_is_rendered() -> None:
    scene = traps.trap("texture", 48, 36)
    others = savings_but("guide cache")
    assert [cache_use(shot(scene, savings=others)) for _ in range(2)] == ["off"] * 2


def test_a_folder_serves_another_process(tmp_path: Path) -> None:
    scene = traps.trap("texture", 48, 36)
    first = shot(scene, guide_cache=tmp_path)
    guide_cache.CACHE.clear()
    second = shot(scene, guide_cache=tmp_path)
    assert cache_use(second) == "used 2 samples"
    np.testing.assert_array_equal(second.albedo, first.albedo)
    (file,) = tmp_path.glob("*.npz")
    file.write_bytes(file.read_bytes()[:1000])  # as a full disk leaves it
    guide_cache.CACHE.clear()
    assert cache_use(shot(scene, guide_cache=tmp_path)) == "kept 2 samples"


def test_a_folder_that_takes_no_file_costs_no_picture(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    picture = shot(traps.trap("texture", 48, 36), guide_cache=tmp_path / "file")
    (decision,) = [d for d in picture.plan if d.decision == "guide cache"]
    assert decision.value == "kept 2 samples"
    assert decision.reason.startswith("in memory only")


# --- the cache alone ------------------------------------------------------------------


def some(value: float, samples: int = 1, side: int = 8) -> CachedGuides:
    pixels = np.full((side, side, 3), value, np.float32)
    passes = {("", ALBEDO): pixels, ("", NORMAL): pixels, ("", "Depth"): pixels}
    return CachedGuides(samples, passes, {"": pixels[..., 0]})


def test_the_mean_is_weighted_by_samples() -> None:
    merged = some(1.0, 1).merged(some(5.0, 3))
    assert merged.samples == 4
    assert merged.passes["", ALBEDO].mean() == 4.0
    assert merged.alphas[""].mean() == 4.0
    assert merged.passes["", "Depth"].mean() == 1.0


def test_memory_is_bounded_and_the_oldest_goes() -> None:
    cache = GuideCache(memory_limit=int(2.5 * some(0).nbytes))
    cache.put("a", some(1.0))
    cache.put("b", some(2.0))
    cache.get("a")
    cache.put("c", some(3.0))
    assert cache.get("b") is None
    assert cache.get("a") is not None
    cache.put("large", some(4.0, side=64))
    assert cache.get("large") is None
    assert cache.get("c") is not None


def test_a_folder_is_bounded(tmp_path: Path) -> None:
    import os

    limit = 3 * (some(0).nbytes + 2000)
    cache = GuideCache(folder_limit=limit)
    for index in range(6):
        cache.put(f"k{index}", some(index), tmp_path)
        os.utime(tmp_path / f"k{index}.npz", (index, index))
    files = sorted(path.name for path in tmp_path.iterdir())
    assert files[-1] == "k5.npz"
    assert sum(path.stat().st_size for path in tmp_path.iterdir()) <= limit
    assert "k0.npz" not in files
