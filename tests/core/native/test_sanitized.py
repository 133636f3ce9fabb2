"""Nothing that the compiled core does is undefined, or outside of its arrays."""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[2] / "native_sanitized.py"
CLANGS = ("clang", *(f"clang-{n}" for n in range(22, 12, -1)))


def run(*options: str) -> None:
    command = [sys.executable, str(SCRIPT), *options]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.endswith("nothing found\n")


@pytest.mark.skipif(importlib.util.find_spec("ziglang") is None, reason="needs Zig")
def test_nothing_is_undefined() -> None:
    run("undefined")


@pytest.mark.nightly
@pytest.mark.skipif(sys.platform != "linux", reason="Clang's runtime as Linux has it")
@pytest.mark.skipif(not any(map(shutil.which, CLANGS)), reason="needs Clang")
def test_nothing_is_outside() -> None:
    run("address", "--seconds", "300")
