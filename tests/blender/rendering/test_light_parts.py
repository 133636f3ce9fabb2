"""Parts of the light beside the picture: finished with it, they add up to it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from channels import read_channels
from compositing import empty_compositor
from light_passes import with_light_passes

bpy = pytest.importorskip("bpy")
pytest.importorskip("mitsuba_oidn")

from xrds_blender import render
from xrds_blender.command import main
from xrds_blender.cycles.settings import has_subsets
from xrds_blender.interface.properties import request_of
from xrds_blender.planning.request import render_request
from xrds_blender.rendering.pace import obstacles
from xrds_blender.rendering.shot import render_shot
from xrds_blender.scene.contents import passes_looked_at
from xrds_core.denoising.light_passes import read_renderers
from xrds_core.errors import UsageError

Planes = Mapping[str, np.ndarray]
CYCLES = next(x for x in read_renderers() if x.name == "Cycles")


@pytest.fixture
def lit(life: Any) -> Any:
    life.cycles.samples = 4
    return with_light_passes(life)


@pytest.fixture
def shot(blend: Path) -> Path:
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    with_light_passes(bpy.context.scene)
    bpy.ops.wm.save_mainfile()
    return blend


def lobes(parts: Planes) -> np.ndarray:
    """The sum of all lobes."""
    light = []
    for lobe in CYCLES.lobes:
        name = next((x for x in lobe.names if x in parts), None)
        colour = next((x for x in lobe.colour if x in parts), None)
        if name is not None:
            light.append(parts[name] * (parts[colour] if colour else 1.0))
    return np.asarray(sum(light))


def groups(parts: Planes) -> np.ndarray:
    return np.asarray(sum(x for name, x in parts.items() if "Combined_" in name))


def check(parts: Planes, picture: np.ndarray) -> None:
    for found in (lobes(parts), groups(parts)):
        assert found == pytest.approx(picture, rel=1e-3, abs=1e-4)
    assert min(part.min() for part in parts.values()) >= 0.0


def test_parts_of_a_still_add_up_to_the_same_picture(lit: Any) -> None:
    plain = render(lit, 1, seed=3)
    found = render(lit, 1, seed=3, passes=("all",))
    assert plain.parts == {}
    assert np.array_equal(found.radiance, plain.radiance)
    check(found.parts, found.radiance)


def test_what_is_wanted_by_name(lit: Any) -> None:
    found = render(lit, 1, passes=("lamps", "Emission"))
    assert sorted(found.parts)[0] == "Combined_lamps"
    assert len(found.parts) == 2
    with pytest.raises(UsageError, match=r"no light 'rim'; it holds .*Combined_lamps"):
        render(lit, 1, passes=("rim",))


def finished(shot: Path, **job: Any) -> dict[int, Any]:
    bpy.ops.wm.open_mainfile(filepath=str(shot))
    request = render_request(1, **{"temporal_radius": 2, "passes": ("all",)} | job)
    return dict(render_shot(bpy.context.scene, request, range(1, 6)))


def test_parts_of_a_shot_add_up_to_the_same_pictures(shot: Path) -> None:
    plain, found = finished(shot, passes=("none",)), finished(shot)
    for number, picture in found.items():
        assert np.array_equal(picture.radiance, plain[number].radiance)
        check(picture.parts, picture.radiance)


def test_neighbours_make_better_parts(shot: Path) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(shot))
    scene = bpy.context.scene
    scene.frame_set(3)
    truth = lobes_of_direct(render(scene, 1, samples=256, passes=("all",)).parts)
    shared, alone = (
        np.square(lobes_of_direct(finished(shot, **job)[3].parts) - truth).mean()
        for job in ({}, {"temporal_radius": 0})
    )
    assert shared < 0.8 * alone


def lobes_of_direct(parts: Planes) -> np.ndarray:
    """The light of Diffuse Direct."""
    return lobes({name: x for name, x in parts.items() if "Diff" in name[:4]})


@pytest.mark.skipif(not has_subsets(bpy.context.scene), reason="no sample subsets")
def test_frames_with_fewer_samples_have_parts_too(
    shot: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(obstacles, "FEWEST_FRAMES", 5)
    bpy.ops.wm.open_mainfile(filepath=str(shot))
    bpy.context.scene.cycles.samples = 16
    bpy.ops.wm.save_mainfile()
    for picture in finished(shot, same_picture=True).values():
        check(picture.parts, picture.radiance)


def multilayer(scene: Any, path: Path) -> Planes:
    """Passes (H, W, 3) that the engine leaves in a file."""
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format, settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
    scene.render.filepath, scene.render.engine = str(path), "XRDS"
    scene.xrds.mode = "full_size"
    bpy.ops.render.render(write_still=True)
    planes = read_channels(path)
    names = {name[:-2] for name in planes if name.endswith(".R")}
    return {
        name.partition(".")[2]: np.dstack([planes[f"{name}.{x}"] for x in "RGB"])
        for name in names
    }


def test_files_of_the_engine_hold_them(lit: Any, tmp_path: Path) -> None:
    found = dict(multilayer(lit, tmp_path / "all.exr"))
    picture = found.pop("Combined")
    lit.xrds.passes = "none"
    plain = multilayer(lit, tmp_path / "none.exr")
    assert np.array_equal(picture, plain["Combined"])
    light = {k: x for k, x in found.items() if k in all_names() or "Combined_" in k}
    check(light, picture)
    assert not np.array_equal(groups(plain), groups(found))


def all_names() -> set[str]:
    return {name for lobe in CYCLES.lobes for name in (*lobe.names, *lobe.colour)}


def test_light_that_nobody_looks_at_stays_as_it_is(lit: Any) -> None:
    assert passes_looked_at(lit) == ("none",)
    assert request_of(lit.xrds).passes == ("none",)
    lit.xrds.passes = "groups"
    assert request_of(lit.xrds).passes == ("groups",)


@pytest.mark.parametrize(("socket", "expected"), [(0, "none"), (-1, "all")])
def test_the_compositor_looks_at_light(lit: Any, socket: int, expected: str) -> None:
    tree = empty_compositor(lit)
    layers = tree.nodes.new("CompositorNodeRLayers")
    viewer = tree.nodes.new("CompositorNodeViewer")
    names = ["Image", *(x.name for x in layers.outputs if "Combined_" in x.name)]
    tree.links.new(layers.outputs[names[socket]], viewer.inputs[0])
    assert passes_looked_at(lit) == (expected,)
    lit.render.use_compositing = False
    assert passes_looked_at(lit) == ("none",)


def test_the_command_writes_them(shot: Path) -> None:
    out = shot.parent / "out.exr"
    words = ["render", str(shot), "--scale", "1", "--passes", "groups", "-o", str(out)]
    assert main.main(words) == 0
    planes = read_channels(out)
    picture = np.dstack([planes[x] for x in "RGB"])
    names = ("Combined_lamps", "Combined_world")
    parts = {name: np.dstack([planes[f"{name}.{x}"] for x in "RGB"]) for name in names}
    assert groups(parts) == pytest.approx(picture, rel=1e-3, abs=1e-4)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (
            ("--scale", "2", "-o", "o.exr"),
            "--passes cannot be had with --scale above 1",
        ),
        (("--plain", "-o", "o.exr"), "--passes cannot be had with"),
        (
            ("--scale", "1", "-o", "o.png"),
            "--passes needs an output that ends in .exr, not ",
        ),
        (
            ("--scale", "1", "-o", "o.exr", "--sample-cache", "c"),
            "--sample-cache holds no parts of the light",
        ),
    ],
)
def test_what_cannot_be_is_said(
    shot: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    words: tuple[str, ...],
    told: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main.main(["render", str(shot), "--passes", "all", *words]) == 2
    assert told in capfd.readouterr().err
    assert not list(tmp_path.glob("o.*"))
