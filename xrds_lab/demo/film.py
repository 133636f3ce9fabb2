"""`python -m xrds_lab.demo.film SCENE.blend -o DIR`: a shot twice, side by side.

By Cycles with its denoiser and by XRDS, each frame in the same seconds: the samples of
both are chosen so, by what a few frames take. Writes film.webp and film.json.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from xrds_blender.command import arguments, console
from xrds_blender.interface.registration import ensure_registered
from xrds_blender.planning.request import render_request
from xrds_blender.planning.settings import DEFAULT_DENOISING
from xrds_blender.rendering.render import render_scene
from xrds_blender.rendering.shot import render_shot
from xrds_core.errors import UsageError
from xrds_core.files import write_json

from ..bench import machine
from ..bench.inputs import open_scene
from ..bench.windows import Window
from ..progress import report_line
from . import comparison

if TYPE_CHECKING:
    from collections.abc import Sequence

    from xrds_core.arrays import Array

    Part = tuple[tuple[int, int], tuple[int, int]]

LARGEST = 3_500_000  # bytes
_WARM = 3  # frames that are timed, after one that loads what is needed
_RADIUS = 4
_APART = 0.02  # of the seconds, at most
_AROUND = 4  # samples, about those asked for, among which equal seconds are sought


@dataclass(frozen=True)
class Line:
    """Seconds of a frame by its samples."""

    fixed: float
    each: float

    def at(self, samples: int) -> float:
        """Return the seconds of so many samples."""
        return self.fixed + self.each * samples


def equal_samples(cycles: Line, ours: Line, samples: int) -> tuple[int, int]:
    """Return samples of Cycles and of ours, near those asked for, of equal seconds."""
    counts = range(max(1, samples - _AROUND), samples + _AROUND + 1)

    def apart(pair: tuple[int, int]) -> tuple[float, int]:
        seconds = cycles.at(pair[0]), ours.at(pair[1])
        distance = abs(seconds[1] / seconds[0] - 1.0)
        # among those that no clock tells apart, what was asked for
        return max(distance, _APART / 4), abs(pair[0] - samples)

    return min(((n, m) for n in counts for m in range(1, 2 * samples)), key=apart)


class Shot:
    """A scene's own frames, rendered either way; seconds are wall clock."""

    def __init__(self, path: Path, size: tuple[int, int]) -> None:
        ensure_registered()
        self.scene = open_scene(path, Window(*size, 0, 0, *size))
        self.scene.render.use_persistent_data = True
        self.frames = range(self.scene.frame_start, self.scene.frame_end + 1)

    def cycles(
        self, samples: int, numbers: Sequence[int]
    ) -> tuple[list[Array], list[float]]:
        """Pictures (H, W, 3), scene-linear, of Cycles + OIDN; seconds of each."""
        job = render_request(plain=True, denoiser=DEFAULT_DENOISING, samples=samples)
        pictures, seconds = [], []
        for number in numbers:
            started = time.perf_counter()
            self.scene.frame_set(number)
            pictures.append(render_scene(self.scene, job).radiance[..., :3])
            seconds.append(time.perf_counter() - started)
        return pictures, seconds

    def xrds(
        self, samples: int, numbers: Sequence[int]
    ) -> tuple[list[Array], list[float]]:
        """The same of a shot; all frames take the mean of its seconds."""
        job = render_request(scale=1, samples=samples, temporal_radius=_RADIUS)
        started, pictures = time.perf_counter(), []
        for _, picture in render_shot(self.scene, job, numbers):
            pictures.append(picture.radiance[..., :3])
        each = (time.perf_counter() - started) / len(numbers)
        return pictures, [each] * len(numbers)

    def lines(self, samples: int) -> tuple[Line, Line]:
        """Seconds of Cycles + OIDN and of a shot, by what a few frames take."""
        few, many = max(1, samples // 4), samples
        some = self.frames[: _WARM + 1]
        self.cycles(few, some[:1])
        low, high = (
            statistics.median(self.cycles(n, some[1:])[1]) for n in (few, many)
        )
        each = max(high - low, 1e-3) / (many - few)
        shot = self.xrds(many, self.frames[: 2 * _RADIUS + 1])[1][0]
        return Line(high - each * many, each), Line(shot - each * many, each)


def main(argv: Sequence[str] | None = None) -> int:
    """Render both and write the film; returns the exit status."""
    parser = argparse.ArgumentParser(
        "python -m xrds_lab.demo.film", description=__doc__
    )
    add = parser.add_argument
    add("scene", type=Path, metavar="SCENE.blend", help="its own frames are shown")
    add("-o", "--out", type=Path, required=True, help="folder")
    add("--samples", type=arguments.positive, default=16, help="about; 16")
    add("--resolution", type=arguments.size, default=(640, 360), metavar="WxH")
    add(
        "--part",
        type=arguments.crop,
        metavar="WxH+X+Y",
        help="shown enlarged below: a half or a third as wide and high",
    )
    add("--stops", type=float, default=0.0, help="brighter than the scene's exposure")
    options = parser.parse_args(argv)
    return console.status_of(lambda: _film(options), lambda lines: lines)


def _film(options: argparse.Namespace) -> list[str]:
    out, part = options.out, options.part
    times = 1 if part is None else _enlargement(part, options.resolution)
    out.mkdir(parents=True, exist_ok=True)
    with console.stdout_to(out / "blender.log"):
        shot = Shot(options.scene, options.resolution)
        report_line("how long a frame takes")
        samples = equal_samples(*shot.lines(options.samples), options.samples)
        rows: list[dict[str, Any]] = []
        films = []
        ways = ("Cycles + OIDN", shot.cycles), ("XRDS", shot.xrds)
        for (label, render), count in zip(ways, samples, strict=True):
            report_line(f"{label}: {count} samples, {len(shot.frames)} frames")
            pictures, seconds = render(count, shot.frames)
            films.append(pictures)
            mean = round(statistics.fmean(seconds), 3)
            rows.append({"way": label, "samples": count, "seconds": mean})
        stops = float(shot.scene.view_settings.exposure) + options.stops
    labels = [f"{r['way']}, {r['samples']} samples\n{r['seconds']:.1f} s" for r in rows]
    light = [
        [_shown(frame * np.float32(2.0**stops), part, times) for frame in film]
        for film in films
    ]
    comparison.play(light, labels, out / "film.webp", LARGEST)
    ratio = round(rows[1]["seconds"] / rows[0]["seconds"], 3)
    about = {"scene": options.scene.stem, "resolution": list(options.resolution)}
    report = {**about, "machine": machine.describe(), "ways": rows, "ratio": ratio}
    write_json(out / "film.json", report)
    return [f"{out / 'film.webp'}: {ratio:.3f} of Cycles' seconds"]


def _enlargement(part: Part, size: tuple[int, int]) -> int:
    """Return how many times as wide and high a part is to be, to fill a frame's size.

    Raises UsageError where no whole number does, or the frame does not hold the part.
    """
    (left, top), (right, bottom) = part
    width, height = right + 1 - left, bottom + 1 - top
    times = size[1] // height
    fills = (width * times, height * times) == size
    if not fills or min(left, top) < 0 or right >= size[0] or bottom >= size[1]:
        raise UsageError(
            f"--part {width}x{height}{left:+}{top:+} does not fit {size[0]}x{size[1]} "
            "pixels: give a half or a third of their width and height, within them"
        )
    return times


def _shown(frame: Array, part: Part | None, times: int) -> Array:
    """A frame (H, W, 3), with a part of it enlarged to the same size below."""
    if part is None:
        return frame
    (left, top), (right, bottom) = part
    detail = frame[top : bottom + 1, left : right + 1]
    return np.concatenate([frame, detail.repeat(times, axis=0).repeat(times, axis=1)])


if __name__ == "__main__":
    console.prepare()
    console.leave(main(sys.argv[1:]))
