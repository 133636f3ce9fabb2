"""*Render with XRDS* on scenes of other engines: nobody sees ours in the scene."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from xrds_blender.cycles import session
from xrds_blender.internals import engine_override
from xrds_blender.internals.lifetimes import PROCESS
from xrds_blender.rendering import render
from xrds_core.errors import SceneError


@pytest.fixture
def renders(life: Any, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The engine that the scene has during each render by XRDS."""
    seen: list[str] = []
    real = render.render_frame

    def render_frame(*arguments: Any) -> Any:
        seen.append(life.render.engine)
        return real(*arguments)

    monkeypatch.setattr(render, "render_frame", render_frame)
    life.xrds.mode = "full_size"
    return seen


@pytest.mark.parametrize("persistent", [False, True])
@pytest.mark.parametrize("engine", ["CYCLES", "BLENDER_WORKBENCH"])
def test_the_scene_keeps_its_engine_meanwhile(
    life: Any, renders: list[str], engine: str, persistent: bool
) -> None:
    life.render.engine, life.render.use_persistent_data = engine, persistent
    assert bpy.ops.xrds.render() == {"FINISHED"}
    assert renders == [engine]
    assert life.render.engine == engine


def test_a_file_saved_meanwhile_has_the_scenes_engine(
    life: Any, renders: list[str], tmp_path: Path
) -> None:
    path = tmp_path / "saved.blend"

    def save(*_: Any) -> None:
        bpy.data.libraries.write(str(path), {life})

    life.render.engine = "CYCLES"
    bpy.app.handlers.render_pre.append(save)
    assert bpy.ops.xrds.render() == {"FINISHED"}
    with bpy.data.libraries.load(str(path)) as (_, loaded):
        loaded.scenes = [life.name]
    assert loaded.scenes[0].render.engine == "CYCLES"


@pytest.mark.parametrize("persistent", [False, True])
def test_the_next_render_is_by_the_scenes_engine(
    life: Any, renders: list[str], persistent: bool
) -> None:
    life.render.engine, life.render.use_persistent_data = "CYCLES", persistent
    bpy.ops.render.render()
    assert bpy.ops.xrds.render() == {"FINISHED"}
    bpy.ops.render.render()
    assert len(renders) == 1
    assert life.render.use_persistent_data is persistent


@pytest.mark.parametrize(("persistent", "sessions"), [(False, 3), (True, 2)])
def test_persistent_data_is_kept_from_one_of_our_renders_to_the_next(
    life: Any, monkeypatch: pytest.MonkeyPatch, persistent: bool, sessions: int
) -> None:
    life.render.engine, life.render.use_persistent_data = "CYCLES", persistent
    engines: list[str] = []
    cycles = session.functions()
    create = cycles.create

    def noted(engine: Any, *more: Any) -> None:
        engines.append(engine.bl_idname)
        create(engine, *more)

    monkeypatch.setattr(cycles, "create", noted)
    for _ in range(2):
        render.render(life, 1)
    bpy.ops.render.render()  # by Cycles: what is kept of ours is freed
    render.render(life, 1)
    assert engines.count(engine_override.ENGINE) == sessions


def test_an_animation_is_lent_for_all_its_frames(
    life: Any, renders: list[str], tmp_path: Path
) -> None:
    life.render.engine = "CYCLES"
    life.render.filepath = str(tmp_path / "frame")
    life.frame_start, life.frame_end = 1, 3
    assert bpy.ops.xrds.render(animation=True) == {"FINISHED"}
    assert renders == ["CYCLES"] * 3


def test_a_render_that_does_not_begin_lends_nothing(
    life: Any, renders: list[str]
) -> None:
    life.render.engine, life.camera = "CYCLES", None
    engine_override.begin(life)
    engine_override.withdraw()
    life.camera = bpy.data.objects["Camera"]
    bpy.ops.render.render()
    assert not renders


@pytest.fixture
def unknown_place() -> Iterator[None]:
    override = PROCESS.of(engine_override.Override)
    usual, override.offset = override.offset, 0
    yield
    override.offset = usual


def test_an_unknown_blender_is_told(life: Any, unknown_place: None) -> None:
    life.render.engine = "CYCLES"
    with pytest.raises(SceneError, match="keeps the name of a scene's render engine"):
        engine_override.begin(life)
    with pytest.raises(RuntimeError, match="choose the engine XRDS instead"):
        bpy.ops.xrds.render()
    assert life.render.engine == "CYCLES"
