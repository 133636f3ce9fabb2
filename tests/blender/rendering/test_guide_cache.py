"""Guides kept between renders: when they are used, and that they are the right ones."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hostile import Trigger

bpy = pytest.importorskip("bpy")

from xrds_blender import render
from xrds_blender.cycles.settings import ALBEDO, NORMAL
from xrds_blender.interface.registration import ensure_registered
from xrds_blender.planning.plan import savings_but
from xrds_blender.rendering import guide_cache
from xrds_blender.rendering.guide_cache import CachedGuides, GuideCache
from xrds_blender.rendering.picture import Picture
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
    assert (cache_use(first), cache_use(second)) == (
        "cached 2 samples",
        "used 2 samples",
    )
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
    assert cache_use(second) == "cached 2 samples"
    assert np.abs(second.albedo.clip(0, 1) - first.albedo.clip(0, 1)).max() > 0.1


def test_what_moves_makes_them_anew_and_back_again_does_not() -> None:
    scene = traps.trap("texture", 48, 36)
    red = bpy.data.objects["Red"]
    pictures = []
    for x in (-1.2, 0.5, -1.2):
        red.location.x = x
        pictures.append(shot(scene, seed=1))
    assert [cache_use(p) for p in pictures] == [
        "cached 2 samples",
        "cached 2 samples",
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
        "cached 2 samples",
        "accumulated 4 samples",
        "accumulated 6 samples",
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
    assert cache_use(picture) == "accumulated 5 samples"


def test_the_result_holds_data_passes_of_kept_guides(written: Any) -> None:
    """Not the low-resolution picture's, which was rendered alone."""
    scene = traps.trap("texture", 48, 36)
    scene.xrds.mode = "x4"
    written(scene)
    seen: list[np.ndarray] = []

    def look(engine: Any) -> None:
        layer = engine.get_result().layers[0]
        depth = layer.passes.find_by_name("Depth", "")
        pixels = np.empty(48 * 36, np.float32)
        depth.rect.foreach_get(pixels)
        seen.append(pixels)

    from xrds_blender.rendering import render as rendering

    scene.view_layers[0].use_pass_z = True
    old = rendering._write
    try:
        rendering._write = lambda engine, *rest: (old(engine, *rest), look(engine))
        written(scene)
        bpy.data.objects["Lamp"].data.energy *= 2
        written(scene)
    finally:
        rendering._write = old
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


def test_a_folder_that_takes_no_file_costs_no_picture(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").touch()
    picture = shot(traps.trap("texture", 48, 36), guide_cache=tmp_path / "file")
    (decision,) = [d for d in picture.plan if d.decision == "guide cache"]
    assert decision.value == "cached 2 samples"
    assert decision.reason.startswith("in memory only")
    assert f"in memory only: cannot write to {tmp_path / 'file'}" in (
        capsys.readouterr().err
    )


# --- the cache alone ------------------------------------------------------------------


def stored(key: str, folder: Path) -> Path:
    return folder / "xrds-guides" / f"{key}.guides.npz"


PROBE = np.linspace(0.0, 1.0, 6, dtype=np.float32)


def some(value: float, samples: int = 1, side: int = 8) -> CachedGuides:
    pixels = np.full((side, side, 3), value, np.float32)
    passes = {("", ALBEDO): pixels, ("", NORMAL): pixels, ("", "Depth"): pixels}
    return CachedGuides(samples, passes, {"": pixels[..., 0]}, PROBE)


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
    cache.get("a", PROBE)
    cache.put("c", some(3.0))
    assert cache.get("b", PROBE) is None
    assert cache.get("a", PROBE) is not None
    cache.put("large", some(4.0, side=64))
    assert cache.get("large", PROBE) is None
    assert cache.get("c", PROBE) is not None


def test_guides_of_another_probe_count_as_none_and_as_a_hole(tmp_path: Path) -> None:
    cache = GuideCache()
    cache.put("a", some(1.0), tmp_path)
    other = PROBE + np.float32(0.01) * (PROBE > 0.9)
    stored_alone = GuideCache()
    for each in (cache, stored_alone):
        assert each.get("a", other, tmp_path) is None
        assert each.get("a", PROBE[1:], tmp_path) is None
        assert each.get("b", PROBE, tmp_path) is None
        assert each.get("a", PROBE + np.float32(1e-5), tmp_path) is not None
        assert (each.hits, each.misses, each.holes) == (1, 3, 2)


def test_a_folder_is_bounded(tmp_path: Path) -> None:
    import os

    limit = 3 * (some(0).nbytes + 2000)
    cache = GuideCache(folder_limit=limit)
    for index in range(6):
        cache.put(f"k{index}", some(index), tmp_path)
        os.utime(stored(f"k{index}", tmp_path), (index, index))
    files = sorted(stored("", tmp_path).parent.iterdir())
    assert files[-1] == stored("k5", tmp_path)
    assert sum(path.stat().st_size for path in files) <= limit
    assert stored("k0", tmp_path) not in files


def test_only_files_of_the_cache_are_removed(tmp_path: Path) -> None:
    """Whatever their names, and where somebody keeps theirs in its own folder."""
    from os import utime

    cache = GuideCache(folder_limit=some(0).nbytes + 2000)
    cache.put("k0", some(0), tmp_path)
    foreign = [
        tmp_path / "scan.npz",
        tmp_path / ".scan.npz.unfinished",
        stored("mine", tmp_path),
        stored("mine", tmp_path).with_name("mine.npz"),
        stored("mine", tmp_path).with_name(".mine.unfinished"),
    ]
    for path in foreign:
        np.savez(path.open("wb"), scan=np.ones(9000))
        utime(path, (0, 0))
    cache.put("k1", some(1), tmp_path)
    assert all(path.exists() for path in foreign)
    assert stored("k1", tmp_path).exists()
    assert not stored("k0", tmp_path).exists()


def changed(path: Path, change: Callable[[dict[str, Any]], object]) -> None:
    """Write a file of the cache anew with other arrays."""
    with np.load(path) as file:
        arrays = dict(file)
    change(arrays)
    with path.open("wb") as file:
        np.savez(file, **arrays)


def half(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:1000])  # as a full disk leaves it


def flipped_bit(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)


def no_number(path: Path) -> None:
    changed(path, lambda a: a["/" + ALBEDO].__setitem__((3, 4, 0), np.nan))


def of_one_size_more(path: Path) -> None:
    changed(path, lambda a: a.update({n: np.pad(x, 1) for n, x in a.items() if x.ndim}))


def of_another_shape(path: Path) -> None:
    changed(path, lambda a: a.update({"/" + NORMAL: a["/" + NORMAL][:, :5]}))


def without_normals(path: Path) -> None:
    changed(path, lambda a: a.pop("/" + NORMAL))


def of_text(path: Path) -> None:
    changed(path, lambda a: a.update({"/" + ALBEDO: np.full((8, 8, 3), "a")}))


def of_another_key(path: Path) -> None:
    GuideCache().put("other", some(2.0), path.parents[1])
    path.write_bytes(stored("other", path.parents[1]).read_bytes())


def test_code_in_a_file_does_not_run(tmp_path: Path) -> None:
    GuideCache().put("key", some(1.0), tmp_path)
    mark = tmp_path / "it ran"
    path = stored("key", tmp_path)
    changed(path, lambda a: a.update({"/Depth": np.array([Trigger(mark)], object)}))
    assert GuideCache().get("key", PROBE, tmp_path) is None
    path.write_bytes(pickle.dumps(Trigger(mark)))
    assert GuideCache().get("key", PROBE, tmp_path) is None
    assert not mark.exists()


@pytest.mark.parametrize(
    "damage",
    [
        half,
        flipped_bit,
        no_number,
        of_one_size_more,
        of_another_shape,
        without_normals,
        of_text,
        of_another_key,
    ],
)
def test_a_damaged_file_is_named_and_replaced(
    tmp_path: Path, damage: Callable[[Path], None], capsys: pytest.CaptureFixture[str]
) -> None:
    GuideCache().put("key", some(1.0), tmp_path)
    path = stored("key", tmp_path)
    assert GuideCache().get("key", PROBE, tmp_path, (8, 8)) is not None
    damage(path)
    cache = GuideCache()
    assert not capsys.readouterr().err
    assert cache.get("key", PROBE, tmp_path, (8, 8)) is None
    told = capsys.readouterr().err
    assert str(path) in told
    assert "damaged" in told
    cache.put("key", some(3.0), tmp_path)
    found = GuideCache().get("key", PROBE, tmp_path, (8, 8))
    assert found is not None
    assert found.passes["", ALBEDO].mean() == 3.0


def test_bad_pixels_are_kept_in_memory_alone(tmp_path: Path) -> None:
    cache = GuideCache()
    cache.put("key", some(float("nan")), tmp_path)
    assert cache.get("key", PROBE) is not None
    assert not stored("key", tmp_path).exists()
