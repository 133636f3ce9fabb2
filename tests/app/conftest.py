"""One Blender window for all tests of a program, fresh from its first start."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

from program import Program, Window, programs  # beside the tests

ROOT = HERE.parents[1]
ARTIFACTS = ROOT / "build" / "app"
NONE = "no Blender program: make test-app fetches one, or name some in XRDS_BLENDERS"


@pytest.fixture(scope="session")
def extension(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The small zip: the programs have a PyTorch of their own."""
    out = tmp_path_factory.mktemp("zip")
    script = ROOT / "extension" / "build.py"
    command = [sys.executable, str(script), "--without-torch", "--out", str(out)]
    subprocess.run(command, check=True, capture_output=True)
    (path,) = out.glob("*.zip")
    return path


@pytest.fixture(scope="session", params=programs() or [None], ids=str)
def program(request: pytest.FixtureRequest, extension: Path) -> Program:
    """A program with a folder of its own under build/app, emptied first."""
    if request.param is None:
        pytest.skip(NONE)
    share = ARTIFACTS / request.param.name
    shutil.rmtree(share, ignore_errors=True)
    (share / "home").mkdir(parents=True)
    shutil.copy(extension, share)
    return Program(request.param, share)


@pytest.fixture(scope="session")
def window(program: Program) -> Iterator[Window]:
    """Blender's window; its screenshots stay in build/app/PROGRAM/shots."""
    with Window(program) as found:
        yield found
