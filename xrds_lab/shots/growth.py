"""`xrds bench --shots --growth`: how the cost of a shot grows.

Seconds and memory of finishing one frame by its pixels and by the radius, of synthetic
samples, and of a whole shot of small frames by the number of its frames. Each run has a
process of its own: its peak memory is that of nothing else.
"""

from __future__ import annotations

import json
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from xrds_core.children import run_python
from xrds_core.errors import SceneError, UsageError
from xrds_core.files import read_json, replacing, write_json

from ..bench import machine
from ..bench.growth import power
from ..bench.inputs import Folder
from ..bench.journal import Journal
from ..bench.stages import clocked
from ..bench.workload import Meter
from ..progress import report_line

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    Row = dict[str, Any]
    Size = tuple[int, int]

RADII = (1, 2, 4, 8)
COUNTS = (4, 8, 16, 32)
SMALL = (160, 90)
RADIUS, SAMPLES = 4, 2
PIXELS, BY_RADIUS, FRAMES = "pixels", "radius", "frames"
FIGURES = ("seconds", "processor_seconds", "peak_memory")
_MARK = "RUN "


@dataclass(frozen=True)
class Run:
    """One process: a frame of synthetic samples, or `frames` of a scene's shot."""

    by: str
    size: tuple[int, int]
    radius: int = RADIUS
    frames: int = 1
    scene: str = ""

    @property
    def label(self) -> str:
        """Name in files and on the screen."""
        width, height = self.size
        shot = f"{self.frames} frames, " if self.by == FRAMES else ""
        return f"{self.by}: {shot}{width}x{height}, radius {self.radius}"

    @property
    def cost(self) -> float:
        """Relative to others."""
        megapixels = self.size[0] * self.size[1] / 1e6
        return 3.0 + self.frames * (megapixels * (2 * self.radius + 3) + 0.5)


def bench_growth(
    scene: Path,
    out: Path,
    sizes: Sequence[Size],
    *,
    cache: Path | None = None,
    small: Size = SMALL,
) -> dict[str, Any]:
    """Measure what is missing, write growth.json and growth.md into `out`; returns it.

    A frame by its pixels has one of `sizes`, by the radius the first of them; frames of
    `scene` have `small`. Raises UsageError for a scene that is not there and for fewer
    than two sizes.
    """
    if len({width * height for width, height in sizes}) < 2:
        raise UsageError("growth is seen over two sizes or more, as 960x540,1920x1080")
    if not scene.is_file():
        raise UsageError(f"there is no scene {scene}")
    out.mkdir(parents=True, exist_ok=True)
    folder = Folder(cache or out / "cache").directory
    journal = Journal(folder / "journal-growth.json", report_line)
    kept = folder / "growth-runs.json"
    rows: dict[str, list[Row]] = read_json(kept) if kept.is_file() else {}
    left = [run for run in runs(scene, sizes, small) if _key(run) not in rows]
    meter = Meter(sum(run.cost for run in left))
    journal.progress = meter.write
    try:
        for run in left:
            with journal.attempt(run.label):
                rows[_key(run)] = apart(run)
                write_json(kept, rows)
            meter.done(run.cost, run.label)
    finally:
        meter.close()
    wanted = [_key(run) for run in runs(scene, sizes, small)]
    return _written([x for key in wanted for x in rows.get(key, ())], journal, out)


def runs(scene: Path, sizes: Sequence[Size], small: Size = SMALL) -> list[Run]:
    """All processes, the quickest first."""
    shots = [Run(FRAMES, small, RADIUS, n, str(scene.resolve())) for n in COUNTS]
    radii = [Run(BY_RADIUS, sizes[0], radius) for radius in RADII]
    return [*shots, *radii, *(Run(PIXELS, size) for size in sorted(sizes))]


def _key(run: Run) -> str:
    return json.dumps(asdict(run))


def apart(run: Run) -> list[Row]:
    """The rows of a run in a process of its own; raises SceneError where it fails."""
    done = run_python("-m", __name__, _key(run))
    found = done.stdout.rpartition(_MARK)[2]
    if done.returncode or not found:
        last = done.stderr.strip().rpartition("\n")[2]
        raise SceneError(f"its process ended with status {done.returncode}: {last}")
    return list(json.loads(found))


# --- in the process of a run ----------------------------------------------------------


def measured(run: Run) -> Iterator[Row]:
    """The rows of a run, one for each stage."""
    stages = _shot(run) if run.by == FRAMES else _frame(run)
    about = {"by": run.by, "pixels": run.size[0] * run.size[1]}
    about |= {"radius": run.radius, "frames": run.frames}
    for stage, figures in stages:
        yield {**about, "stage": stage, **figures}


def _frame(run: Run) -> Iterator[tuple[str, Row]]:
    """Accumulate and denoise the middle frame of a shot of synthetic samples."""

    from xrds_core.accumulation.accumulate import accumulate
    from xrds_core.accumulation.frame import store
    from xrds_core.accumulation.object_motion import Movement
    from xrds_core.denoising import Denoiser
    from xrds_core.finish import finish_frame

    from .synthetic import frame

    def stored(width: int, height: int, radius: int) -> tuple[Any, list[Any]]:
        shot = range(-radius, radius + 1)
        packed = {n: store(frame(n, width, height)) for n in shot}
        own = packed.pop(0)
        return own, sorted(packed.values(), key=lambda x: abs(x.number))

    denoiser = Denoiser("high", "cpu")
    finish_frame(*stored(64, 48, 1), denoiser, Movement())  # loads what it needs
    own, others = stored(*run.size, run.radius)
    movement = Movement()
    together, figures = _clocked(lambda: accumulate(own, others, movement))
    reused = float((together.samples / own.samples).mean())
    yield "accumulate", figures | {"samples_reused": round(reused, 2)}
    _, figures = _clocked(
        lambda: finish_frame(own, others, denoiser, movement, accumulated=together)
    )
    yield "denoise", figures


def _shot(run: Run) -> Iterator[tuple[str, Row]]:
    """Render a panning shot as `xrds render` does."""
    from xrds_blender.planning.request import render_request
    from xrds_blender.render.shot import render_shot

    from ..bench.inputs import open_scene
    from ..bench.windows import Window
    from .motions import animate

    window = Window(*run.size, 0, 0, *run.size)
    scene = open_scene(Path(run.scene), window)
    middle = run.frames // 2 + 1
    animate(scene, window, "pan", middle, run.frames // 2)
    job = render_request(
        scale=1, samples=SAMPLES, temporal_radius=run.radius, device="cpu"
    )

    def render() -> int:
        return sum(1 for _ in render_shot(scene, job, range(1, run.frames + 1)))

    made, figures = _clocked(render)
    assert made == run.frames
    yield "shot", figures


def _clocked(work: Callable[[], Any]) -> tuple[Any, Row]:
    made: list[Any] = []
    run = clocked(lambda: made.append(work()))
    figures = {
        "seconds": round(run["seconds"], 4),
        "processor_seconds": round(run["cpu"], 4),
        "peak_memory": run["peak"],
    }
    return made[0], figures


# --- the report -----------------------------------------------------------------------


def exponents(rows: Sequence[Row]) -> list[Row]:
    """Powers of the pixels, the radius or the frames by which each stage grows."""
    return [
        {"by": by, "stage": stage}
        | {
            key: power(
                [r for r in rows if (r["by"], r["stage"]) == (by, stage)], key, by
            )
            for key in FIGURES
        }
        for by, stage in dict.fromkeys((r["by"], r["stage"]) for r in rows)
    ]


def _written(rows: list[Row], journal: Journal, out: Path) -> Row:
    results = {
        "settings": {"radius": RADIUS, "samples": SAMPLES, "quality": "high"},
        "machine": machine.describe(),
        "points": rows,
        "exponents": exponents(rows),
        "failures": journal.failures,
    }
    write_json(out / "growth.json", results)
    with replacing(out / "growth.md") as part:
        part.write_text(page(results), "utf-8")
    return results


def page(results: Row) -> str:
    """The report as Markdown."""
    lines = [
        "# How the cost of a shot grows",
        "",
        "Written by `xrds bench --shots --growth`. One frame of synthetic samples, "
        f"accumulated and denoised, radius {RADIUS} where nothing else is said; *shot* "
        "is all frames of a small shot, rendered. Seconds by the clock and of the "
        "processor; memory is the process' peak, with the stored frames.",
        "",
        "| by | stage | pixels | radius | frames | s | processor s | GiB |",
        "|---|---|---|---|---|---|---|---|",
        *(_line(row) for row in results["points"]),
        "",
        "Exponents: the slope of the line through the logarithms.",
        "",
        "| by | stage | s | processor s | GiB |",
        "|---|---|---|---|---|",
    ]
    for fit in results["exponents"]:
        slopes = ("-" if fit[k] is None else f"{fit[k]:.2f}" for k in FIGURES)
        lines.append(f"| {fit['by']} | {fit['stage']} | {' | '.join(slopes)} |")
    return "\n".join(lines) + "\n"


def _line(row: Row) -> str:
    memory = row["peak_memory"]
    cells = [str(row[k]) for k in ("by", "stage", PIXELS, BY_RADIUS, FRAMES)]
    cells += [f"{row[k]:.2f}" for k in ("seconds", "processor_seconds")]
    cells.append("-" if memory is None else f"{memory / 2**30:.2f}")
    return f"| {' | '.join(cells)} |"


def _main() -> int:
    import os

    from xrds_blender.command import console

    words = json.loads(sys.argv[1])
    run = Run(**(words | {"size": tuple(words["size"])}))
    told = os.fdopen(os.dup(1), "w")
    with console.stdout_to(Path(os.devnull)):
        rows = list(measured(run))
    print(_MARK + json.dumps(rows), file=told, flush=True)
    return 0


if __name__ == "__main__":
    import os

    status = _main()
    sys.stderr.flush()
    os._exit(status)  # Blender's module can hang when its Python ends
