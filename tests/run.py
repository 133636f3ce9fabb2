"""Run the tests: core ones together, each other module by itself, two at once.

A process that rendered with the bpy module can hang when it ends, so each module of
tests/blender and tests/lab gets its own process, which leaves with pytest's exit status
and without an interpreter's end. That status is the verdict; the JUnit file counts.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ET
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

TESTS = Path(__file__).resolve().parent
# Most of a test's seconds run on one core. Two pools of OpenMP's threads, which spin
# while they wait, would take each other's.
AT_ONCE = 2
# Seconds for one process that hangs; single tests have their own limit. Both are far
# above what a test takes, so that a busy machine fails none.
MODULE_LIMIT = 5400.0
NO_TESTS = 5  # pytest's exit status where it ran none
NIGHTLY = "not nightly"
PYTEST = """
import os, sys
import pytest
status = pytest.main(sys.argv[2:])
with open(sys.argv[1], "w") as file:
    file.write(str(sum(os.times()[:4])))
sys.stdout.flush()
sys.stderr.flush()
os._exit(status)
"""


@dataclass(frozen=True)
class Verdict:
    """What one pytest process said; `ok` is False when it did not come to its end.

    `processor` are seconds of all cores, its child processes' too.
    """

    name: str
    ok: bool
    counts: Counter[str]
    seconds: float
    processor: float


def read_counts(report: Path) -> Counter[str]:
    """Count passed, failed and skipped tests in a JUnit file; none if it has none."""
    try:
        suite = next(ET.parse(report).getroot().iter("testsuite"))
    except (OSError, ET.ParseError, StopIteration):
        return Counter()
    told = Counter(
        failed=int(suite.get("failures", 0)) + int(suite.get("errors", 0)),
        skipped=int(suite.get("skipped", 0)),
    )
    told["passed"] = int(suite.get("tests", 0)) - told.total()
    return told


def run(name: str, paths: list[Path], options: list[str]) -> Verdict:
    """Run pytest on `paths` in its own process; it failed if it was cut short."""
    start = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        report, times = Path(folder) / "report.xml", Path(folder) / "times"
        command = [sys.executable, "-c", PYTEST, str(times), f"--junit-xml={report}"]
        command += options
        try:
            done = subprocess.run(
                [*command, *map(str, paths)],
                cwd=TESTS.parent,
                check=False,
                timeout=MODULE_LIMIT,
                env={**os.environ, "OMP_NUM_THREADS": "1"},
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
            )
            ended, printed = f"exit status {done.returncode}", done.stdout
            left_out = done.returncode == NO_TESTS and b" deselected" in printed
            ok = done.returncode == 0 or left_out
        except subprocess.TimeoutExpired as error:
            ended, printed = f"stopped after {MODULE_LIMIT:.0f} s", error.stdout or b""
            ok = False
        counts = read_counts(report)
        processor = float(times.read_text()) if times.is_file() else 0.0
    print(f"--- {name}\n{printed.decode(errors='replace')}", end="", flush=True)
    if not ok and not counts["failed"]:  # interrupted, crashed, hung or empty
        print(f"{name}: {ended}, with no test failed", flush=True)
        counts["failed"] += 1
    return Verdict(name, ok, counts, time.perf_counter() - start, processor)


def batches() -> list[tuple[str, list[Path]]]:
    """Name and files of every pytest process: one for all that needs no Blender.

    tests/app is not among them: it needs a Blender program and half an hour.
    """
    core = [*TESTS.glob("test_*.py"), *(TESTS / "core").rglob("test_*.py")]
    apart = ("blender", "extension", "lab")
    alone = sorted(p for name in apart for p in (TESTS / name).rglob("test_*.py"))
    named = [(str(p.relative_to(TESTS).with_suffix("")), [p]) for p in alone]
    return [("core", sorted(core)), *named]


def closing_line(verdicts: list[Verdict], seconds: float) -> str:
    """Write the totals as pytest writes its own closing line."""
    total: Counter[str] = sum((v.counts for v in verdicts), Counter())
    told = ", ".join(f"{n} {word}" for word, n in sorted(total.items()) if n)
    processor = sum(v.processor for v in verdicts)
    return f"{told or 'no tests'} in {seconds:.0f} s, {processor:.0f} s of processors"


def main() -> int:
    """Run the batches named on the command line, or all; 0 when nothing failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("only", nargs="*", help="parts of batch names, as engine")
    parser.add_argument("--all", action="store_true", help="the nightly ones, too")
    wanted, options = parser.parse_known_args()
    if not wanted.all:
        options += ["-m", NIGHTLY]
    chosen = [
        (name, paths)
        for name, paths in batches()
        if not wanted.only or any(part in name for part in wanted.only)
    ]
    start = time.perf_counter()
    with ThreadPoolExecutor(AT_ONCE) as workers:
        verdicts = [*workers.map(lambda batch: run(*batch, options), chosen)]
    print("=" * 60)
    for verdict in verdicts:
        told = ", ".join(f"{n} {word}" for word, n in verdict.counts.items() if n)
        times = f"{verdict.seconds:6.0f} s {verdict.processor:6.0f} s"
        print(f"{verdict.name:40} {times}  {told}")
    print(closing_line(verdicts, time.perf_counter() - start))
    return 0 if verdicts and all(v.ok for v in verdicts) else 1


if __name__ == "__main__":
    sys.exit(main())
