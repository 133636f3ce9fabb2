"""`python -m xrds_lab.held_out ASSETS OUT` builds the held-out scenes as .blend files.

They are measured by `xrds bench shots OUT/*.blend --motions file`.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from xrds_core.errors import XRDSError

from ..progress import report_line
from .scenes import build, listed


def main() -> int:
    """Build the scenes; 2 where something is missing."""
    from xrds_blender.command import console

    parser = argparse.ArgumentParser("python -m xrds_lab.held_out", description=__doc__)
    parser.add_argument(
        "assets", type=Path, help="folder of models, hdris and textures"
    )
    parser.add_argument("out", type=Path, help="folder for NAME.blend")
    names = [scene.name for scene in listed()]
    parser.add_argument(
        "--scenes", nargs="+", default=(), metavar="NAME", choices=names
    )
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    try:
        with console.stdout_to(options.out / "blender.log"):
            for path in build(options.assets, options.out, options.scenes):
                report_line(f"{path}")
    except XRDSError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    status = main()
    sys.stderr.flush()
    os._exit(status)  # Blender's module can hang when its Python ends
