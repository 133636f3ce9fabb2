"""Stereo files: every view is finished, whichever way its channels are named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
import sequences
import shots
from sequences import CYCLES, frame

from xrds_core import exr

pytest.importorskip("mitsuba_oidn")

from xrds_core.denoising import Denoiser
from xrds_core.shot_files.frame_file import Reading, read_frame
from xrds_core.shot_files.sequence import Files, denoise_sequence

PLAIN = {"radiance": "RGB", "albedo": "albedo.RGB", "normal": "N.XYZ", "depth": "Z"}
VIEWS = ("left", "right")


def nuke(name: str, view: str) -> str:
    return name if view == "left" else f"{view}.{name}"


def standard(name: str, view: str) -> str:
    layer, dot, letter = name.rpartition(".")
    return name if view == "left" else f"{layer}{dot}{view}.{letter}"


def blender(name: str, view: str) -> str:
    layer, _, letter = name.rpartition(".")
    return f"{layer}.{view}.{letter}"


def eye(number: int, view: str) -> Any:
    """A frame as one eye sees it."""
    x = 0.1 * number + (0.2 if view == "right" else 0.0)
    camera = sequences.single(shots.camera(x=x))
    own = shots.view(number, camera, noise=0.5)
    noise = np.random.default_rng((number, view == "right")).gamma(
        4, 1 / 4, (48, 64, 1)
    )
    light = (own.colour * noise).astype(np.float32)
    return replace(own.frame, radiance=light), own.colour


def channels(number: int, names: Any, named: Callable[[str, str], str]) -> Any:
    return {
        named(name, view): np.ascontiguousarray(plane)
        for view in VIEWS
        for name, plane in sequences.planes(vars(eye(number, view)[0]), names).items()
    }


def header(number: int) -> dict[str, Any]:
    told = sequences.cameras.to_header(frame(number).camera)
    matrices = {k: np.array(v, np.float32) for k, v in told.items()}
    return {"type": OpenEXR.scanlineimage, "xrds/samples": 4, **matrices}


def write_parts(path: Path, number: int) -> None:
    """A part for each view; the camera is told by the first one alone."""
    parts = []
    for view in VIEWS:
        planes = sequences.planes(vars(eye(number, view)[0]), PLAIN)
        told = header(number) if not parts else {"type": OpenEXR.scanlineimage}
        planes = {k: np.ascontiguousarray(v) for k, v in planes.items()}
        parts.append(OpenEXR.Part({**told, "view": view}, planes, f"part {view}"))
    OpenEXR.File(parts).write(str(path))


WAYS = {
    "nuke": (PLAIN, nuke, True),
    "standard": (PLAIN, standard, True),
    "blender": (CYCLES, blender, False),
    "parts": (PLAIN, None, False),
}


@pytest.mark.parametrize("way", WAYS)
def test_all_views_are_finished(tmp_path: Path, way: str) -> None:
    names, named, is_told = WAYS[way]
    for number in (1, 2, 3):
        path = tmp_path / f"{number}.exr"
        if named is None:
            write_parts(path, number)
            continue
        told = header(number) | ({"multiView": list(VIEWS)} if is_told else {})
        OpenEXR.File(told, channels(number, names, named)).write(str(path))
    files = Files(str(tmp_path / "#.exr"), str(tmp_path / "out" / "#.exr"))
    said: list[str] = []
    denoiser = Denoiser("fast", "cpu", threads=1)
    denoise_sequence(files, denoiser, frames=[2], say=said.append)
    assert len(said) == 1
    before = read_frame(tmp_path / "2.exr", 2, Reading())
    views = {"left": before, **before.others}
    assert list(views) == list(VIEWS)
    assert all(each.reusable and each.stored.samples == 4 for each in views.values())
    old, new = (exr.File(tmp_path / x / "2.exr") for x in ("", "out"))
    changed = {
        (part.name, name)
        for part, other in zip(old.parts, new.parts, strict=True)
        for name, plane in other.channels.items()
        if not np.array_equal(plane, part.channels.get(name))
    }
    assert len(changed) == 6
    for view, each in views.items():
        planes = new.parts[each.part].channels
        picture = np.stack([planes[x] for x in each.channels[:3]], -1)
        noisy, clean = eye(2, view)
        error = np.abs(picture - clean).mean()
        assert error < 0.4 * np.abs(noisy.radiance - clean).mean()


def test_a_view_that_cannot_be_finished_is_named(tmp_path: Path) -> None:
    planes = channels(1, PLAIN, nuke)
    planes = {k: v for k, v in planes.items() if not k.startswith("right.albedo")}
    told = header(1) | {"multiView": list(VIEWS)}
    OpenEXR.File(told, planes).write(str(tmp_path / "1.exr"))
    files = Files(str(tmp_path / "1.exr"), str(tmp_path / "out.exr"))
    said: list[str] = []
    denoise_sequence(files, Denoiser("fast", "cpu", threads=1), say=said.append)
    assert any("the view right stays as noisy as it is" in line for line in said)


def test_the_picture_alone_holds_all_views(tmp_path: Path) -> None:
    told = header(1) | {"multiView": list(VIEWS)}
    OpenEXR.File(told, channels(1, PLAIN, nuke)).write(str(tmp_path / "1.exr"))
    files = Files(str(tmp_path / "1.exr"), str(tmp_path / "out.exr"), picture_only=True)
    denoise_sequence(files, Denoiser("fast", "cpu", threads=1))
    (part,) = exr.File(tmp_path / "out.exr").parts
    assert set(part.channels) == {*"RGB", "right.R", "right.G", "right.B"}


@pytest.mark.parametrize(
    "value", [np.eye(4, dtype=np.float32), "left", ["left"], ["", "right"], ["a", "a"]]
)
def test_a_list_of_views_that_is_none_is_no_stereo_file(
    tmp_path: Path, value: Any
) -> None:
    planes = sequences.planes(vars(frame(1)), PLAIN)
    planes = {name: np.ascontiguousarray(plane) for name, plane in planes.items()}
    OpenEXR.File(header(1) | {"multiView": value}, planes).write(
        str(tmp_path / "1.exr")
    )
    assert not read_frame(tmp_path / "1.exr", 1, Reading()).others
