"""Small scenes for the tests that render; built from data, without operators."""

from __future__ import annotations

import math
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

try:
    import bpy
except ImportError:  # tests without Blender ask for none of these
    bpy = None

# A shell that runs the tests in the background makes them deaf to these, and with them
# the programs that they start and interrupt.
for _name, _usual in (
    ("SIGINT", signal.default_int_handler),
    ("SIGHUP", signal.SIG_DFL),
):
    _number = getattr(signal, _name, None)  # Windows has no SIGHUP
    if _number is not None and signal.getsignal(_number) is signal.SIG_IGN:
        signal.signal(_number, _usual)


def principled(name: str, **inputs: Any) -> Any:
    material = bpy.data.materials.new(name)
    if not material.node_tree:
        material.use_nodes = True
    shader = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
    for key, value in inputs.items():
        shader.inputs[key.replace("_", " ")].default_value = value
    return material


def add_mesh(scene: Any, name: str, vertices: Any, faces: Any, material: Any) -> Any:
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    mesh.materials.append(material)
    item = bpy.data.objects.new(name, mesh)
    scene.collection.objects.link(item)
    return item


def add_cube(scene: Any, name: str, centre: Any, half: float, material: Any) -> Any:
    signs = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    vertices = [tuple(half * s for s in sign) for sign in signs]
    faces = [
        (0, 1, 3, 2),
        (4, 6, 7, 5),
        (0, 4, 5, 1),
        (2, 3, 7, 6),
        (0, 2, 6, 4),
        (1, 5, 7, 3),
    ]
    cube = add_mesh(scene, name, vertices, faces, material)
    cube.location = centre
    return cube


def new_scene(width: int, height: int, samples: int) -> Any:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    render = scene.render
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y = width, height
    render.resolution_percentage = 100
    render.threads_mode, render.threads = "FIXED", 2
    scene.cycles.samples = samples
    scene.cycles.use_denoising = False
    scene.cycles.device = "CPU"
    if bpy.app.version >= (4, 3):  # 5.0's startup file holds the classic pattern
        scene.cycles.sampling_pattern = "AUTOMATIC"  # as XRDS samples
    scene.world = bpy.data.worlds.new("World")
    if not scene.world.node_tree:
        scene.world.use_nodes = True
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    return scene


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--every-change",
        action="store_true",
        help="try every change of the guide cache's table, not only some of each kind",
    )
    parser.addoption(
        "--record-decibels",
        action="store_true",
        help="make what the golden scene has now what it must have from now on",
    )


@pytest.fixture(autouse=True)
def no_guides_of_before() -> None:
    """What one test rendered is not to serve another."""
    from xrds_blender.rendering import guide_cache

    guide_cache.CACHE.clear()


@pytest.fixture
def one_thread() -> Iterator[None]:
    """Tiny layers are slower on several threads, by far where others compute too."""
    import torch

    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.fixture(scope="module")
def upscaler() -> Any:
    """A network that has learnt nothing, but whose every kernel counts."""
    import torch

    from xrds_core.superres.network import XRDS, preset_config
    from xrds_core.superres.upscaler import Upscaler

    torch.manual_seed(3)
    network = XRDS(preset_config("fast", 2))
    torch.nn.init.normal_(network.tail.predict.weight, std=0.1)
    return Upscaler("fast", 2, device="cpu", weights=network)


@pytest.fixture
def stopped_in(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Renders the animation as by Ctrl-F12, stopped as soon as a stage begins."""
    import bpy

    from xrds_blender.cycles import session
    from xrds_blender.rendering import stages

    def render(stage: str) -> None:
        with monkeypatch.context() as patch:
            patch.setattr(
                session, "is_stopped", lambda _: stage in (stages.current() or "")
            )
            bpy.ops.render.render(animation=True)

    return render


@pytest.fixture
def empty_scene() -> Callable[..., Any]:
    """A camera in a grey world: (width, height, samples) -> scene."""
    return new_scene


@pytest.fixture
def still_life() -> Callable[..., Any]:
    """A red and a mirror cube on a floor, a lamp and a blue sky."""

    def build(width: int = 48, height: int = 36, samples: int = 2) -> Any:
        scene = new_scene(width, height, samples)
        sky = scene.world.node_tree.nodes["Background"]
        sky.inputs["Color"].default_value = (0.25, 0.35, 0.5, 1.0)
        corners = [(-5, -5, 0), (5, -5, 0), (5, 5, 0), (-5, 5, 0)]
        grey = principled("grey", Base_Color=(0.5, 0.5, 0.5, 1))
        red = principled("red", Base_Color=(0.8, 0.1, 0.1, 1))
        mirror = principled("mirror", Metallic=1.0, Roughness=0.0)
        add_mesh(scene, "Floor", corners, [(0, 1, 2, 3)], grey)
        add_cube(scene, "Red", (-1.2, 0.5, 1), 1.0, red)
        add_cube(scene, "Mirror", (1.6, 0.5, 1), 1.0, mirror)
        lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "AREA"))
        lamp.data.energy, lamp.location = 300, (2, -3, 5)
        scene.collection.objects.link(lamp)
        scene.camera.location = (0, -7.5, 2.6)
        scene.camera.rotation_euler = (math.radians(78), 0, 0)
        return scene

    return build


def nearest(low: np.ndarray, scale: int, height: int, width: int) -> np.ndarray:
    return low.repeat(scale, 0).repeat(scale, 1)[:height, :width]


class NearestUpscaler:
    """Stands for the network: repeats pixels, so that every value can be foretold."""

    device_name = "stand-in"

    def __init__(self, scale: int) -> None:
        self.scale = scale
        self.calls: list[dict[str, Any]] = []

    def __call__(
        self, radiance: np.ndarray, albedo: np.ndarray, normal: np.ndarray, **more: Any
    ) -> Any:
        from types import SimpleNamespace

        height, width = albedo.shape[:2]
        assert radiance.shape[:2] == (-(-height // self.scale), -(-width // self.scale))
        assert albedo.shape == normal.shape
        self.calls.append({"radiance": radiance, "albedo": albedo, **more})
        if more["progress"](0.5) is False:
            from xrds_core.errors import Cancelled

            raise Cancelled
        return SimpleNamespace(radiance=nearest(radiance, self.scale, height, width))


@pytest.fixture
def network(monkeypatch: pytest.MonkeyPatch) -> list[NearestUpscaler]:
    """Put NearestUpscaler in the network's place; the ones made so far."""
    from xrds_blender.rendering import loading

    made: list[NearestUpscaler] = []

    def load(network: Any, *_: Any) -> NearestUpscaler:
        made.append(NearestUpscaler(network.scale))
        return made[-1]

    monkeypatch.setattr(loading, "_load_network", load)
    return made


@pytest.fixture
def life(still_life: Callable[..., Any]) -> Any:
    """The still life at an odd size, for renders under XRDS."""
    from xrds_blender.interface.registration import ensure_registered

    ensure_registered()
    scene = still_life(45, 33)
    scene.cycles.seed = 1
    scene.xrds.mode = "x2"
    return scene


@pytest.fixture
def blend(life: Any, tmp_path: Path) -> Path:
    """The still life under a camera that moves, in a file; 64 x 48, one sample."""
    life.render.resolution_x, life.render.resolution_y = 64, 48
    life.cycles.samples = 1
    for frame in (1, 5):
        life.camera.location.x = 0.05 * (frame - 3)
        life.camera.keyframe_insert("location", frame=frame)
    path = tmp_path / "shot.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def load_image(path: Any) -> np.ndarray:
    """Pixels of a written picture, (height, width, 4), row 0 on top."""
    image = bpy.data.images.load(str(path))
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    width, height = image.size
    bpy.data.images.remove(image)
    return pixels.reshape(height, width, 4)[::-1]


@pytest.fixture
def load() -> Callable[..., np.ndarray]:
    """`load_image`, for tests that write their own files."""
    return load_image


@pytest.fixture
def written(tmp_path: Any) -> Callable[..., np.ndarray]:
    """Render a scene with Blender's operator and read the EXR that it wrote."""

    from xrds_blender.interface.registration import ensure_registered

    ensure_registered()

    def render(scene: Any, engine: str = "XRDS") -> np.ndarray:
        scene.render.engine = engine
        settings = scene.render.image_settings
        settings.file_format, settings.color_depth = "OPEN_EXR", "32"
        settings.color_mode = "RGBA"
        scene.render.filepath = str(tmp_path / f"{engine}.exr")
        bpy.ops.render.render(write_still=True)
        return load_image(scene.render.filepath)

    return render
