"""`python -m xrds_lab.pages` writes the figures of pages; `--check` compares them."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from .results import Results
from .writing import Pages

ROOT = Path(__file__).resolve().parents[2]


def main() -> int:
    """Write or check the pages of this checkout."""
    parser = argparse.ArgumentParser("python -m xrds_lab.pages", description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing")
    parser.add_argument(
        "--draw", action="store_true", help="figures of shots, method, source, too"
    )
    options = parser.parse_args()
    pages = Pages(ROOT)
    if options.check:
        faults = list(pages.faults())
        print("\n".join(faults), file=sys.stderr, end="\n" if faults else "")
        return 1 if faults else 0
    pages.write()
    if options.draw:
        # matplotlib, which checking does not need
        from . import architecture, method, shot_plot

        method.draw(ROOT / "docs/images/method.svg")
        shot_plot.draw(Results(ROOT / "docs/results"), ROOT / "docs/images/shots.svg")
        architecture.draw(ROOT / "docs/images/architecture.svg")
    return 0


if __name__ == "__main__":
    sys.exit(main())
