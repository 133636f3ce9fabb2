"""After success, error and cancel every setting of the user is as it was."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from xrds_blender import render, run_job
from xrds_blender.cycles import session
from xrds_blender.interface.registration import ensure_registered
from xrds_blender.rendering.picture import NetworkFailed
from xrds_core.errors import Cancelled, OutOfMemory


def properties(struct: Any) -> dict[str, Any]:
    """All readable RNA properties that hold values; structs by their name."""
    told = {}
    for item in struct.bl_rna.properties:
        if item.type == "COLLECTION":
            continue
        value = getattr(struct, item.identifier)
        if item.type == "POINTER":
            value = getattr(value, "name", value is None)
        elif getattr(item, "is_array", False):
            value = tuple(value)
        elif item.type == "ENUM" and item.is_enum_flag:
            value = frozenset(value)
        told[item.identifier] = value
    return told


def everything(scene: Any) -> dict[str, dict[str, Any]]:
    structs = {
        "scene": scene,
        "render": scene.render,
        "image": scene.render.image_settings,
        "cycles": scene.cycles,
        "xrds": scene.xrds,
        "camera": scene.camera.data,
        "camera object": scene.camera,
        "world": scene.world,
        "world cycles": scene.world.cycles,
    }
    for layer in scene.view_layers:
        structs[f"layer {layer.name}"] = layer
        structs[f"layer {layer.name} cycles"] = layer.cycles
    told = {name: properties(struct) for name, struct in structs.items()}
    told["handlers"] = {
        name: list(value)
        for name in dir(bpy.app.handlers)
        if isinstance(value := getattr(bpy.app.handlers, name), list)
    }
    return told


@pytest.fixture
def life(
    still_life: Callable[..., Any], network: Any, request: pytest.FixtureRequest
) -> Iterator[Any]:
    """A scene whose settings are unlike those of any pass; compared at the end."""
    ensure_registered()
    scene = still_life(45, 33)
    scene.cycles.use_denoising = session.has_denoiser()
    scene.cycles.use_adaptive_sampling = True
    scene.cycles.max_bounces, scene.cycles.diffuse_bounces = 7, 3
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "GAUSSIAN", 2.5
    scene.camera.data.shift_x = 0.05
    scene.render.use_border = True
    scene.render.border_min_x, scene.render.border_max_y = 0.2, 0.9
    scene.view_layers[0].samples = 3
    scene.render.use_persistent_data = hasattr(request, "param")
    before = everything(scene)
    assert before["cycles"]["filter_width"] == 2.5
    seen: list[dict[str, Any]] = []

    def during(*_: Any) -> None:
        seen.append(everything(scene))

    bpy.app.handlers.render_stats.append(during)
    try:
        yield scene
    finally:
        bpy.app.handlers.render_stats.remove(during)
    assert everything(scene) == before
    scene.render.use_persistent_data = False  # ends the session that was kept
    assert seen or request.node.name == "test_after_an_error_inside_cycles"
    # Not even for a moment, but for the engine that `render` itself puts in.
    ours = {"engine", "use_compositing", "use_sequencer"}
    for moment in seen:
        moment["render"] |= {name: before["render"][name] for name in ours}
        moment["handlers"] = before["handlers"]
        assert moment == before


def test_after_success(life: Any) -> None:
    assert render(life, 4, samples=2, seed=3).radiance.any()


@pytest.mark.parametrize("life", ["persistent data"], indirect=True)
def test_after_success_with_persistent_data(life: Any) -> None:
    assert life.render.use_persistent_data
    for _ in range(2):
        assert render(life, 4, samples=2, seed=3).radiance.any()


def test_after_f12(life: Any) -> None:
    life.render.engine = "XRDS"
    try:
        bpy.ops.render.render()
    finally:
        life.render.engine = "CYCLES"


def test_after_an_error_in_a_job(life: Any) -> None:
    def job(passes: Any) -> None:
        passes.beauty(2, 1)
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        run_job(life, job)


def test_after_an_error_inside_cycles(
    life: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: Any) -> None:
        raise MemoryError("on purpose")

    monkeypatch.setattr(session.functions(), "render", broken)
    with pytest.raises(MemoryError):
        render(life, 4)


def test_after_too_little_memory_for_the_network(
    life: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any, **__: Any) -> None:
        raise OutOfMemory("on purpose")

    monkeypatch.setattr("xrds_blender.rendering.loading._load_network", lambda *_: fail)
    with pytest.raises(NetworkFailed):
        render(life, 4)


@pytest.mark.parametrize("at", range(1, 6))
def test_after_cancelling_anywhere(
    life: Any, monkeypatch: pytest.MonkeyPatch, at: int
) -> None:
    """Esc seen at the first, second, ... time that anything asks."""
    asked = []

    def is_stopped(engine: Any) -> bool:
        asked.append(1)
        return len(asked) >= at

    monkeypatch.setattr(session, "is_stopped", is_stopped)
    with pytest.raises(Cancelled):
        render(life, 4)
    assert len(asked) == at


def test_a_cancelled_f12_is_no_error(
    life: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session, "is_stopped", lambda engine: True)
    life.render.engine = "XRDS"
    try:
        bpy.ops.render.render()
    finally:
        life.render.engine = "CYCLES"
