"""The farm examples of docs/pipeline.md, read by what reads them on a farm."""

from __future__ import annotations

import importlib
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from flamenco import compile_job

EXAMPLES = Path(__file__).resolve().parents[2] / "docs" / "pipeline"
TEMPLATE = EXAMPLES / "xrds_render.template.yaml"
OPENJD = str(Path(sys.executable).with_name("openjd"))


def test_open_job_description_accepts_the_template() -> None:
    pytest.importorskip("openjd.cli")
    command = [OPENJD, "check", str(TEMPLATE)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "passes validation" in done.stdout


def test_the_check_asks_xrds_for_what_there_is() -> None:
    """Its progress comes from a module of ours, which may move and be renamed."""
    text = TEMPLATE.read_text("utf-8")
    ((package, name),) = re.findall(r"from (xrds_blender[\w.]*) import (\w+)", text)
    module = importlib.import_module(f"{package}.{name}")
    asked = re.findall(rf"\b{name}\.(\w+)", text)
    assert asked
    for each in asked:
        assert callable(getattr(module, each))


@pytest.fixture(scope="module")
def tasks() -> list[dict[str, Any]]:
    """The tasks that the Flamenco job type makes of seven frames in chunks of three."""
    return compile_job(
        {
            "frames": "1-3, 7-10",
            "chunk_size": 3,
            "blendfile": "/shots/a.blend",
            "render_output_path": "/out/######",
            "format": "OPEN_EXR",
        }
    )


def test_flamenco_renders_every_chunk(tasks: list[dict[str, Any]]) -> None:
    assert [task["name"] for task in tasks] == ["render-1-3", "render-7-9", "render-10"]
    (command,) = tasks[1]["commands"]
    args = command["parameters"]["args"]
    assert command["name"] == "blender-render"
    assert args[-2:] == ["--render-frame", "7..9"]
    assert args[args.index("--render-output") + 1] == "/out/######"


def test_flamenco_asks_for_the_engine_before_it_renders(
    tasks: list[dict[str, Any]],
) -> None:
    """The check is Python that ends with status 3 without XRDS, and goes on with it."""
    args = tasks[0]["commands"][0]["parameters"]["args"]
    check = args[args.index("--python-expr") + 1]
    assert args.index("--python-exit-code") < args.index("--python-expr")
    assert args.index("--python-expr") < args.index("--render-frame")
    for engine, there, status in (
        ("XRDS", True, 0),
        ("BLENDER_EEVEE", True, 3),
        ("XRDS", False, 3),
    ):
        assert status_of(check, engine, there) == status


def status_of(check: str, engine: str, there: bool) -> int:
    code = f"""
import sys
from types import SimpleNamespace as N
types = N(RenderEngine=N(bl_rna_get_subclass_py=lambda name: {there}))
scene = N(render=N(engine={engine!r}))
sys.modules["bpy"] = N(types=types, context=N(scene=scene))
exec({check!r})
"""
    done = subprocess.run(
        [sys.executable, "-c", code], check=False, capture_output=True
    )
    return done.returncode
