"""The real window: clicks, keys and what is then seen. In order, as a user goes on.

Every test ends with a screenshot under build/app/PROGRAM/shots, to be looked at.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sequences
from program import Window

pytestmark = pytest.mark.timeout(3600)

RENDER_MENU = (129, 34)
RENDER_IMAGE, RENDER_ANIMATION = (175, 56), (175, 78)
RENDER_WITH_XRDS, RENDER_ANIMATION_WITH_XRDS = (190, 204), (190, 230)
SIZE = (96, 64)


def small_scene(window: Window, samples: int) -> None:
    window.ask(
        f"""
scene = bpy.data.scenes[0]
scene.render.resolution_x, scene.render.resolution_y = {SIZE}
scene.cycles.samples = {samples}
bpy.context.preferences.view.render_display_type = 'NONE'
EVENTS.clear()
"""
    )


def press(window: Window, entry: tuple[int, int]) -> None:
    """Open the Render menu and press an entry."""
    window.click(*RENDER_MENU)
    time.sleep(2.0)
    window.click(*entry)


def finished(window: Window, patience: float = 600.0) -> list[str]:
    """Wait for the end of a render; what Blender's handlers told."""
    window.wait(
        "any(e[0] in ('render_complete', 'render_cancel') for e in EVENTS)", patience
    )
    window.wait("not bpy.app.is_job_running('RENDER')", 60)
    return window.ask("[e[0] for e in EVENTS]")


def leave_picture(window: Window) -> None:
    """Turn the editor that showed a render into the 3D viewport it was."""
    window.ask(
        """
for area in window.screen.areas:
    if area.type == 'IMAGE_EDITOR':
        area.type = 'VIEW_3D'
"""
    )


def picture_of(path: Path) -> np.ndarray:
    """An image file, (height, width, 3), from 0 to 255."""
    image = pytest.importorskip("PIL.Image")
    return np.asarray(image.open(path).convert("RGB")).astype(np.float32)


def result(window: Window, name: str) -> np.ndarray:
    """What the Render Result shows, as `picture_of`."""
    path = window.program.share / name
    seen = window.program.seen(path)
    window.ask(f"bpy.data.images['Render Result'].save_render({seen!r})")
    return picture_of(path)


def settings(window: Window) -> Any:
    return window.ask(
        """
s = bpy.data.scenes[0]
names = ('samples', 'max_bounces', 'diffuse_bounces', 'pixel_filter_type',
         'use_denoising', 'use_adaptive_sampling')
camera = s.camera.data
([getattr(s.cycles, n) for n in names], s.render.engine, s.render.resolution_x,
 s.render.resolution_percentage, s.render.use_persistent_data, camera.sensor_width,
 camera.shift_x)
"""
    )


def test_installs_by_dropping_the_zip(window: Window) -> None:
    window.shot("01_first_start")
    window.move(400, 620)
    window.key("Escape")  # the splash screen
    (path,) = window.program.share.glob("*.zip")
    window.open_drag_source(path)
    window.drag((120, 740), (610, 400))
    window.settle()
    window.shot("02_install_dialogue")
    window.click(548, 492)
    window.wait("bpy.types.RenderEngine.bl_rna_get_subclass_py('XRDS') is not None", 60)
    window.settle()
    window.shot("03_installed")
    assert window.ask("'bl_ext.user_default.xrds' in bpy.context.preferences.addons")
    assert not window.ask("'torch' in __import__('sys').modules")
    kept = "bpy.context.preferences.addons['bl_ext.user_default.xrds'].preferences"
    assert "torch safetensors" in window.ask(f"{kept}.torch_command")


def test_first_picture_from_the_render_menu(window: Window) -> None:
    small_scene(window, 16)
    window.ask(
        """
bpy.context.preferences.view.render_display_type = 'AREA'
render = bpy.data.scenes[0].render
render.resolution_x, render.resolution_y = 320, 180
"""
    )
    engine = window.ask("bpy.data.scenes[0].render.engine")
    window.click(*RENDER_MENU)
    window.settle()
    window.shot("04_render_menu")
    window.click(*RENDER_WITH_XRDS)
    assert finished(window) == ["render_init", "render_complete"]
    window.settle()
    window.move(400, 620)  # Blender draws what the pointer goes over
    window.settle()
    window.shot("05_picture")
    leave_picture(window)
    picture = result(window, "first.png")
    assert picture.shape == (180, 320, 3)
    parts = [half for row in np.split(picture, 2) for half in np.split(row, 2, axis=1)]
    assert min(part.std() for part in parts) > 1.0  # not in one corner alone
    window.wait(f"bpy.data.scenes[0].render.engine == {engine!r}", 20)


def test_first_shot_from_the_render_menu(window: Window) -> None:
    """Its frames hold each other's samples, and the scene keeps its engine."""
    small_scene(window, 2)
    folder = window.program.share / "shot"
    seen = window.program.seen(folder)
    engine = window.ask(
        f"""
scene = bpy.data.scenes[0]
scene.frame_start, scene.frame_end = 1, 3
scene.render.filepath = {seen!r} + '/'
scene.render.engine
"""
    )
    press(window, RENDER_ANIMATION_WITH_XRDS)
    assert finished(window).count("render_complete") == 1
    image = pytest.importorskip("PIL.Image")
    frames = [image.open(path) for path in sorted(folder.iterdir())]
    assert len(frames) == 3
    for frame in frames:
        assert frame.text["xrds.ViewLayer.frames"] == "1 to 3"
    window.wait(f"bpy.data.scenes[0].render.engine == {engine!r}", 20)


def test_scripts_may_write_after_a_render(window: Window) -> None:
    """Blender's guard against writes while drawing is open again."""
    window.ask("bpy.data.scenes[0].frame_end = 3")
    assert window.ask("bpy.data.scenes[0].frame_end") == 3


def test_the_engine_is_chosen_in_the_render_properties(window: Window) -> None:
    left, top, _, _ = window.region("PROPERTIES", "NAVIGATION_BAR")
    window.click(left + 17, top + 59)
    window.wait(
        "any(a.spaces.active.context == 'RENDER' for a in window.screen.areas "
        "if a.type == 'PROPERTIES')",
        30,
    )
    window.settle()
    left, top, width, _ = window.region("PROPERTIES", "WINDOW")
    menu = left + width * 2 // 3, top + 57
    window.click(*menu)
    window.settle()
    window.shot("06_engines")
    window.key("x")  # the only engine with this letter first
    window.settle()
    if window.ask("bpy.data.scenes[0].render.engine") != "XRDS":
        window.key("Return")
        window.settle()
    window.move(400, 620)
    window.settle()
    window.shot("07_panel")
    assert window.ask("bpy.data.scenes[0].render.engine") == "XRDS"


def test_render_image_under_the_engine(window: Window) -> None:
    small_scene(window, 8)
    before = settings(window)
    press(window, RENDER_IMAGE)
    assert finished(window) == ["render_init", "render_complete"]
    assert settings(window) == before
    window.settle()
    window.shot("08_after_render")


def test_escape_cancels_at_once(window: Window) -> None:
    small_scene(window, 100_000)
    window.ask("bpy.data.scenes[0].cycles.use_adaptive_sampling = False")
    before = settings(window)
    press(window, RENDER_IMAGE)
    window.wait("bpy.app.is_job_running('RENDER')", 60)
    time.sleep(5.0)
    window.shot("09_rendering")
    start = window.ask("__import__('time').time()")
    window.move(400, 620)
    window.key("Escape")
    assert finished(window)[-1] == "render_cancel"
    took = window.ask("EVENTS[-1][1]") - start
    print(f"cancelled after {took:.1f} s, the drawing of the window included")
    assert settings(window) == before
    window.settle()
    window.shot("10_cancelled")


@pytest.mark.parametrize("way", ["full_size", "x2"])
def test_the_picture_grows_and_stays_after_escape(window: Window, way: str) -> None:
    """Seen at full size while it renders, kept when it is stopped."""
    small_scene(window, 100_000)
    window.ask(
        f"""
bpy.context.preferences.view.render_display_type = 'AREA'
render = bpy.data.scenes[0].render
render.resolution_x, render.resolution_y = 320, 180
bpy.data.scenes[0].xrds.mode = {way!r}
bpy.data.scenes[0].cycles.use_adaptive_sampling = False
"""
    )
    before = settings(window)
    press(window, RENDER_IMAGE)
    window.wait(SAMPLES_ARE_TAKEN)  # the first render of this way loads PyTorch
    window.move(400, 620)
    time.sleep(3.0)
    seen = brightness(window.shot(f"10_growing_{way}"))
    window.key("Escape")
    assert finished(window)[-1] == "render_cancel"
    assert settings(window) == before
    window.settle()
    window.move(400, 600)
    window.settle()
    kept = brightness(window.shot(f"10_kept_{way}"))
    leave_picture(window)
    window.ask("bpy.data.scenes[0].xrds.mode = 'full_size'")
    for picture in (seen, kept):  # the cube's sides differ, and fill the middle
        assert picture.std() > 10.0
        assert picture.max() > 100.0
    assert np.abs(seen - kept).mean() < 10.0


SAMPLES_ARE_TAKEN = """
import sys
stages = sys.modules.get('xrds_blender.rendering.stages')
lifetimes = sys.modules.get('xrds_blender.internals.lifetimes')
run = stages and lifetimes.RENDER_JOB.of(stages.Current).run
status = sys.modules.get('xrds_blender.internals.status')
run and (status.fraction(run.engine) or 0) > 0
"""


def brightness(path: Path) -> np.ndarray:
    """Of the middle of the window, where the image editor shows the picture."""
    image = pytest.importorskip("PIL.Image")
    return np.asarray(image.open(path).convert("L"), np.float32)[320:470, 430:620]


def test_an_animation_of_three_frames(window: Window) -> None:
    small_scene(window, 4)
    folder = window.program.share / "frames"
    seen = window.program.seen(folder)
    window.ask(
        f"""
scene = bpy.data.scenes[0]
scene.frame_start, scene.frame_end = 1, 3
scene.render.filepath = {seen!r} + '/'
cube = bpy.data.objects['Cube']
for frame in (1, 3):
    cube.location.x = frame - 2
    cube.keyframe_insert('location', frame=frame)
"""
    )
    press(window, RENDER_ANIMATION)
    assert finished(window).count("render_complete") == 1
    frames = sorted(folder.iterdir())
    assert [path.stem for path in frames] == ["0001", "0002", "0003"]
    assert len({path.read_bytes() for path in frames}) == 3


def test_escape_shows_the_frame_under_way_of_an_animation(window: Window) -> None:
    """Not the frame ahead that was being sampled; no file is written of either."""
    frames = window.program.share / "frames"
    true = [picture_of(path) for path in sorted(frames.iterdir())]
    small_scene(window, 1000)
    folder = window.program.share / "stopped"
    window.ask(
        f"""
scene = bpy.data.scenes[0]
scene.cycles.use_adaptive_sampling = False
scene.render.filepath = {window.program.seen(folder)!r} + '/'
bpy.context.preferences.view.render_display_type = 'AREA'
"""
    )
    press(window, RENDER_ANIMATION)
    window.wait(
        """
import sys
stages = sys.modules.get('xrds_blender.rendering.stages')
stages and 'frame 2' in (stages.current() or '')
"""
    )
    window.move(400, 620)
    window.key("Escape")
    assert finished(window)[-1] == "render_cancel"
    assert not folder.exists() or not list(folder.iterdir())
    kept = result(window, "stopped.png")
    errors = [np.abs(kept - each).mean() for each in true]
    assert errors[0] < 0.5 * min(errors[1:])
    window.move(400, 600)
    window.settle()
    window.shot("10_stopped_animation")
    leave_picture(window)


def test_a_frame_is_tried_and_the_line_dragged(window: Window) -> None:
    """As the panel's button does it; the picture opens in a window of its own."""
    small_scene(window, 4)
    window.ask("bpy.data.scenes[0].frame_set(2)")
    before = settings(window)
    window.ask("bpy.ops.xrds.try_frame('INVOKE_DEFAULT')")
    window.wait(f"{MODAL} == ['XRDS_OT_move_split']")
    window.settle()
    window.shot("10_try")
    assert settings(window) == before
    assert window.ask("bpy.data.scenes[0].frame_current") == 2
    left, right = window.ask(PICTURE_ON_SCREEN)
    middle = (left + right) // 2, 400
    window.drag(middle, ((left + middle[0]) // 2, 400))
    window.shot("10_try_dragged")
    assert window.ask(LINE) == pytest.approx(SIZE[0] / 4, abs=3)
    window.key("Escape")
    window.wait(f"not {MODAL}", 60)
    window.ask(
        """
other = bpy.context.window_manager.windows[-1]
with bpy.context.temp_override(window=other):
    bpy.ops.wm.window_close()
"""
    )


MODAL = """[
    each.bl_idname for other in bpy.context.window_manager.windows
    for each in other.modal_operators if each.bl_idname.startswith('XRDS')]"""
LINE = """
from xrds_blender.interface import split
from xrds_blender.internals.lifetimes import FILE
FILE.of(split.Shown).place
"""
PICTURE_ON_SCREEN = """
other = bpy.context.window_manager.windows[-1]
region = next(r for r in other.screen.areas[0].regions if r.type == 'WINDOW')
corners = [region.view2d.view_to_region(x, 0, clip=False)[0] for x in (0.0, 1.0)]
[other.x + region.x + corner for corner in corners]
"""


def test_rendered_frames_are_denoised_beside_the_window(window: Window) -> None:
    """Chosen in the file browser; Esc stops, and the next time does the rest."""
    folder = window.program.share / "noisy"
    for number in range(1, 7):
        sequences.write(folder, sequences.frame(number))
    where = f"directory={window.program.seen(folder)!r} + '/'"
    window.ask(f"bpy.ops.xrds.denoise_files('INVOKE_DEFAULT', {where})")
    window.wait(f"{BROWSER} is not None", 60)
    window.settle()
    window.shot("10_denoise_files")
    window.ask(
        f"""
area, other = {BROWSER}, bpy.context.window_manager.windows[-1]
with bpy.context.temp_override(window=other, area=area):
    bpy.ops.file.execute()
"""
    )
    window.move(400, 620)
    window.key("Escape")
    window.wait(f"not {MODAL}")
    assert "XRDS was stopped; frames denoised into" in window.log
    window.ask(f"bpy.ops.xrds.denoise_files('EXEC_DEFAULT', {where})")
    window.wait(f"not {MODAL}")
    window.shot("10_denoised_files")
    assert len(list((folder / "denoised").glob("*.exr"))) == 6


BROWSER = """next((
    a for a in bpy.context.window_manager.windows[-1].screen.areas
    if a.type == 'FILE_BROWSER'), None)"""


def test_the_compositors_result_is_saved(window: Window) -> None:
    small_scene(window, 4)
    press(window, RENDER_IMAGE)
    finished(window)
    plain = result(window, "plain.png")
    window.ask(COMPOSITOR)
    small_scene(window, 4)
    press(window, RENDER_IMAGE)
    finished(window)
    mirrored = result(window, "mirrored.png")
    assert np.abs(mirrored[:, ::-1] - plain).mean() < 2.0
    assert np.abs(mirrored - plain).mean() > 4.0


COMPOSITOR = """
scene = bpy.data.scenes[0]
if bpy.app.version >= (5, 0):
    tree = bpy.data.node_groups.new('graph', 'CompositorNodeTree')
    scene.compositing_node_group = tree
    tree.interface.new_socket('Image', in_out='OUTPUT', socket_type='NodeSocketColor')
    end = tree.nodes.new('NodeGroupOutput')
else:
    scene.use_nodes = True
    tree = scene.node_tree
    tree.nodes.clear()
    end = tree.nodes.new('CompositorNodeComposite')
flip = tree.nodes.new('CompositorNodeFlip')
if 'Flip X' in flip.inputs:
    flip.inputs['Flip X'].default_value = True
    flip.inputs['Flip Y'].default_value = False
layers = tree.nodes.new('CompositorNodeRLayers')
tree.links.new(layers.outputs['Image'], flip.inputs[0])
tree.links.new(flip.outputs[0], end.inputs[0])
"""


@pytest.mark.parametrize("shading", ["MATERIAL", "RENDERED"])
def test_the_viewport_shades_as_under_cycles(window: Window, shading: str) -> None:
    """Switched by the program's own setting; looked at in the screenshots."""
    window.ask(
        f"""
view = next(a for a in window.screen.areas if a.type == 'VIEW_3D').spaces.active
view.shading.type = {shading!r}
"""
    )
    time.sleep(15.0)
    window.settle()
    path = window.shot(f"11_viewport_{shading.lower()}")
    window.ask(
        """
view = next(a for a in window.screen.areas if a.type == 'VIEW_3D').spaces.active
view.shading.type = 'SOLID'
"""
    )
    image = pytest.importorskip("PIL.Image")
    seen = np.asarray(image.open(path).convert("L"))[150:650, 100:900]
    assert seen.std() > 4.0
    assert "Traceback" not in window.log


@pytest.mark.parametrize("language", ["en_US", "de_DE", "ja_JP"])
def test_the_interface_in_languages(window: Window, language: str) -> None:
    """All panels and the preferences, in the place of the 3D view; to be looked at."""
    if not window.ask(f"{language!r} in bpy.app.translations.locales"):
        pytest.skip("this program was installed without translations")
    try:
        window.ask(OPEN_PANELS.format(language=language))
        window.settle()  # a new editor learns its tabs when it is drawn
        window.ask(
            "area = max(window.screen.areas, key=lambda a: a.width * a.height)\n"
            "area.spaces.active.context = 'RENDER'"
        )
        samples = window.ask("bpy.app.translations.pgettext_iface('Samples')")
        assert (samples == "Samples") == (language == "en_US")
        window.settle()
        window.shot(f"12_panels_{language}")
        window.ask(PREFERENCES)
        window.settle()
        window.shot(f"13_preferences_{language}")
    finally:
        window.ask(AS_BEFORE)
        window.settle()
    assert "Traceback" not in window.log


OPEN_PANELS = """
view = bpy.context.preferences.view
view.language = {language!r}
view.use_translate_interface = view.use_translate_tooltips = True
from xrds_blender.interface.panel import panels
for panel in reversed(panels.CLASSES):  # a new editor shows them open
    bpy.utils.unregister_class(panel)
    panel.bl_options = set()
for panel in panels.CLASSES:
    bpy.utils.register_class(panel)
area = max(window.screen.areas, key=lambda a: a.width * a.height)
area.type = 'PROPERTIES'
scene = bpy.data.scenes[0]
scene.render.engine, scene.cycles.samples = 'XRDS', 16
scene.render.resolution_x, scene.render.resolution_y = 1920, 1080
"""
PREFERENCES = """
area = max(window.screen.areas, key=lambda a: a.width * a.height)
area.type = 'PREFERENCES'
bpy.context.preferences.active_section = 'ADDONS'
bpy.context.window_manager.addon_search = 'XRDS'
bpy.ops.preferences.addon_expand(module='bl_ext.user_default.xrds')
"""
AS_BEFORE = """
bpy.ops.preferences.addon_expand(module='bl_ext.user_default.xrds')  # folds it again
area = max(window.screen.areas, key=lambda a: a.width * a.height)
area.type = 'VIEW_3D'
view = bpy.context.preferences.view
view.use_translate_interface = view.use_translate_tooltips = False
view.language = 'en_US'
"""


def test_nothing_went_wrong_on_the_way(window: Window) -> None:
    window.ask("__import__('sys').stdout.flush()")
    for word in ("Traceback", "AttributeError", "Error: "):
        assert word not in window.log


def test_screenshots_are_kept(window: Window) -> None:
    assert len(window.shots) >= 10
    assert all(isinstance(path, Path) and path.stat().st_size for path in window.shots)
