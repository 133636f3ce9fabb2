"""`xrds bench own-seconds`: what finishing a frame of a shot costs, part by part.

Frames of synthetic samples, without a renderer. All parts run once per round, on as
many cores as asked for, so that a slow minute of the machine hits all; told are
medians. Beside the seconds stand the bytes that a part has to read and write, and how
long this machine's memory takes for them.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest.mock import patch

import numpy as np

from xrds_core.accumulation import accumulate as accumulation
from xrds_core.accumulation.coarse_rejection import tile_weights
from xrds_core.accumulation.equal_noise import IndependentFrames
from xrds_core.accumulation.frame import Frame, Stored, store
from xrds_core.accumulation.local_filters import find_ranges, find_rims
from xrds_core.accumulation.object_motion import Movement
from xrds_core.accumulation.reprojection import pair
from xrds_core.accumulation.weighted_sums import Work
from xrds_core.denoising import Denoiser
from xrds_core.exr import openexr_io
from xrds_core.files import replacing, write_json
from xrds_core.finish import Finished, finish_frame
from xrds_core.frame_source import FrameSource, Neighbourhood, finish_frames
from xrds_core.native.library import processors
from xrds_core.overlap import Overlap
from xrds_core.shot import Shot

from ..bench import machine
from ..bench.folder_of_report import make_folder
from ..progress import report_line
from .synthetic import frame

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    Row = dict[str, Any]
    Runs = dict[str, list[tuple[float, float]]]

RADIUS = 4
QUALITY = "high"
PARTS = {
    "read": "OpenEXR: reading a frame",
    "store": "packing a frame, its noise",
    "depths": "rims of a frame, ranges of depth",
    "motion": "what moves by itself in a frame",
    "noise": "whether a frame has noise of its own",
    "tiles": "coarse rejection of all neighbours",
    "guess": "the frame with its nearest neighbours",
    "sums": "all neighbours: gathered, judged, mean",
    "accumulate": "the whole of accumulation, object motion known",
    "denoise": f"one denoising, {QUALITY}",
    "alone": "finishing a frame alone",
    "shot": "finishing a frame of a shot",
    "write": "OpenEXR: writing a frame",
    "card": "a frame whose samples take half a second on a card, all of it",
}
_ON_CARD, _SAMPLING = 4, 0.5  # frames in a row, and seconds of the samples of each


def bench_own_seconds(
    out: Path,
    size: tuple[int, int],
    *,
    samples: tuple[int, ...] = (2, 16),
    rounds: int = 3,
    cores: tuple[int, ...] | None = None,
) -> Row:
    """Measure and write own-seconds.json and own-seconds.md into `out`; returns it.

    `size` is (width, height); `cores` are as many as are used, by default one, two and
    so on, doubled.
    """
    make_folder(out)
    counts = cores or _doubled(processors())
    bandwidth = _bandwidth()
    points = [
        row
        for each in samples
        for row in _points(size, each, counts, rounds, bandwidth)
    ]
    results = {
        "settings": {
            "size": list(size),
            "radius": RADIUS,
            "quality": QUALITY,
            "rounds": rounds,
        },
        "machine": machine.describe(),
        "bandwidth": bandwidth,
        "points": points,
        "ratios": ratios(points),
        "failures": {},
    }
    write_json(out / "own-seconds.json", results)
    with replacing(out / "own-seconds.md") as part:
        part.write_text(page(results), "utf-8")
    return results


def ratios(points: Iterable[Row]) -> list[Row]:
    """Of each number of samples and cores: what accumulation and a shot's frame cost,
    in denoisings, and what more cores bring.
    """
    found: dict[tuple[int, int], dict[str, float]] = {}
    for row in points:
        seconds = found.setdefault((row["samples"], row["cores"]), {})
        seconds[row["part"]] = row["seconds"]
    return [
        {
            "samples": samples,
            "cores": cores,
            "accumulate": seconds["accumulate"] / seconds["denoise"],
            "shot_over_alone": (seconds["shot"] - seconds["alone"])
            / seconds["denoise"],
            "card": seconds["card"] / max(_SAMPLING, seconds["shot"]),
            "efficiency": found[samples, 1]["sums"] / seconds["sums"] / cores
            if (samples, 1) in found
            else None,
        }
        for (samples, cores), seconds in found.items()
    ]


def _points(
    size: tuple[int, int],
    samples: int,
    counts: tuple[int, ...],
    rounds: int,
    bandwidth: float,
) -> list[Row]:
    numbers = range(1, 2 * RADIUS + 1 + _ON_CARD)
    frames = {n: replace(frame(n, *size), samples=float(samples)) for n in numbers}
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for cores in counts:
            report_line(f"{samples} samples, {cores} cores")
            bench = _Bench(frames, Path(folder) / "frame.exr", cores)
            with machine.only_cores(cores):
                for _ in range(rounds):
                    bench.round()
            rows += [
                {"samples": samples, "cores": cores, **row}
                for row in bench.rows(bandwidth)
            ]
    return rows


class _Bench:
    """All parts of finishing a frame on some cores, run once by each `round`."""

    def __init__(self, frames: dict[int, Frame], path: Path, cores: int) -> None:
        self._frames, self._path, self._cores = frames, path, cores
        self._middle = min(frames) + RADIUS
        self._stored = {n: store(x) for n, x in frames.items()}
        self._denoiser = Denoiser(QUALITY, "cpu", threads=cores)
        self._runs: Runs = {}
        self._bytes: dict[str, int] = {}

    def rows(self, bandwidth: float) -> list[Row]:
        """Medians, in the order of `PARTS`."""
        return [
            {
                "part": part,
                "seconds": statistics.median(x for x, _ in self._runs[part]),
                "processor_seconds": statistics.median(x for _, x in self._runs[part]),
                "bytes": self._bytes.get(part),
                "least_seconds": self._bytes[part] / bandwidth
                if part in self._bytes
                else None,
            }
            for part in PARTS
            if part in self._runs
        ]

    def round(self) -> None:
        """Run all parts once."""
        own = self._stored[self._middle]
        first, *_ = self._stored
        window = range(first, first + 2 * RADIUS + 1)
        others = [self._stored[n] for n in window if n != self._middle]
        last = self._frames[max(self._frames)]
        packed = self._timed("store", lambda: store(last))
        self._bytes["store"] = _bytes(last) + _bytes(packed)
        self._files(last)
        self._timed("depths", lambda: self._depths(own))
        self._bytes["depths"] = own.inverse_depth.nbytes * 3 + own.inverse_depth.size
        near = {x.number: x for x in (own, others[0])}
        self._timed("motion", lambda: Movement().moving(own, near))
        assert own.vector is not None
        self._bytes["motion"] = own.inverse_depth.nbytes + own.vector.nbytes
        known = IndependentFrames(lambda _: None)
        known.of(own, others[:-1])
        self._timed("noise", lambda: known.of(replace(own), others))
        pairs = [pair(own, x) for x in others]
        self._timed("tiles", lambda: [tile_weights(x) for x in pairs])
        self._finishing(own, others)
        self._on_card()

    def _finishing(self, own: Stored, others: list[Stored]) -> None:
        movement = Movement()
        accumulation.accumulate(own, others, movement)  # finds what moves
        guess, means = Work.guess, Work.means
        timed = self._timed
        with (
            patch.object(
                Work, "guess", lambda *given: timed("guess", lambda: guess(*given))
            ),
            patch.object(
                Work, "means", lambda *given: timed("sums", lambda: means(*given))
            ),
        ):
            found = timed(
                "accumulate",
                lambda: accumulation.accumulate(own, others, movement),
            )
        results = [found.radiance, found.albedo, found.normal, found.samples]
        written = sum(x.nbytes for x in results if x is not None)
        self._bytes["sums"] = sum(map(_bytes, (own, *others))) + written
        passes = found.radiance, found.albedo, found.normal
        timed("denoise", lambda: self._denoiser(*passes))
        timed("alone", lambda: finish_frame(own, [], self._denoiser, movement))
        timed("shot", lambda: finish_frame(own, others, self._denoiser, movement))

    def _on_card(self) -> None:
        """Frames in a row as *Same Picture* takes them: judged, denoised, written."""
        numbers = range(self._middle, self._middle + _ON_CARD)
        movement = Movement()
        source = _Card(self._stored, numbers[0] + RADIUS, movement)

        def finish(frame: Neighbourhood[_Judged]) -> Finished:
            own, found = frame.own
            return finish_frame(own, [], self._denoiser, movement, accumulated=found)

        def write(finished: Finished) -> None:
            planes = {x: finished.picture[..., i] for i, x in enumerate("RGB")}
            openexr_io.write(self._path, planes)

        shot = Shot(tuple(numbers), RADIUS, others=tuple(self._stored))
        clock, processor = time.perf_counter(), time.process_time()
        with Overlap[None](True) as writing:
            for finished in finish_frames(shot, source, finish, beside=True):
                list(writing.put(partial(write, finished)))
            list(writing.rest())
        took = time.perf_counter() - clock, time.process_time() - processor
        each = took[0] / _ON_CARD, took[1] / _ON_CARD
        self._runs.setdefault("card", []).append(each)

    def _depths(self, own: Stored) -> None:
        given = own.inverse_depth, own.shape
        find_rims(*given, own.camera.orthographic)
        find_ranges(*given)

    def _files(self, last: Frame) -> None:
        assert last.radiance is not None
        passes = {"C": last.radiance, "A": last.albedo, "N": last.normal}
        planes = {
            f"{name}.{letter}": np.ascontiguousarray(x[..., i])
            for name, x in passes.items()
            for i, letter in enumerate("RGB")
        }
        self._timed("write", lambda: openexr_io.write(self._path, planes))
        self._timed("read", lambda: openexr_io.read(self._path))
        size = sum(x.nbytes for x in planes.values())
        self._bytes["write"] = self._bytes["read"] = size + self._path.stat().st_size

    def _timed(self, part: str, work: Callable[[], Any]) -> Any:
        clock, processor = time.perf_counter(), time.process_time()
        found = work()
        run = time.perf_counter() - clock, time.process_time() - processor
        self._runs.setdefault(part, []).append(run)
        return found


_Judged = tuple[Stored, accumulation.Accumulated | None]


class _Card(FrameSource[_Judged]):
    """Frames of which those beyond the first window take `_SAMPLING` seconds each."""

    def __init__(
        self, stored: Mapping[int, Stored], last: int, movement: Movement
    ) -> None:
        self._stored, self._last, self._movement = stored, last, movement

    def load(self, number: int) -> _Judged:
        if number > self._last:
            time.sleep(_SAMPLING)
        return self._stored[number], None

    @property
    def prepares(self) -> bool:
        return True

    def prepare(self, frame: Neighbourhood[_Judged]) -> accumulation.Accumulated:
        others = [stored for stored, _ in frame.neighbours.values()]
        return accumulation.accumulate(frame.own[0], others, self._movement)

    def complete(
        self, frame: Neighbourhood[_Judged], prepared: accumulation.Accumulated
    ) -> tuple[_Judged, _Judged]:
        return (frame.own[0], prepared), frame.own


def _bytes(frame: Frame | Stored) -> int:
    """Of all arrays that a frame holds, those of its noise or halves included."""
    held = {**vars(frame)}
    for name in ("noise", "halves"):
        held |= vars(held.get(name)) if held.get(name) else {}
    return sum(x.nbytes for x in held.values() if isinstance(x, np.ndarray))


def _bandwidth() -> float:
    """Bytes per second that one core reads and writes, of arrays beyond its caches."""
    source = np.ones(1 << 25, np.float32)
    target = np.empty_like(source)
    taken = []
    for _ in range(5):
        started = time.perf_counter()
        np.copyto(target, source)
        taken.append(time.perf_counter() - started)
    return 2 * source.nbytes / min(taken)


def _doubled(most: int) -> tuple[int, ...]:
    return tuple(2**k for k in range(most.bit_length()) if 2**k <= most)


def page(results: Row) -> str:
    """The report as Markdown."""
    width, height = results["settings"]["size"]
    lines = [
        "# Our own seconds",
        "",
        "Written by `xrds bench own-seconds`: a frame of synthetic samples, "
        f"{width}x{height}, radius {RADIUS}, by the clock and of the processors; least "
        "is what the bytes that a part has to move take at the "
        f"{results['bandwidth'] / 1e9:.1f} GB/s of one core.",
        "",
        "| samples | cores | part | s | processor s | MB | least s |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in results["points"]:
        moved, least = row["bytes"], row["least_seconds"]
        cells = [row["samples"], row["cores"], PARTS[row["part"]]]
        cells += [f"{row['seconds']:.3f}", f"{row['processor_seconds']:.3f}"]
        cells += ["-" if moved is None else f"{moved / 1e6:.0f}"]
        cells += ["-" if least is None else f"{least:.3f}"]
        lines.append(f"| {' | '.join(map(str, cells))} |")
    lines += [
        "",
        "In denoisings: accumulation, and what a frame of a shot takes more than one "
        "alone; then what cores bring, 1 where twice as many take half; and a frame "
        f"whose samples take {_SAMPLING} s on a card, over the longer one of these and "
        "of finishing.",
        "",
        "| samples | cores | accumulation | shot over alone | efficiency | card |",
        "|---|---|---|---|---|---|",
    ]
    for row in results["ratios"]:
        brings = row["efficiency"]
        cells = [row["samples"], row["cores"], f"{row['accumulate']:.3f}"]
        cells += [f"{row['shot_over_alone']:.2f}"]
        cells += ["-" if brings is None else f"{brings:.2f}", f"{row['card']:.2f}"]
        lines.append(f"| {' | '.join(map(str, cells))} |")
    return "\n".join(lines) + "\n"
