"""How much neighbour frames count, in a scene and on its objects."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from channels import read_channels

bpy = pytest.importorskip("bpy")
pytest.importorskip("mitsuba_oidn")

from xrds_blender.command.render_file import render_file
from xrds_blender.internals.lifetimes import RENDER_JOB
from xrds_blender.planning.request import Request, render_request
from xrds_blender.rendering import sampling, shot
from xrds_blender.rendering.blender_job import call_engine
from xrds_blender.rendering.explain import explain
from xrds_blender.rendering.render import method_of
from xrds_blender.rendering.sampling import has_neighbours, noisy_frame
from xrds_blender.scene.keyframes import curves
from xrds_blender.scene.remarks import remarks
from xrds_blender.scene.strength import strength_of
from xrds_core.errors import UsageError

FRAMES = [1, 2, 3]


@pytest.fixture(params=["moving", "still"])
def life(request: pytest.FixtureRequest, life: Any) -> Any:
    """The still life under a camera that moves, and one that does not.

    Under the latter frames continue one sequence: most take no first sample.
    """
    life.xrds.mode, life.xrds.temporal_radius, life.xrds.denoise = (
        "full_size",
        1,
        "fast",
    )
    life.cycles.samples, life.cycles.use_adaptive_sampling = 2, False
    life.frame_end = FRAMES[-1]
    if request.param == "moving":
        for frame in (1, 3):
            life.camera.location.x = 0.05 * frame
            life.camera.keyframe_insert("location", frame=frame)
    return life


@pytest.fixture
def red(life: Any) -> Any:
    return life.objects["Red"]


def request(**more: Any) -> Request:
    return render_request(
        **{"scale": 1, "temporal_radius": 1, "denoise": "fast"} | more
    )


def strengths(scene: Any, number: int = 2) -> np.ndarray | None:
    """The plane that a frame is sampled with."""
    scene.frame_set(number)
    frames, _ = call_engine(
        scene, lambda *given: noisy_frame(*given, request(), number)
    )
    return frames[""].strength


def animated(scene: Any, folder: Path) -> dict[int, Mapping[str, np.ndarray]]:
    """The files that the engine writes of an animation, by frame: their channels."""
    scene.render.engine = "XRDS"
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format, settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
    scene.render.filepath = str(folder / "#.exr")
    RENDER_JOB.end()
    bpy.ops.render.render(animation=True)
    return {n: read_channels(folder / f"{n}.exr") for n in FRAMES}


def combined(channels: Mapping[str, np.ndarray]) -> np.ndarray:
    names = [x for x in channels if x.endswith(tuple(f"Combined.{c}" for c in "RGB"))]
    return np.dstack([channels[x] for x in sorted(names)])


def test_an_object_without_neighbours_is_the_frame_alone_to_the_bit(
    life: Any, red: Any
) -> None:
    red.xrds_strength = 0.0
    method = method_of(request())
    first, own, last = (shot._sample(life, method, FRAMES, n) for n in FRAMES)
    plane = own.views[""].strengths()
    assert 0.1 < (plane == 0.0).mean() < 0.5
    assert set(np.unique(plane)) == {0.0, 1.0}
    mixed = method.finish(own, [first, last], "").pixels
    alone = method.finish(own, [], "").pixels
    assert np.array_equal(mixed[plane == 0.0], alone[plane == 0.0])
    assert (mixed != alone)[plane == 1.0, :3].mean() > 0.9
    red.xrds_strength = 1.0
    shared = [shot._sample(life, method, FRAMES, n) for n in FRAMES]
    picture = method.finish(shared[1], [shared[0], shared[2]], "").pixels
    assert np.abs(picture - mixed)[plane == 1.0].mean() < 0.02


def test_the_engine_gives_the_same(life: Any, red: Any, tmp_path: Path) -> None:
    """A frame at which the scene's own strength is keyed to 0 is all of it alone."""
    for number, value in ((1, 1.0), (2, 0.0), (3, 1.0)):
        life.xrds.strength = value
        life.xrds.keyframe_insert("strength", frame=number)
    alone = animated(life, tmp_path / "alone")[2]
    life.animation_data_clear()
    life.xrds.strength = 1.0
    red.xrds_strength = 0.0
    mixed = animated(life, tmp_path / "mixed")[2]
    life.frame_set(2)
    thing = strengths(life) == 0.0
    one, two = combined(mixed), combined(alone)
    assert np.array_equal(one[thing], two[thing])
    assert (one != two)[~thing].mean() > 0.9


def test_an_index_of_the_file_stays_as_it_is(
    life: Any, red: Any, tmp_path: Path
) -> None:
    """What the pass shows, and what materials make of it."""
    for number, item in enumerate(life.objects):
        item.pass_index = 7 * number
    shader = red.active_material.node_tree
    info = shader.nodes.new("ShaderNodeObjectInfo")
    scale = shader.nodes.new("ShaderNodeMath")
    scale.operation, scale.inputs[1].default_value = "MULTIPLY", 0.1
    shader.links.new(info.outputs["Object Index"], scale.inputs[0])
    base = next(x for x in shader.nodes if x.type == "BSDF_PRINCIPLED")
    shader.links.new(scale.outputs[0], base.inputs["Base Color"])
    layer = life.view_layers[0]
    layer.use_pass_object_index = layer.use_pass_z = True
    plain = animated(life, tmp_path / "plain")
    red.xrds_strength = 0.0
    life.objects["Mirror"].xrds_strength = 0.4
    found = animated(life, tmp_path / "found")
    assert [item.pass_index for item in life.objects] == [7 * n for n in range(5)]
    for number, channels in plain.items():
        assert channels.keys() == found[number].keys()
        own = [x for x in channels if "Combined" not in x]
        assert any("Index" in x for x in own)
        for name in own:
            assert np.array_equal(channels[name], found[number][name]), name
    layer.use_pass_object_index = False
    assert not any("Index" in x for x in animated(life, tmp_path / "none")[2])


@pytest.mark.parametrize("blurred", [False, True])
def test_nothing_else_of_a_frame_changes(life: Any, red: Any, blurred: bool) -> None:
    """Its noise is the same, in the second frame of a session as well."""
    life.render.use_motion_blur = blurred
    for frame in (1, 3):
        red.location.z = frame
        red.keyframe_insert("location", frame=frame)

    def sampled(number: int) -> Any:
        life.frame_set(number)
        job = request()
        return call_engine(life, lambda *given: noisy_frame(*given, job, number))[0][""]

    plain = [sampled(number) for number in FRAMES]
    red.xrds_strength = 0.0
    for number, frame in zip(FRAMES, plain, strict=True):
        found = sampled(number)
        assert found.strength is not None
        for name, pixels in frame.given.items():
            assert np.array_equal(pixels, found.given[name]), name


def test_it_costs_no_render_where_neighbours_count(
    life: Any, red: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr(sampling, "sample_strengths")
    life.objects["Lamp"].xrds_strength = 0.0  # no camera's ray hits it
    empty = bpy.data.objects.new("Empty", None)
    empty.xrds_strength = 0.0
    life.collection.objects.link(empty)
    assert strengths(life) is None
    red.xrds_strength = 0.5
    with pytest.raises(NameError):
        strengths(life)


def test_what_is_instanced_has_the_strength_of_its_object(life: Any) -> None:
    """By a collection and by geometry nodes, without touching the instancer."""
    kinds = bpy.data.collections.new("Kinds")
    card = bpy.data.objects.new("Card", life.objects["Red"].data)
    kinds.objects.link(card)
    card.xrds_strength = 0.25
    instancer = bpy.data.objects.new("Instancer", None)
    instancer.instance_type, instancer.instance_collection = "COLLECTION", kinds
    instancer.location, instancer.xrds_strength = (-1.5, -3.0, 3.0), 0.0
    life.collection.objects.link(instancer)
    plane = strengths(life)
    assert set(np.unique(plane)) == {np.float32(0.25), np.float32(1.0)}
    by_collection = int((plane == 0.25).sum())
    life.collection.objects.link(by_nodes(card))
    assert (strengths(life) == 0.25).sum() > 1.5 * by_collection


def by_nodes(card: Any) -> Any:
    """An object whose modifier instances the card."""
    tree = bpy.data.node_groups.new("Cards", "GeometryNodeTree")
    tree.interface.new_socket(
        "Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry"
    )
    info = tree.nodes.new("GeometryNodeObjectInfo")
    info.inputs["Object"].default_value = card
    info.inputs["As Instance"].default_value = True
    out = tree.nodes.new("NodeGroupOutput")
    tree.links.new(info.outputs["Geometry"], out.inputs[0])
    item = bpy.data.objects.new("Nodes", bpy.data.meshes.new("Nodes"))
    item.modifiers.new("Cards", "NODES").node_group = tree
    item.location = (1.5, -3.0, 3.0)
    return item


def test_many_objects_share_the_indices_of_their_strengths(life: Any) -> None:
    """Cycles has 32768 indices; there may be more objects."""
    mesh = life.objects["Red"].data
    for number in range(200):
        item = bpy.data.objects.new("Far", mesh)
        item.location, item.xrds_strength = (0, 0, -50), 0.5
        item.pass_index = number
        life.collection.objects.link(item)
    life.objects["Mirror"].xrds_strength = 0.125
    assert set(np.unique(strengths(life))) == {np.float32(0.125), np.float32(1.0)}


def test_an_objects_strength_can_be_keyed(life: Any, red: Any) -> None:
    for number, value in ((1, 0.0), (3, 0.5)):
        red.xrds_strength = value
        red.keyframe_insert("xrds_strength", frame=number)
    for curve in curves(red.animation_data.action):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"
    seen = [np.min(strengths(life, number)) for number in FRAMES]
    assert seen == pytest.approx([0.0, 0.25, 0.5])


def keyed(life: Any) -> None:
    for number, value in ((1, 1.0), (2, 0.0), (3, 0.5)):
        life.xrds.strength = value
        life.xrds.keyframe_insert("strength", frame=number)


def samples_of(pictures: Mapping[int, Any]) -> list[float]:
    return [p.temporal.mean_samples for p in pictures.values()]


def test_each_frame_has_the_strength_that_is_keyed_there(life: Any) -> None:
    whole = samples_of(dict(shot.render_shot(life, request(), FRAMES)))
    keyed(life)
    found = samples_of(dict(shot.render_shot(life, request(), FRAMES)))
    assert found[0] == pytest.approx(whole[0], rel=0.05)  # it moves, for what is keyed
    assert found[1] == 2.0
    assert 2.2 < found[2] < 0.9 * whole[2]
    told = samples_of(dict(shot.render_shot(life, request(strength=1.0), FRAMES)))
    assert told == pytest.approx(whole, rel=0.05)


def test_without_strength_each_frame_is_rendered_by_itself(life: Any) -> None:
    alone = dict(shot.render_shot(life, request(temporal_radius=0), FRAMES))
    found = dict(shot.render_shot(life, request(strength=0.0), FRAMES))
    life.xrds.strength = 0.0
    of_scene = dict(shot.render_shot(life, request(), FRAMES))
    for number, picture in alone.items():
        assert np.array_equal(picture.pixels, found[number].pixels)
        assert np.array_equal(picture.pixels, of_scene[number].pixels)
    assert not has_neighbours(life, request())
    assert has_neighbours(life, request(strength=0.1))
    keyed(life)
    assert has_neighbours(life, request())
    assert not has_neighbours(life, request(strength=0.0))


def test_cached_samples_hold_the_strength_of_objects(
    life: Any, red: Any, tmp_path: Path
) -> None:
    keyed(life)
    pictures = []
    for value in (1.0, 0.5):
        red.xrds_strength = value
        blend = tmp_path / "shot.blend"
        bpy.ops.wm.save_as_mainfile(filepath=str(blend), check_existing=False)
        folder = tmp_path / str(value)
        job: dict[str, Any] = {"frames": FRAMES, "sample_cache": folder}
        first, again = (
            render_file(blend, str(tmp_path / f"{name}#.exr"), request(), **job)
            for name in ("first", "again")
        )
        assert first["samples"]["rendered"] == again["samples"]["read"] == FRAMES
        one, two = (
            [read_channels(tmp_path / f"{name}{n}.exr") for n in FRAMES]
            for name in ("first", "again")
        )
        for channels, others in zip(one, two, strict=True):
            assert all(np.array_equal(x, others[name]) for name, x in channels.items())
        pictures.append(one)
        held = [x for x in read_channels(folder / "0002.exr") if "Strength" in x]
        assert bool(held) == (value < 1.0)
        life, red = bpy.context.scene, bpy.data.objects["Red"]
    assert not np.array_equal(pictures[0][2]["R"], pictures[1][2]["R"])


def test_what_the_plan_says(life: Any, red: Any) -> None:
    def told(**more: Any) -> dict[str, str]:
        decisions = explain(life, request(**more), FRAMES)["decisions"]
        return {each["decision"]: each["value"] for each in decisions}

    assert not [name for name in told() if "strength" in name]
    red.xrds_strength, life.xrds.strength = 0.2, 0.5
    assert told()["strength"] == "0.5"
    assert told()["strength of objects"] == "Red 0.2"
    assert told(strength=0.0)["accumulation"] == "none"
    keyed(life)
    assert told()["strength"] == "1, keyed"
    assert "strength" not in told(strength=1.0)
    assert not [line for line in remarks(life, request()) if "strength" in line]
    assert [line for line in remarks(life, request(scale=2)) if "Red" in line]


@pytest.mark.parametrize("value", [-0.1, 1.1, float("nan")])
def test_what_is_no_strength(life: Any, red: Any, value: float) -> None:
    with pytest.raises(UsageError, match="strength is"):
        request(strength=value)
    red.xrds_strength = life.xrds.strength = value
    life.objects["Mirror"].xrds_strength = 0.5
    assert strength_of(life, request()) == (value > 0.0 or np.isnan(value))
    nearest = 0.0 if value < 0.0 else 1.0
    assert set(np.unique(strengths(life))) == {0.5, 1.0, nearest}
