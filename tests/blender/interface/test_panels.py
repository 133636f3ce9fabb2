"""Panels, operator and preferences: registered, drawable, and gone again."""

from __future__ import annotations

import ctypes
import re
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import bpy
import pytest

import xrds_blender
from xrds_blender.cycles.settings import has_subsets
from xrds_blender.interface import (
    live_picture,
    operators,
    preference_values,
    preferences,
    properties,
    registration,
    translations,
)
from xrds_blender.interface.panel import (
    animation,
    cycles_panels,
    messages,
    panels,
    paragraph,
    scene_cache,
    summary,
)
from xrds_blender.internals.lifetimes import FILE, PROCESS, RENDER_JOB
from xrds_blender.planning import estimates
from xrds_blender.planning.estimates import Capabilities
from xrds_blender.planning.offers import EXPECTED, NOTHING_GAINED, Offer
from xrds_blender.planning.plan import MOTION_BLUR
from xrds_blender.planning.settings import Mode, Network
from xrds_blender.rendering import history, stages
from xrds_blender.rendering.advice import ALONE, NO_CAMERA
from xrds_blender.rendering.modes import estimates as estimates_of
from xrds_blender.rendering.modes import offers_of


@pytest.fixture(autouse=True)
def registered() -> None:
    bpy.ops.wm.read_factory_settings()
    registration.ensure_registered()


def test_cycles_panels_show_under_xrds() -> None:
    found = list(cycles_panels.cycles_classes())
    assert len(found) > 100
    assert all("XRDS" in panel.COMPAT_ENGINES for panel in found)


def test_what_asks_for_cycles_by_name_shows_under_xrds() -> None:
    """Device, feature set and OSL; panoramas' lenses; volumes; subdivision."""
    scene = bpy.context.scene
    camera = scene.camera.data
    camera.type = "PANO"
    own = draw_as("CYCLES", camera)
    ours = draw_as("XRDS", camera)
    assert {"device", "panorama_type"} <= set(own)
    assert set(ours) >= set(own)
    assert "device" not in draw_as("BLENDER_WORKBENCH", camera)
    subdivision = bpy.types.CYCLES_RENDER_PT_subdivision
    for engine in ("CYCLES", "XRDS"):
        scene.render.engine = engine
        if hasattr(scene.cycles, "feature_set"):  # before Blender 5.0
            scene.cycles.feature_set = "EXPERIMENTAL"
        context = SimpleNamespace(scene=scene, engine=engine)
        assert subdivision.poll(context), engine


def draw_as(engine: str, camera: object) -> list[str]:
    """The names of what the render tab's head, the lens and a volume show."""
    layout, scene = Layout(), bpy.context.scene
    scene.render.engine = engine
    context = SimpleNamespace(
        engine=engine,
        scene=scene,
        camera=camera,
        volume=bpy.data.volumes.new("Volume"),
        workspace=SimpleNamespace(use_filter_by_owner=False),
        preferences=bpy.context.preferences,
    )
    for name in ("RENDER_PT_context", "DATA_PT_lens", "DATA_PT_volume_render"):
        panel = getattr(bpy.types, name)
        panel.draw(SimpleNamespace(layout=layout), context)
    return layout.names


def test_unregister_takes_everything_back() -> None:
    xrds_blender.unregister()
    try:
        found = list(cycles_panels.cycles_classes())
        assert not [p for p in found if "XRDS" in p.COMPAT_ENGINES]
        assert not hasattr(bpy.types, "XRDS_PT_settings")
        assert not hasattr(bpy.types.Scene, "xrds")
        assert not hasattr(bpy.types.Object, "xrds_strength")
    finally:
        xrds_blender.register()
    assert hasattr(bpy.types, "XRDS_PT_settings")


ALL = Capabilities(True, True, True, frozenset({Network("fast", 2)}))


class Layout:
    """A layout that refuses names the settings do not have."""

    def __init__(self) -> None:
        self.drawn: list[str] = []
        self.names: list[str] = []

    def prop(self, owner: object, name: str, text: str = "", **_: object) -> None:
        assert name in owner.bl_rna.properties
        self.drawn.append(text or name)
        self.names.append(name)

    operator_context = ""

    def prop_enum(
        self, owner: object, name: str, value: str, text: str = "", **_: object
    ) -> None:
        assert value in owner.bl_rna.properties[name].enum_items
        self.drawn.append(text or value)

    def label(self, text: str, **_: object) -> None:
        self.drawn.append(text)

    def operator(self, name: str, text: str = "", **_: object) -> SimpleNamespace:
        self.drawn.append(text or name)
        return SimpleNamespace()

    def separator(self, **_: object) -> None: ...

    def column(self, **_: object) -> Layout:
        return self

    row = split = column


class Context:
    region = SimpleNamespace(width=300)

    def __init__(self) -> None:
        self.scene = bpy.context.scene
        self.engine = "XRDS"
        self.preferences = bpy.context.preferences


def drawn(*which: object) -> list[str]:
    """What the panels draw, those that show."""
    layout, context = Layout(), Context()
    for panel in which or panels.CLASSES:
        if panel.poll(context):
            panel.draw(SimpleNamespace(layout=layout), context)
    return layout.drawn


def test_a_new_scene_says_which_way_it_takes() -> None:
    pytest.importorskip("mitsuba_oidn")
    told = drawn(panels.XRDS_PT_settings)
    assert told[0] == "Automatic (Full Size)"
    names = ["Full Size", "Super-Resolution", "2×", "4×", "8×", "Cycles Only"]
    assert [text for text in told if text in names] == names
    assert {"same", "much softer", "as set"} <= set(told)
    assert "About" not in told  # no seconds are known before the first render
    assert {"use_time_budget", "Max Samples", "temporal_radius"} <= set(told)
    assert not {"denoise", "guide_samples", "use_exposure"} & set(drawn())


@pytest.mark.parametrize(
    ("way", "named"),
    [
        ("full_size", {"denoise", "temporal_radius", "animation", "Max Samples"}),
        ("x2", {"Low-Resolution Samples", "guide_samples", "use_exposure"}),
        ("cycles_only", {"Max Samples", "Cycles Only"}),
    ],
)
def test_each_way_shows_its_own_settings(way: str, named: set[str]) -> None:
    bpy.context.scene.xrds.mode = way
    told = set(drawn())
    assert named <= told
    assert "use_time_budget" not in told
    presets = {"fast", "balanced", "paper"} if way == "x2" else set()
    assert {"preset", "balanced", "paper"} & told == presets - {"fast"}


def test_strength_is_shown_where_frames_reuse_each_other() -> None:
    settings = bpy.context.scene.xrds
    for mode, radius, shows in (
        ("full_size", 4, True),
        ("full_size", 0, False),
        ("x2", 4, True),
        ("cycles_only", 4, False),
    ):
        settings.mode, settings.temporal_radius = mode, radius
        assert ("strength" in drawn(panels.XRDS_PT_settings)) == shows
    context = Context()
    for data, shows in ((bpy.data.meshes.new("Mesh"), True), (None, False)):
        context.object = bpy.data.objects.new("Object", data)
        assert panels.XRDS_PT_object.poll(context) == shows
    layout = Layout()
    panels.XRDS_PT_object.draw(SimpleNamespace(layout=layout), context)
    assert layout.drawn == ["xrds_strength"]


def test_an_objects_strength_is_saved_and_overridden(tmp_path: Path) -> None:
    item = bpy.data.objects.new("Flag", bpy.data.meshes.new("Flag"))
    bpy.context.scene.collection.objects.link(item)
    assert item.xrds_strength == 1.0
    item.xrds_strength = 0.25
    path = str(tmp_path / "flag.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(path, link=True) as (_, into):
        into.objects = ["Flag"]
    (linked,) = into.objects
    assert linked.xrds_strength == 0.25
    bpy.context.scene.collection.objects.link(linked)
    own = linked.override_create(remap_local_usages=True)
    own.xrds_strength = 0.5
    own.override_library.operations_update()
    told = [x.rna_path for x in own.override_library.properties]
    assert told == ["xrds_strength"]
    other = str(tmp_path / "shot.blend")
    bpy.ops.wm.save_as_mainfile(filepath=other)
    bpy.ops.wm.open_mainfile(filepath=other)
    flags = [x for x in bpy.data.objects if x.name == "Flag"]
    values = {x.library is None: x.xrds_strength for x in flags}
    assert values == {True: 0.5, False: 0.25}


def test_other_networks_are_offered_where_their_weights_are(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    settings = bpy.context.scene.xrds
    settings.mode = "x2"
    known = frozenset({Network("fast", 2), Network("paper", 2)})
    at_hand = Capabilities(True, True, True, known)
    monkeypatch.setattr(panels, "capabilities", lambda _: at_hand)
    told = drawn()
    assert {"fast", "paper"} <= set(told)
    assert "balanced" not in told
    assert "2×" in told
    assert "4×" not in told  # no weights


def test_a_time_budget_leaves_samples_open() -> None:
    settings = bpy.context.scene.xrds
    settings.use_time_budget, settings.time_budget = True, 90.0
    assert drawn(panels.XRDS_PT_settings)[0] == "Automatic (within 90 s)"
    assert list(rows(bpy.context.scene)) == ["Picture"]
    settings.mode = "full_size"
    assert "within" not in " ".join(drawn(panels.XRDS_PT_settings)[1:])


def test_the_table_tells_seconds_after_a_render() -> None:
    pytest.importorskip("mitsuba_oidn")
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 64, 48
    scene.cycles.samples = 1
    FILE.end()
    scene.render.engine = "XRDS"
    bpy.ops.render.render()
    told = drawn(panels.XRDS_PT_settings)
    assert "Time" in told
    row = told.index("Full Size")
    assert told[row + 1].endswith(" s")
    last = dict(summary.last_render(history.last(scene)))
    assert last["Mode"] == "Full Size, 1 sample"
    assert "Total" in last
    assert "Samples and Denoising" not in last
    bpy.ops.wm.read_factory_settings()
    assert history.last(bpy.context.scene) is None


def rows(scene: object) -> dict[str, str]:
    return dict(summary.next_render(scene, properties.request_of(scene.xrds)))


@pytest.mark.parametrize(("scale", "low"), [("2", "683x384"), ("8", "171x96")])
def test_summary_tells_the_small_size(scale: str, low: str) -> None:
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 1366, 768
    scene.render.resolution_percentage = 100
    scene.xrds.mode = f"x{scale}"
    told = rows(scene)
    assert told["Low Resolution"].startswith(low.replace("x", " × "))
    assert told["Guides"] == "1366 × 768, 2 samples"
    assert "mirrors in the guides" in told["Skipped"]
    assert told["Memory"].endswith(" MB")
    scene.render.resolution_x, scene.render.resolution_y = 3840, 2160
    large = rows(scene)["Memory"]
    assert float(large.removeprefix("≤ ").removesuffix(" GB")) >= 1.0


def test_no_way_takes_more_than_five_rows() -> None:
    scene = bpy.context.scene
    scene.render.use_motion_blur = True
    for mode in Mode:
        scene.xrds.mode = mode
        assert 2 <= len(rows(scene)) <= summary.MOST_ROWS
    assert "DEFAULT_CLOSED" in panels.XRDS_PT_forecast.bl_options


def moving(scene: bpy.types.Scene) -> None:
    """Let the cube move in the range of frames 1 to 20."""
    scene.frame_start, scene.frame_end = 1, 20
    cube = scene.objects["Cube"]
    for frame in (1, 20):
        cube.location.x = frame
        cube.keyframe_insert("location", frame=frame)
    bpy.context.view_layer.update()
    scene_cache.forget()


def test_a_file_where_nothing_moves_speaks_of_no_animation() -> None:
    scene = bpy.context.scene
    assert scene.frame_end > scene.frame_start
    assert "XRDS" not in drawn(panels.XRDS_PT_settings)
    assert "Neighbouring Frames" not in rows(scene)


def test_an_animation_comes_first() -> None:
    pytest.importorskip("mitsuba_oidn")
    scene = bpy.context.scene
    moving(scene)
    scene.cycles.samples, scene.cycles.use_adaptive_sampling = 64, False
    told = " ".join(drawn(panels.XRDS_PT_settings))
    assert told.startswith("This animation, 20 frames: one frame (F12) tells its time ")
    assert ("The same picture, " in told) == has_subsets(scene)
    assert "The same samples: +" in told
    assert EXPECTED in told
    assert "Neighbouring Frames" in rows(scene)
    scene.camera.data.type = "PANO"
    told = " ".join(drawn(panels.XRDS_PT_settings))
    assert "The same" not in told
    assert NOTHING_GAINED in told
    assert ALONE in told
    assert "Neighbouring Frames" not in rows(scene)


def rendered(scene: bpy.types.Scene, **seconds: float) -> None:
    """Remember a frame of these seconds by stage, 64 x 48 pixels."""
    render = scene.render
    render.resolution_x, render.resolution_y = 64, 48
    request = properties.request_of(scene.xrds)
    layer = history.Layer(
        scene.name, "ViewLayer", 64 * 48, history.scene_settings(scene)
    )
    history.remember(layer, request.settings, seconds)
    RENDER_JOB.end()


def offers(scene: bpy.types.Scene) -> dict[str, Offer]:
    found = offers_of(scene, properties.request_of(scene.xrds), 20)
    return {offer.kind: offer for offer in found.offers}


def test_an_offer_is_taken_by_its_button() -> None:
    pytest.importorskip("mitsuba_oidn")
    scene = bpy.context.scene
    moving(scene)
    scene.cycles.samples, scene.cycles.use_adaptive_sampling = 64, False
    rendered(scene, sync=1.0, beauty=64.0, denoise=2.0)
    found = offers(scene)
    told = drawn(panels.XRDS_PT_settings)
    assert "23 min" in told[0]  # 20 frames of 65 s and Blender's own denoiser
    assert found["deadline"].seconds == pytest.approx(20 * (65 + 2.0 / 0.5513))
    if has_subsets(scene):
        assert found["same_picture"].seconds < 0.8 * found["deadline"].seconds
    bpy.ops.xrds.take_offer(kind="deadline", seconds=found["deadline"].seconds)
    settings = scene.xrds
    assert (settings.mode, settings.animation) == ("automatic", "deadline")
    assert settings.deadline == pytest.approx(found["deadline"].seconds)
    assert scene.cycles.samples == 64
    bpy.ops.xrds.take_offer(kind="same_picture")
    assert settings.animation == "same_picture"
    FILE.end()


def test_the_table_agrees_with_the_lines_above_it() -> None:
    pytest.importorskip("mitsuba_oidn")
    scene = bpy.context.scene
    moving(scene)
    scene.cycles.samples, scene.cycles.use_adaptive_sampling = 16, False
    rendered(scene, sync=1.0, beauty=32.0, denoise=2.0)
    request = properties.request_of(scene.xrds)
    shot = {x.mode: x.seconds for x in estimates_of(scene, request.settings, ALL, True)}
    found = offers_of(scene, request, 20)
    assert found.cycles == pytest.approx(20 * shot[Mode.CYCLES_ONLY])
    whole = found.animation.seconds(16.0)
    assert whole == pytest.approx(20 * shot[Mode.FULL_SIZE])
    alone = estimates_of(scene, request.settings, ALL)
    assert {x.mode: x.seconds for x in alone}[Mode.FULL_SIZE] == pytest.approx(35.0)
    assert shot[Mode.FULL_SIZE] > 35.0  # and neighbours
    FILE.end()


def test_notes_are_told_where_they_are_true(tmp_path: Path) -> None:
    scene = bpy.context.scene
    moving(scene)

    def notes() -> str:
        bpy.context.view_layer.update()
        scene_cache.forget()
        request = properties.request_of(scene.xrds)
        return " ".join(animation.notes(scene, request))

    scene.render.filepath = str(tmp_path / "frames" / "####")
    assert notes() == ""
    scene.render.use_motion_blur = True
    assert MOTION_BLUR in notes()
    (tmp_path / "file").touch()
    scene.render.filepath = str(tmp_path / "file" / "####")
    assert "cannot be written" in notes()
    scene.xrds.animation, scene.frame_end = "same_picture", 9
    assert "16 frames" in notes()
    scene.camera = None
    assert NO_CAMERA in notes()


def test_a_large_scene_is_looked_at_after_the_panel_was_drawn(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene = bpy.context.scene
    moving(scene)
    monkeypatch.setattr(scene_cache, "_SMALL", 0)
    app = SimpleNamespace(background=False, timers=bpy.app.timers)
    fake = SimpleNamespace(app=app, data=bpy.data, context=bpy.context)
    monkeypatch.setattr(scene_cache, "bpy", fake)
    assert not scene_cache.is_animation(scene)  # not known yet
    assert scene_cache._look_later() > 0.0  # not quiet yet
    FILE.of(scene_cache._Cache).quiet = 0.0
    assert scene_cache._look_later() is None
    assert scene_cache.is_animation(scene)
    scene_cache.forget()
    assert scene_cache.is_animation(scene)  # as it was, until it is looked at again
    bpy.app.timers.unregister(scene_cache._look_later)


def test_the_last_render_tells_its_card() -> None:
    scene = bpy.context.scene
    request = properties.request_of(scene.xrds)
    layer = history.Layer(scene.name, "ViewLayer", 64, history.scene_settings(scene))
    seconds = {"beauty": 1.0, "accumulate": 0.3, "denoise": 2.0, "total": 3.3}
    devices = {"denoise": "Card of Tests"}
    history.remember(layer, request.settings, seconds, devices)
    last = history.last(scene)
    assert last is not None
    rows = dict(summary.last_render(last))
    assert rows["Neighbouring Frames"] == "0.3 s"
    assert rows["Denoising"] == "2.0 s, Card of Tests"
    FILE.end()


def test_cycles_users_see_it_too() -> None:
    pytest.importorskip("mitsuba_oidn")
    moving(bpy.context.scene)
    context = Context()
    assert not panels.XRDS_PT_under_cycles.poll(context)
    context.engine = "CYCLES"
    assert panels.XRDS_PT_under_cycles.poll(context)
    layout = Layout()
    panels.XRDS_PT_under_cycles.draw(SimpleNamespace(layout=layout), context)
    assert layout.drawn[0].startswith("This animation, 20 frames")
    assert not hasattr(panels.XRDS_PT_under_cycles, "bl_options")  # it is open
    assert layout.drawn[-2:] == ["xrds.render", "Render Animation with XRDS"]


def test_other_engines_say_what_will_be_used() -> None:
    context, layout = Context(), Layout()
    context.engine = "BLENDER_WORKBENCH"
    assert panels.XRDS_PT_under_others.poll(context)
    panels.XRDS_PT_under_others.draw(SimpleNamespace(layout=layout), context)
    assert "Cycles Samples" in layout.drawn
    context.engine = "CYCLES"
    assert not panels.XRDS_PT_under_others.poll(context)


def remarks_of(at_hand: Capabilities) -> list[tuple[str, str]]:
    scene = bpy.context.scene
    return messages.remarks(scene, properties.request_of(scene.xrds), at_hand)


def test_panel_says_what_is_missing() -> None:
    scene = bpy.context.scene
    scene.xrds.mode = "x2"
    assert ("ERROR", estimates.TORCH_IS_MISSING) in remarks_of(
        replace(ALL, torch=False)
    )
    scene.view_layers[0].use_pass_glossy_direct = True
    noisy = replace(ALL, denoiser=False, cycles_denoiser=False)
    told = remarks_of(noisy)
    assert ("ERROR", messages.NOISY_INPUT) in told
    assert any("Light passes" in text for _, text in told)
    scene.xrds.mode = "x4"
    assert ("ERROR", estimates.WEIGHTS_ARE_MISSING) in remarks_of(ALL)
    scene.xrds.mode = "full_size"
    assert remarks_of(noisy)[0] == ("ERROR", estimates.LIBRARY_IS_MISSING)
    scene.xrds.mode, scene.cycles.use_denoising = "cycles_only", True
    assert remarks_of(noisy)[0] == ("ERROR", messages.CYCLES_CANNOT_DENOISE)
    scene.xrds.mode, scene.xrds.use_time_budget = "automatic", True
    assert remarks_of(noisy)[0] == ("ERROR", estimates.LIBRARY_IS_MISSING)


@pytest.mark.parametrize(("version", "warns"), [((4, 5, 3), False), ((5, 2, 2), True)])
def test_other_denoising_passes_are_warned_of_above_scale_one(
    monkeypatch: pytest.MonkeyPatch, version: tuple[int, ...], warns: bool
) -> None:
    monkeypatch.setattr(
        messages, "bpy", SimpleNamespace(app=SimpleNamespace(version=version))
    )
    settings = bpy.context.scene.xrds
    for way in ("x2", "full_size", "cycles_only"):
        settings.mode = way
        told = ("ERROR", messages.OTHER_PASSES) in remarks_of(ALL)
        assert told == (warns and way == "x2")


def test_sentences_are_never_cut_off() -> None:
    text = "A sentence of some words that no panel has the width for"
    found = paragraph.lines(text, 20, len)
    assert " ".join(found) == text
    assert max(map(len, found)) <= 20
    japanese = "レンダリングには雑音除去が必要です"
    found = paragraph.lines(japanese, 6, len)
    assert "".join(found) == japanese
    assert max(map(len, found)) <= 6
    assert paragraph.lines("", 6, len) == []


def test_operator_needs_a_camera() -> None:
    bpy.context.scene.camera = None
    assert not operators.XRDS_OT_render.poll(bpy.context)


def test_machine_without_add_on_has_defaults() -> None:
    assert preference_values.preference_values() == preference_values.PreferenceValues()


def test_job_takes_the_preferences(monkeypatch: pytest.MonkeyPatch) -> None:
    here = preference_values.PreferenceValues("cuda:1", 1 << 30, Path("folder"))
    monkeypatch.setattr(properties, "preference_values", lambda: here)
    settings = bpy.context.scene.xrds
    found = properties.request_of(settings).machine
    assert (found.device, found.memory_limit, found.weights) == (
        here.device,
        here.memory_limit,
        here.weights,
    )


def test_operator_keeps_the_engine() -> None:
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x = scene.render.resolution_y = 16
    scene.cycles.samples = 1
    scene.cycles.use_denoising = False  # plain fails as Cycles does without OIDN
    scene.xrds.mode = "cycles_only"
    assert bpy.ops.xrds.render() == {"FINISHED"}
    assert scene.render.engine == "CYCLES"


def test_every_shipped_preset_sets_what_a_saved_one_would(tmp_path: Path) -> None:
    from xrds_blender.interface import presets

    shipped = sorted((presets.SHIPPED / "presets" / presets.FOLDER).glob("*.py"))
    assert len(shipped) == 5
    assert any(path.endswith(presets.FOLDER) for path in preset_folders())
    for path in shipped:
        text = path.read_text()
        samples = "scene.cycles.samples"
        values = {*presets.XRDS_OT_preset_add.preset_values}
        if path.stem in ("Best", "Same_Picture"):  # those of the file
            values.remove(samples)
            assert samples not in text
        assert all(f"{name} = " in text for name in values)
        told = bpy.ops.script.execute_preset(
            filepath=str(path), menu_idname="XRDS_PT_presets"
        )
        assert told == {"FINISHED"}
        if samples in values:
            assert f"{samples} = {bpy.context.scene.cycles.samples}" in text


def preset_folders() -> list[str]:
    from xrds_blender.interface import presets

    return bpy.utils.preset_paths(presets.FOLDER)


def test_self_test_renders_and_leaves_nothing() -> None:
    kinds = ("scenes", "objects", "meshes", "lights", "cameras", "worlds")
    before = {kind: len(getattr(bpy.data, kind)) for kind in kinds}
    assert bpy.ops.xrds.self_test() == {"FINISHED"}
    assert {kind: len(getattr(bpy.data, kind)) for kind in kinds} == before
    works, seconds, versions = preferences.XRDS_OT_self_test.lines
    assert works == "XRDS works: 64 x 64 pixels on cpu"
    assert "network" in seconds
    assert f"Blender {bpy.app.version_string}" in versions


def test_self_test_tells_what_is_wrong(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    here = preference_values.PreferenceValues(weights=tmp_path)
    monkeypatch.setattr(preference_values, "preference_values", lambda: here)
    with pytest.raises(RuntimeError, match="no weights"):
        bpy.ops.xrds.self_test()
    assert preferences.XRDS_OT_self_test.lines[0].startswith("Failed: no weights")


def test_status_bar_tells_the_stage(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        PROCESS.of(stages.Speeds), "seconds", {}
    )  # measured by no render before
    told: list[str] = []
    shown: list[float] = []

    class Bar:
        class layout:  # noqa: N801  # Blender's name
            @staticmethod
            def label(text: str) -> None:
                told.append(text)

    text = ctypes.create_string_buffer(1024)  # as Blender keeps an engine's status
    engine = running_engine(text, shown)
    live_picture.draw_status(Bar, None)
    stages.begin(engine, stages.LOW, 1)
    live_picture.draw_status(Bar, None)
    text[64:82] = b"Mem | Sample 12/64"
    time.sleep(0.05)
    live_picture.draw_status(Bar, None)
    stages.begin(engine, stages.NETWORK, 3)
    for done in (0.25, 0.75):
        time.sleep(0.05)
        stages.reporter(engine)(done)
        live_picture.draw_status(Bar, None)
    stages.end()
    live_picture.draw_status(Bar, None)
    assert told[0] == "XRDS 1/3: Low resolution"
    assert re.fullmatch(r"XRDS 1/3: Low resolution, \d:\d\d left", told[1])
    assert re.fullmatch(r"XRDS 3/3: Network, 0:00 left", told[3])
    assert len(told) == 4
    drawn = [shown[i] for i in (0, 1, 3, 5)]  # the network itself reports in between
    assert drawn == sorted(drawn)
    assert drawn[0] == 0.0
    assert 0.0 < drawn[1] < 0.5
    assert drawn[-1] < 1.0


def test_panels_use_their_own_words_for_guides() -> None:
    """Blender's German calls guides lines on a ruler, and fast an insertion."""
    if "de_DE" not in bpy.app.translations.locales:
        pytest.skip("this Blender was built without translations")
    translate = bpy.app.translations.pgettext_iface
    view = bpy.context.preferences.view
    try:
        view.language, view.use_translate_interface = "de_DE", True
        assert translate("Guides", translations.CONTEXT) == "Hilfsbilder"
    finally:
        view.language = "en_US"
    assert translate("Guides", translations.CONTEXT) == "Guides"


def test_settings_are_never_translated_as_blenders_own_words() -> None:
    settings = bpy.context.scene.xrds.bl_rna.properties
    for name in set(settings.keys()) - {"rna_type", "name"}:
        assert settings[name].translation_context == translations.CONTEXT


def test_presets_hold_all_settings() -> None:
    from xrds_blender.interface import presets

    held = set(presets.XRDS_OT_preset_add.preset_values) - {"scene.cycles.samples"}
    held.add("scene.xrds.strength")  # of what the shot shows, and may be keyed
    names = set(properties.XRDSSettings.bl_rna.properties.keys()) - {"rna_type", "name"}
    assert held == {f"scene.xrds.{name}" for name in names}


def running_engine(text: object, shown: list[float]) -> SimpleNamespace:
    """What the progress of a render asks of an engine; `text` holds its status."""
    return SimpleNamespace(
        update_stats=lambda *_: None,
        update_progress=shown.append,
        get_result=lambda: SimpleNamespace(resolution_x=1000, resolution_y=1000),
        as_pointer=lambda: ctypes.addressof(text),
        test_break=lambda: False,
    )


def test_the_status_bar_tells_the_frames_left(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(PROCESS.of(stages.Speeds), "seconds", {})
    engine = running_engine(ctypes.create_string_buffer(1024), [])
    RENDER_JOB.end()
    stages.begin_animation(0, 48)
    stages.begin_frame(12, 48)
    stages.begin(engine, "Samples", 1, 2)
    assert stages.current() == "XRDS: frame 12 of 48, samples"
    stages.end_frame()
    time_left = stages.current().removeprefix("XRDS: frame 12 of 48, samples, ")
    assert time_left.startswith("all frames in ")
    stages.end()
    assert stages.current() is None
    RENDER_JOB.end()
