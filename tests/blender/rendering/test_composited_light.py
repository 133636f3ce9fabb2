"""Compositors that grade light groups, or rebuild the picture from its lobes.

F12, an animation and the command give them the same light. The command has no
compositor: what it writes is graded here.
"""

from __future__ import annotations

from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from channels import read_channels
from light_passes import with_light_passes

bpy = pytest.importorskip("bpy")
pytest.importorskip("mitsuba_oidn")

from compositing import compositor

from xrds_blender.command import main

GAINS = {"Combined_lamps": 2.0, "Combined_world": 0.5}
LOBES = (("Diffuse", "Diff"), ("Glossy", "Gloss"), ("Transmission", "Trans"))
EXPOSED = 1.5
OTHERS = {"Emission": "Emit", "Environment": "Env"}  # lights without a colour
_MIXES = hasattr(bpy.types, "CompositorNodeMixRGB")  # up to Blender 4.5


class Tree:
    """A compositor that writes what its nodes make of the first layer's passes."""

    def __init__(self, scene: Any) -> None:
        self.tree, self.out = compositor(scene)
        self.layers = self.tree.nodes.new("CompositorNodeRLayers")

    def __getitem__(self, name: str) -> Any:
        """A pass, by its name in files or by that of its socket."""
        return self.layers.outputs[name]

    def mix(self, how: str, one: Any, two: Any) -> Any:
        if _MIXES:
            node = self.tree.nodes.new("CompositorNodeMixRGB")
            first, second = node.inputs[1], node.inputs[2]
        else:
            node = self.tree.nodes.new("ShaderNodeMix")
            node.data_type = "RGBA"
            first, second = (
                x for x in node.inputs if x.type == "RGBA" and x.name in "AB"
            )
        node.blend_type = how
        node.inputs[0].default_value = 1.0
        for given, into in ((one, first), (two, second)):
            if isinstance(given, float):
                into.default_value = (given, given, given, 1.0)
            else:
                self.tree.links.new(given, into)
        return node.outputs[0] if _MIXES else node.outputs[2]

    def add(self, parts: Any) -> Any:
        return reduce(lambda one, two: self.mix("ADD", one, two), parts)

    def write(self, socket: Any) -> None:
        self.tree.links.new(socket, self.out)


def grade_groups(tree: Tree) -> Any:
    return tree.add(tree.mix("MULTIPLY", tree[x], k) for x, k in GAINS.items())


def rebuild(tree: Tree) -> Any:
    """(Direct + Indirect) x Color of each lobe, and what has no colour."""
    sockets = {x.name: x for x in tree.layers.outputs}

    def light(name: str) -> Any:
        return sockets[name] if name in sockets else sockets[_old(name)]

    lobes = [
        tree.mix(
            "MULTIPLY",
            tree.add([light(f"{lobe} Direct"), light(f"{lobe} Indirect")]),
            light(f"{lobe} Color"),
        )
        for lobe, _ in LOBES
    ]
    whole = tree.add([*lobes, *(light(x) for x in OTHERS)])
    return tree.mix("MULTIPLY", whole, EXPOSED)


def graded_here(parts: dict[str, np.ndarray]) -> np.ndarray:
    return np.asarray(sum(gain * parts[name] for name, gain in GAINS.items()))


def rebuilt_here(parts: dict[str, np.ndarray]) -> np.ndarray:
    lobes = [(parts[f"{x}Dir"] + parts[f"{x}Ind"]) * parts[f"{x}Col"] for _, x in LOBES]
    return EXPOSED * np.asarray(sum([*lobes, *(parts[x] for x in OTHERS.values())]))


@pytest.fixture
def file(life: Any, tmp_path: Path) -> Path:
    """A still life with all lobes and two light groups that hold all light."""
    with_light_passes(life)
    life.cycles.samples = 4
    life.frame_start = life.frame_end = life.frame_current
    life.render.engine, life.xrds.mode = "XRDS", "full_size"
    life.xrds.temporal_radius = 0
    settings = life.render.image_settings
    settings.file_format, settings.color_depth = "OPEN_EXR", "32"
    settings.exr_codec = "ZIP"
    path = tmp_path / "graded.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def picture(path: Path) -> np.ndarray:
    planes = read_channels(path)
    return np.dstack([planes[x] for x in "RGB"])


def written(path: Path) -> dict[str, np.ndarray]:
    """All passes of three channels of a file that the command wrote."""
    planes = read_channels(path)
    names = {x[:-2] for x in planes if x.endswith(".R")}
    found = {x: np.dstack([planes[f"{x}.{c}"] for c in "RGB"]) for x in names}
    return {_old(name.rpartition(".")[2]): pixels for name, pixels in found.items()}


def _old(name: str) -> str:
    """The short name, which Blender before 5.0 has."""
    long, _, kind = name.partition(" ")
    short = dict(LOBES).get(long, OTHERS.get(long, long))
    return short + {"Direct": "Dir", "Indirect": "Ind", "Color": "Col"}.get(kind, "")


@pytest.mark.parametrize(
    ("make", "here"),
    [(grade_groups, graded_here), (rebuild, rebuilt_here)],
    ids=["light groups", "lobes"],
)
def test_the_compositor_has_the_light_that_files_have(
    file: Path, tmp_path: Path, make: Any, here: Any
) -> None:
    scene = bpy.context.scene
    tree = Tree(scene)
    tree.write(make(tree))
    scene.render.filepath = str(tmp_path / "f12.exr")
    bpy.ops.render.render(write_still=True)
    scene.render.filepath = str(tmp_path / "a_####.exr")
    bpy.ops.render.render(animation=True)
    still = picture(tmp_path / "f12.exr")
    np.testing.assert_array_equal(still, picture(next(tmp_path.glob("a_*"))))
    out = tmp_path / "command.exr"
    words = ["--scale", "1", "--passes", "all", "-o", str(out)]
    assert main.main(["render", str(file), *words]) == 0
    # the compositor multiplies half floats on some devices
    assert here(written(out)) == pytest.approx(still, rel=2e-3, abs=2e-3)
    assert not np.allclose(still, picture(out), rtol=0.1)
