"""OpenEXR works on threads, which a fork of the process does not have."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from xrds_core.children import run_python

PROGRAM = """
import os
import sys
import numpy as np
from xrds_core.exr import openexr_io

plane = np.arange(64 * 64, dtype=np.float32).reshape(64, 64)
openexr_io.write(sys.argv[1], {"Y": plane})
child = os.fork()
path = sys.argv[1] if child else sys.argv[1] + ".child.exr"
openexr_io.write(path, {"Y": plane})
(part,) = openexr_io.read(path)
assert np.array_equal(part.channels["Y"], plane)
if not child:
    os._exit(0)
_, status = os.waitpid(child, 0)
print("written by both" if status == 0 else "failed")
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
@pytest.mark.timeout(120)
def test_a_fork_reads_and_writes_too(tmp_path: Path) -> None:
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    done = run_python(str(program), str(tmp_path / "a.exr"), path=sys.path)
    assert "written by both" in done.stdout, done.stderr
