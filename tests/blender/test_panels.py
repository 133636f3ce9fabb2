"""Panels, operator and preferences: registered, drawable, and gone again."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import bpy
import pytest

import xrds_blender
from xrds_blender.frame import denoisers, progress, torch_folder
from xrds_blender.interface import (
    cycles_panels,
    machine,
    operators,
    panels,
    preferences,
    properties,
    registration,
    status_bar,
    translations,
)


@pytest.fixture(autouse=True)
def registered() -> None:
    bpy.ops.wm.read_factory_settings()
    registration.ensure_registered()


def test_cycles_panels_show_under_xrds() -> None:
    found = list(cycles_panels.cycles_classes())
    assert len(found) > 100
    assert all("XRDS" in panel.COMPAT_ENGINES for panel in found)


def test_unregister_takes_everything_back() -> None:
    xrds_blender.unregister()
    try:
        found = list(cycles_panels.cycles_classes())
        assert not [p for p in found if "XRDS" in p.COMPAT_ENGINES]
        assert not hasattr(bpy.types, "XRDS_PT_settings")
        assert not hasattr(bpy.types.Scene, "xrds")
    finally:
        xrds_blender.register()
    assert hasattr(bpy.types, "XRDS_PT_settings")


def test_panel_draws_every_property_it_names() -> None:
    """Draw into a layout that refuses names the settings do not have."""

    class Layout:
        def __init__(self) -> None:
            self.drawn: list[str] = []

        def prop(self, owner: object, name: str, **_: object) -> None:
            assert name in owner.bl_rna.properties
            self.drawn.append(name)

        def label(self, text: str, **_: object) -> None:
            self.drawn.append(text)

        def column(self, **_: object) -> Layout:
            return self

        row = split = column

    class Drawn:
        layout = Layout()

    class Context:
        scene = bpy.context.scene
        region = SimpleNamespace(width=300)
        preferences = SimpleNamespace(system=SimpleNamespace(ui_scale=1.0))

    progress.keep({**dict.fromkeys(panels.STAGE_NAMES, 0.0), "network": 12.34})
    for scale in ("1", "2"):
        Context.scene.xrds.scale = scale
        for panel in panels.CLASSES:
            panel.draw(Drawn, Context)
    drawn = set(Drawn.layout.drawn)
    assert {"denoise", "temporal_radius"} <= drawn
    assert {"scale", "preset", "samples", "guide_samples", "guides"} <= drawn
    assert {"use_exposure", "exposure", "plain"} <= drawn
    assert {"12.3 s", "960 × 540, 4096 spp"} <= drawn
    assert "0.0 s" not in drawn


@pytest.mark.parametrize(("scale", "low"), [("2", "683x384"), ("8", "171x96")])
def test_summary_tells_the_low_size(scale: str, low: str) -> None:
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 1366, 768
    scene.render.resolution_percentage = 100
    scene.xrds.scale = scale
    told = dict(panels.summary(scene))
    assert told["Small Render"].startswith(low.replace("x", " × "))
    assert told["Guide bounces"] == "0"
    assert told["Memory"].endswith(" MB")
    scene.render.resolution_x, scene.render.resolution_y = 3840, 2160
    large = dict(panels.summary(scene))["Memory"]
    assert float(large.removeprefix("≤ ").removesuffix(" GB")) >= 1.0
    scene.xrds.plain = True
    assert "no network" in panels.remarks(scene)[0][1]


def test_panel_says_what_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = bpy.context.scene
    scene.xrds.scale = "2"
    monkeypatch.setattr(panels.session, "has_denoiser", lambda: True)
    assert panels.remarks(scene) == []
    monkeypatch.setattr(torch_folder, "is_there", lambda: False)
    monkeypatch.setattr(panels.session, "has_denoiser", lambda: False)
    monkeypatch.setattr(denoisers, "is_there", lambda: False)
    scene.view_layers[0].use_pass_glossy_direct = True
    told = " ".join(text for _, text in panels.remarks(scene))
    for word in ("PyTorch is missing", "no denoiser", "Light passes"):
        assert word in told
    scene.xrds.scale = "1"
    assert panels.remarks(scene) == [("ERROR", panels.NO_DENOISER)]


def test_operator_needs_a_camera() -> None:
    bpy.context.scene.camera = None
    assert not operators.XRDS_OT_render.poll(bpy.context)


def test_machine_without_add_on_has_defaults() -> None:
    assert machine.machine() == machine.Machine()


def test_job_takes_the_preferences(monkeypatch: pytest.MonkeyPatch) -> None:
    here = machine.Machine("cuda:1", 1 << 30, Path("folder"))
    monkeypatch.setattr(properties, "machine", lambda: here)
    settings = bpy.context.scene.xrds
    job = properties.job_of(settings)
    assert (job.device, job.memory_limit, job.weights) == (
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
    scene.xrds.plain = True
    used: list[str] = []
    bpy.app.handlers.render_init.append(lambda s, *_: used.append(s.render.engine))
    assert bpy.ops.xrds.render() == {"FINISHED"}
    assert used == ["XRDS"]
    assert scene.render.engine == "CYCLES"


def test_every_shipped_preset_sets_what_a_saved_one_would(tmp_path: Path) -> None:
    from xrds_blender.interface import presets

    shipped = sorted((presets.SHIPPED / "presets" / presets.FOLDER).glob("*.py"))
    assert len(shipped) == 3
    assert any(path.endswith(presets.FOLDER) for path in preset_folders())
    for path in shipped:
        text = path.read_text()
        assert all(
            f"{name} = " in text for name in presets.XRDS_OT_preset_add.preset_values
        )
        told = bpy.ops.script.execute_preset(
            filepath=str(path), menu_idname="XRDS_PT_presets"
        )
        assert told == {"FINISHED"}
        assert f"scene.cycles.samples = {bpy.context.scene.cycles.samples}" in text


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
    here = machine.Machine(weights=tmp_path)
    monkeypatch.setattr(machine, "machine", lambda: here)
    with pytest.raises(RuntimeError, match="no weights"):
        bpy.ops.xrds.self_test()
    assert preferences.XRDS_OT_self_test.lines[0].startswith("Failed: no weights")


def test_status_bar_tells_the_stage() -> None:
    told: list[str] = []

    class Bar:
        class layout:  # noqa: N801  # Blender's name
            @staticmethod
            def label(text: str) -> None:
                told.append(text)

    class Engine:
        update_stats = staticmethod(lambda *_: None)
        update_progress = staticmethod(lambda _: None)

    status_bar.draw(Bar, None)
    progress.begin(Engine, progress.GUIDES, 2)
    status_bar.draw(Bar, None)
    progress.end()
    status_bar.draw(Bar, None)
    assert told == ["XRDS 2/3: Guides"]


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
