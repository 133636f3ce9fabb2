"""Runs inside the Blender under test: pytest over tests that ask for bpy.

    blender -b --factory-startup --python run_pytest.py -- FOLDER OPTION...

FOLDER holds a copy of the project, and in `site` pytest itself.
"""

from __future__ import annotations

import os
import sys
import traceback

folder, *options = sys.argv[sys.argv.index("--") + 1 :]
sys.path[:0] = [folder, os.path.join(folder, "site")]  # noqa: PTH118
os.chdir(folder)

status = 3
try:
    import pytest

    status = int(pytest.main(options))
except BaseException:
    traceback.print_exc()
finally:
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)  # a Blender that rendered can hang when its Python ends
