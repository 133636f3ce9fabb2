"""Cameras of headers and of JSON files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shots

from xrds_core.accumulation.camera import Camera
from xrds_core.accumulation.reprojection import pixels_of
from xrds_core.errors import UsageError
from xrds_core.shot_files import cameras

SIZE = (shots.WIDTH, shots.HEIGHT)
POINTS = np.array([[1.0, 2.0, -9.0, 1.0], [-2.0, 0.5, -5.0, 1.0], [0, -1, -20, 1]]).T


def seen(camera: Camera) -> Any:
    """Places and nearness of some points; for an orthographic camera the depth."""
    x, y, w, near = pixels_of(camera) @ POINTS
    return np.array([x / w, y / w, near / w])


def eye(kind: str) -> Camera:
    camera = shots.camera(1.0, 0.5, 2.0, yaw=0.2, orthographic=kind == "orthographic")
    camera.project[0, 3 if kind == "orthographic" else 2] += 0.1  # a shifted lens
    return camera


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_a_header_tells_the_camera(kind: str) -> None:
    told = cameras.to_header(eye(kind))
    exact = cameras.from_header(told, SIZE)
    assert exact is not None
    np.testing.assert_array_equal(exact.view, eye(kind).view)
    np.testing.assert_array_equal(exact.project, eye(kind).project)
    del told[cameras.PROJECT]
    standard = cameras.from_header(told, SIZE)
    assert standard is not None
    np.testing.assert_allclose(seen(standard), seen(eye(kind)), atol=1e-9)
    assert standard.orthographic == (kind == "orthographic")
    assert cameras.from_header({}, SIZE) is None


def test_the_header_is_openexr_s() -> None:
    """As the standard says: row vectors, NDC from the upper left corner, +Z ahead."""
    camera = eye("perspective")
    told = cameras.to_header(camera)
    across, down, _, w = POINTS.T[0] @ np.array(told["worldToNDC"])
    x, y, near = seen(camera)[:, 0]
    assert across / w * SIZE[0] == pytest.approx(x)
    assert down / w * SIZE[1] == pytest.approx(y)
    *_, ahead, _ = POINTS.T[0] @ np.array(told["worldToCamera"])
    assert ahead == pytest.approx(1 / near)


@pytest.mark.parametrize(
    ("kind", "looks"),
    # of an orthographic camera that looks along -Z the matrices do not say so
    [("perspective", "+Z"), ("perspective", "-Z"), ("orthographic", "+Z")],
)
@pytest.mark.parametrize("ndc", ["-1 to 1, y up", "0 to 1, y up", "scaled"])
def test_other_conventions(kind: str, ndc: str, looks: str) -> None:
    """Several renderers write NDC from -1 to 1; a matrix' scale says nothing."""
    camera = eye(kind)
    view = camera.view if looks == "-Z" else np.diag([1, 1, -1, 1]) @ camera.view
    project = camera.project @ camera.view
    if ndc == "0 to 1, y up":
        project = (
            np.array([[0.5, 0, 0, 0.5], [0, 0.5, 0, 0.5], [0] * 4, [0, 0, 0, 1]])
            @ project
        )
    if ndc == "scaled":
        project = 7.0 * project
    told = {"worldToCamera": view.T.tolist(), "worldToNDC": project.T.tolist()}
    found = cameras.from_header(told, SIZE)
    assert found is not None
    np.testing.assert_allclose(seen(found), seen(camera), atol=1e-9)


@pytest.mark.parametrize(
    "matrix", [np.zeros((4, 4)), np.eye(3), np.full((4, 4), np.nan), -np.eye(4)]
)
def test_matrices_that_are_no_camera_s(matrix: Any) -> None:
    told = {"worldToCamera": np.eye(4).tolist(), "worldToNDC": matrix.tolist()}
    with pytest.raises(ValueError, match=r"matri"):
        cameras.from_header(told, SIZE)


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_a_file_tells_the_camera(tmp_path: Path, kind: str) -> None:
    camera = eye(kind)
    world = np.linalg.inv(camera.view).tolist()
    told: dict[str, Any] = {"to_world": world}
    if kind == "perspective":
        told |= {"focal_length": 36.0 * shots.FOCUS / 2, "shift": [0.05, 0.0]}
    else:
        told |= {"ortho_width": 2 / 0.2, "shift": [-0.05, 0.0]}
    path = tmp_path / "cameras.json"
    path.write_text(json.dumps({"7": told}))
    known = cameras.read_cameras(path)
    found = cameras.camera_of_frame(known, 7, SIZE)
    assert found is not None
    np.testing.assert_allclose(seen(found), seen(camera), atol=1e-9)
    assert cameras.camera_of_frame(known, 8, SIZE) is None
    path.write_text(json.dumps({"7": cameras.to_json(camera)}))
    exact = cameras.camera_of_frame(cameras.read_cameras(path), 7, SIZE)
    assert exact is not None
    np.testing.assert_allclose(seen(exact), seen(camera), atol=1e-9)
    path.write_text(json.dumps({"all": told}))
    assert cameras.camera_of_frame(cameras.read_cameras(path), 8, SIZE) is not None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "is no file of cameras"),
        ("[]", "is no file of cameras"),
        ('{"a": {}}', "is no file of cameras"),
        ('{"1": {"focal_length": 35}}', "lacks 'to_world'"),
        ('{"1": {"to_world": [[1]], "focal_length": 35}}', "4 rows of 4 numbers"),
        ('{"1": {"to_world": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}}', "lacks"),
    ],
)
def test_files_that_cannot_be_read(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "cameras.json"
    path.write_text(text)
    with pytest.raises(UsageError, match=message):
        cameras.read_cameras(path)
