"""Many frames in one process; `xrds stability --parts load` renders two hundred."""

from __future__ import annotations

import gc
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from xrds_lab.weights import save_network

bpy = pytest.importorskip("bpy")
pytest.importorskip("torch")

from xrds_core.superres import weights
from xrds_core.superres.network import XRDS, preset_config
from xrds_lab.stability import load
from xrds_lab.stability.load import FrameLoad, drive, growth, settled

pytestmark = pytest.mark.nightly  # it takes minutes

FRAMES = 24


@pytest.fixture
def moving(life: Any) -> Any:
    """The still life with a cube that is elsewhere in every frame."""
    cube = bpy.data.objects["Red"]
    for frame in (1, FRAMES):
        cube.location.x = 0.1 * frame
        cube.keyframe_insert("location", frame=frame)
    return life


@pytest.fixture
def untrained(tmp_path: Path) -> Path:
    """A folder with weights: the stand-in would keep what it is given."""
    made = XRDS(preset_config("fast", 2))
    save_network(made, tmp_path / weights.file_name("fast", 2), {})
    return tmp_path


def test_frames_leave_neither_memory_nor_data_blocks(
    moving: Any, untrained: Path
) -> None:
    choices = {"samples": 1, "guide_samples": 1, "weights": untrained, "threads": 1}
    drive(moving, FRAMES // 3, scale=2, **choices)
    tracemalloc.start()
    try:
        drive(moving, 1, scale=2, **choices)
        gc.collect()
        before, _ = tracemalloc.get_traced_memory()
        frames = drive(moving, FRAMES, scale=2, **choices)
        gc.collect()
        after, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    # arrays and objects of ours; one picture of this size alone is 18 KiB
    assert (after - before) / FRAMES < 2**11
    assert len({frame.data_blocks for frame in frames}) == 1
    # what Cycles and torch hold goes up and down by megabytes
    half = FRAMES // 2
    early, late = (min(x.memory for x in y) for y in (frames[:half], frames[half:]))
    assert (late - early) / half < 2**19


def test_an_animation_leaves_no_data_blocks(
    moving: Any, network: Any, tmp_path: Path
) -> None:
    moving.render.engine = "XRDS"
    moving.render.filepath = str(tmp_path / "#")
    moving.frame_start, moving.frame_end = 1, 3
    bpy.ops.render.render(animation=True)  # makes the Render Result
    before = load._data_blocks()
    bpy.ops.render.render(animation=True)
    assert load._data_blocks() == before


def test_a_leak_is_found() -> None:
    noise = np.random.default_rng(0).normal(0, 300, 100)
    assert abs(growth(noise)) < 4
    assert growth(noise + 20.0 * np.arange(100)) == pytest.approx(20, abs=4)
    assert growth([0.0] * 40 + [5000.0] + [0.0] * 40) == 0


def test_what_settles_is_left_out() -> None:
    frames = [FrameLoad(number, 0, 0.0) for number in range(30)]
    assert settled(frames)[0].memory == 10
