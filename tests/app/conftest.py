"""One Blender window for all tests of a program, fresh from its first start."""

from __future__ import annotations

import re
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


@pytest.fixture(scope="session", params=programs() or [None], ids=str)
def program(request: pytest.FixtureRequest) -> Program:
    """A program with a folder of its own under build/app, emptied first.

    The folder holds the light zip: the programs have a PyTorch of their own.
    """
    if request.param is None:
        pytest.skip(NONE)
    share = ARTIFACTS / request.param.name
    shutil.rmtree(share, ignore_errors=True)
    (share / "home").mkdir(parents=True)
    found = Program(request.param, share)
    build_light_zip(share, python_of(found))
    return found


def python_of(program: Program) -> str:
    """The version of the Python inside the program, as 3.13."""
    code = "import sys; print('python=%d.%d' % sys.version_info[:2])"
    done = program.run("blender", "-b", "--factory-startup", "--python-expr", code)
    (version,) = re.findall(r"^python=(\S+)$", done.stdout, re.MULTILINE)
    return version


def build_light_zip(folder: Path, python: str) -> None:
    script = str(ROOT / "extension" / "build.py")
    which = ["--kind", "light", "--platform", "linux-x64", "--python", python]
    which.append("--any-blender")  # Debian pairs it with a Python of its own
    command = [sys.executable, script, *which, "--out", str(folder)]
    subprocess.run(command, check=True, capture_output=True)


@pytest.fixture(scope="session")
def window(program: Program) -> Iterator[Window]:
    """Blender's window; its screenshots stay in build/app/PROGRAM/shots."""
    with Window(program) as found:
        yield found
