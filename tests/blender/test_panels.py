"""Panels, operator and preferences: registered, drawable, and gone again."""

from __future__ import annotations

from pathlib import Path

import bpy
import pytest

import xrds_blender
from xrds_blender import operators, panels, preferences
from xrds_blender.job import RenderJob


@pytest.fixture(autouse=True)
def registered() -> None:
    bpy.ops.wm.read_factory_settings()
    xrds_blender.ensure_registered()


def test_cycles_panels_show_under_xrds() -> None:
    found = list(panels._cycles_classes())
    assert len(found) > 100
    assert all("XRDS" in panel.COMPAT_ENGINES for panel in found)


def test_unregister_takes_everything_back() -> None:
    xrds_blender.unregister()
    try:
        found = list(panels._cycles_classes())
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

        def prop(self, owner: object, name: str) -> None:
            assert name in owner.bl_rna.properties
            self.drawn.append(name)

        def operator(self, name: str, **_: object) -> None:
            self.drawn.append(name)

        def label(self, **_: object) -> None:
            pass

        def column(self) -> Layout:
            return self

        row = column

    class Drawn:
        layout = Layout()

    drawn = Drawn()
    panels.XRDS_PT_settings.draw(drawn, bpy.context)
    panels.XRDS_PT_advanced.draw(drawn, bpy.context)
    assert {"xrds.render", "scale", "preset", "guide_samples", "guides", "device"} <= (
        set(drawn.layout.drawn)
    )
    assert {"use_exposure", "exposure"} <= set(drawn.layout.drawn)


@pytest.mark.parametrize(("scale", "low"), [("2", "683x384"), ("8", "171x96")])
def test_summary_tells_the_low_size(scale: str, low: str) -> None:
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 1366, 768
    scene.render.resolution_percentage = 100
    scene.xrds.scale = scale
    assert f"Low frame: {low}" in panels.summary(scene)
    assert "Guide bounces: 0" in panels.summary(scene)
    scene.xrds.plain = True
    assert "no network" in panels.summary(scene)[0]


def test_operator_needs_a_camera() -> None:
    bpy.context.scene.camera = None
    assert not operators.XRDS_OT_render.poll(bpy.context)


def test_machine_without_add_on_has_defaults() -> None:
    assert preferences.machine() == preferences.Machine()


def test_job_takes_the_preferences(monkeypatch: pytest.MonkeyPatch) -> None:
    here = preferences.Machine("cuda:1", 1 << 30, Path("folder"))
    monkeypatch.setattr(preferences, "machine", lambda: here)
    settings = bpy.context.scene.xrds
    job = RenderJob.of(settings)
    assert (job.device, job.memory_limit, job.weights) == (
        here.device,
        here.memory_limit,
        here.weights,
    )
    settings.device = "cpu"  # the scene's own choice goes before
    assert RenderJob.of(settings).device == "cpu"


def test_operator_keeps_the_engine() -> None:
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x = scene.render.resolution_y = 16
    scene.cycles.samples = 1
    scene.xrds.plain = True
    used: list[str] = []
    bpy.app.handlers.render_init.append(lambda s, *_: used.append(s.render.engine))
    assert bpy.ops.xrds.render() == {"FINISHED"}
    assert used == ["XRDS"]
    assert scene.render.engine == "CYCLES"


def test_preferences_tell_how_to_get_torch(monkeypatch: pytest.MonkeyPatch) -> None:
    assert preferences.torch_status()[0].startswith("PyTorch 2.")

    def missing(name: str) -> str:
        raise preferences.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(preferences.metadata, "version", missing)
    assert preferences.torch_status()[1].endswith("-m pip install torch safetensors")
