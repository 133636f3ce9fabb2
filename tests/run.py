"""Run every test: core ones together, each Blender module in its own process.

A process that rendered with the bpy module can hang when it ends, so each module of
tests/blender gets its own process and a time limit; its verdict is read from the
JUnit file that pytest writes before the interpreter ends.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ET
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

TESTS = Path(__file__).resolve().parent
MODULE_LIMIT = 1200.0  # seconds for one process; single tests have their own limit
EXIT_GRACE = 10.0  # seconds to end after the last test


@dataclass(frozen=True)
class Verdict:
    """What one pytest process said; `ok` is False when it said nothing."""

    name: str
    ok: bool
    counts: Counter[str]
    seconds: float


def read_report(report: Path) -> Counter[str] | None:
    """Count passed, failed and skipped tests in a JUnit file; None if it has none."""
    try:
        suite = next(ET.parse(report).getroot().iter("testsuite"))
    except (OSError, ET.ParseError, StopIteration):
        return None
    told = Counter(
        failed=int(suite.get("failures", 0)) + int(suite.get("errors", 0)),
        skipped=int(suite.get("skipped", 0)),
    )
    told["passed"] = int(suite.get("tests", 0)) - told.total()
    return told


def wait(child: subprocess.Popen[bytes], report: Path, deadline: float) -> None:
    """Wait until the process ends; kill it soon after its report, or when late."""
    while child.poll() is None:
        try:
            child.wait(1.0)
        except subprocess.TimeoutExpired:
            if read_report(report) is not None:
                deadline = min(deadline, time.perf_counter() + EXIT_GRACE)
            if time.perf_counter() > deadline:
                child.kill()


def run(name: str, paths: list[Path], options: list[str]) -> Verdict:
    """Run pytest on `paths` in its own process and read what it reported."""
    start = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.xml"
        command = [sys.executable, "-m", "pytest", f"--junit-xml={report}", *options]
        with subprocess.Popen([*command, *map(str, paths)], cwd=TESTS.parent) as child:
            wait(child, report, start + MODULE_LIMIT)
        counts = read_report(report)
    seconds = time.perf_counter() - start
    if counts is None:
        print(f"{name}: no report; exit status {child.returncode}", flush=True)
        return Verdict(name, False, Counter(failed=1), seconds)
    ok = counts["failed"] == 0 and counts.total() > 0
    return Verdict(name, ok, counts, seconds)


def batches() -> list[tuple[str, list[Path]]]:
    """Name and files of every pytest process: one for all that needs no Blender."""
    blender = sorted((TESTS / "blender").glob("test_*.py"))
    # tests/app needs a Blender program and half an hour: make test-app.
    app = set((TESTS / "app").glob("test_*.py"))
    plain = [p for p in TESTS.rglob("test_*.py") if p not in {*blender, *app}]
    found = [("core", sorted(plain))] if plain else []
    return found + [(f"blender/{path.stem}", [path]) for path in blender]


def closing_line(verdicts: list[Verdict]) -> str:
    """Write the totals as pytest writes its own closing line."""
    total: Counter[str] = sum((v.counts for v in verdicts), Counter())
    told = ", ".join(f"{n} {word}" for word, n in sorted(total.items()) if n)
    return f"{told or 'no tests'} in {sum(v.seconds for v in verdicts):.0f} s"


def main() -> int:
    """Run the batches named on the command line, or all; 0 when nothing failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("only", nargs="*", help="parts of batch names, as engine")
    wanted, options = parser.parse_known_args()
    chosen = [
        (name, paths)
        for name, paths in batches()
        if not wanted.only or any(part in name for part in wanted.only)
    ]
    verdicts = []
    for name, paths in chosen:
        print(f"--- {name}", flush=True)
        verdicts.append(run(name, paths, options))
    print("=" * 60)
    for verdict in verdicts:
        told = ", ".join(f"{n} {word}" for word, n in verdict.counts.items() if n)
        print(f"{verdict.name:40} {verdict.seconds:6.0f} s  {told}")
    print(closing_line(verdicts))
    return 0 if verdicts and all(v.ok for v in verdicts) else 1


if __name__ == "__main__":
    sys.exit(main())
