"""Shots for `fuzz` that are denoised twice, with changes between: `--resume`.

What the second run leaves must equal what a run from nothing makes of the same files.
"""

from __future__ import annotations

import os
import random
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from xrds_core.accumulation.frame import Frame
from xrds_core.exr.openexr_io import write
from xrds_core.shot_files.sample_cache import Origin, write_cached_frame

from . import odd_headers, odd_shots
from .odd_shots import Case

if TYPE_CHECKING:
    from collections.abc import Sequence

Change = Callable[[], object]
Dice = random.Random
_NEW = "new/####.exr"
_SETTINGS = (
    *("--temporal-radius=0", "--temporal-radius=1", "--temporal-radius=2"),
    *("--samples=1", "--samples=64", "--picture-only", "--passes=all"),
    *("--denoise=balanced", "--denoise=high", "--denoise=no"),
    *("--halves=more/####.exr", "--halves=more/0001.exr", "--passes=groups"),
    *("--also=more/####.exr", "--also=more/b.####.exr", "--passes=Emission"),
    *("--crop=8x8+3+2", "--crop=24x18+0+0", "--crop=0x0+0+0"),
    *("--frames=1-3", "--frames=2", "--frames=2-9", "--frames=-1-2"),
    *("--normal-space=camera", "--position-space=camera", "--threads=1"),
    *("--motion-scale=1,-1", "--memory-limit=1M"),
    *("--albedo=V.Normal", "--beauty=V.Combined", "--depth=Z", "--json"),
    *("--camera=cameras.json", "--light-aovs=motion", "--vector=motion"),
)


@dataclass
class Twice(Case):
    """A shot that is denoised, changed, and denoised again with the words `again`."""

    change: Change = lambda: None
    again: Sequence[str] = ()

    @property
    def afresh(self) -> Case:
        """The same as the second run, from nothing."""
        words = [x for x in self.again if x != "--resume"]
        words[words.index("out/####.exr")] = _NEW
        return Case(self.folder, self.folder / "new", words)

    @property
    def resumed(self) -> Case:
        """The second run."""
        return Case(self.folder, self.output, [*self.again])


def make_twice(folder: Path, seed: int, number: int) -> Twice:
    """Write the shot of one case into a folder; the same for the same numbers."""
    dice = Dice(f"twice {seed} {number}")
    for name in ("in", "out", "more", "new"):
        (folder / name).mkdir()
    count = dice.randint(3, 5)
    shot = _Shot(folder, dice)
    for i in range(1, count + 1):
        shot.write(i)
    first, then = (_some(dice, _SETTINGS, (0, 0, 1, 2, 4)) for _ in range(2))
    words = ["denoise", "in/####.exr", "-o", "out/####.exr", "--denoise", "fast"]
    if dice.random() < 0.6:
        then = first
    changes = _some(dice, _CHANGES, (0, 1, 1, 2, 3))

    def change() -> None:
        for each in changes:
            each(shot, dice)

    if dice.random() < 0.2:
        shot.hide(dice.choice(shot.numbers))
    again = [*words, *then, "--resume"]
    return Twice(folder, folder / "out", [*words, *first], 0, change, again)


# --- shots and what changes in them ---------------------------------------------------


class _Shot:
    """Frames of one kind, each with further files, that can be written again."""

    def __init__(self, folder: Path, dice: Dice) -> None:
        self.folder, self._seed = folder, dice.randrange(1 << 30)
        self._style = dice.choice(("flat", "cycles", "cached"))
        self._kind = dice.choice(("perspective", "perspective", "orthographic"))
        self._one_seed, self._still = dice.random() < 0.15, dice.random() < 0.2
        self._odd = dice.choices(odd_shots.HARMLESS, k=dice.choice((0, 0, 0, 1, 2)))
        self._hidden: Path | None = None
        (folder / "cameras.json").write_text("{}")

    @property
    def numbers(self) -> list[int]:
        """The frames that there are."""
        return sorted(int(x.stem) for x in (self.folder / "in").glob("*.exr"))

    def path(self, number: int) -> Path:
        return self.folder / "in" / f"{number:04d}.exr"

    def hide(self, number: int) -> None:
        """Take a frame away until `show`."""
        self._hidden = self.path(number).rename(self.folder / f"{number:04d}.exr")

    def show(self) -> None:
        """Put it back, as old as it was."""
        if self._hidden is not None and self._hidden.exists():
            self._hidden.rename(self.folder / "in" / self._hidden.name)

    def write(self, number: int, noise: int = 0) -> None:
        """Write a frame and its further files; `noise` makes it another one."""
        more = self.folder / "more"
        self._write(self.path(number), number, noise)
        self._write(more / f"{number:04d}.exr", number, noise + 100)
        plane = np.random.default_rng(number + noise).random(
            (odd_shots.HEIGHT, odd_shots.WIDTH), np.float32
        )
        names = (f"V.Emission.{letter}" for letter in "RGB")
        write(more / f"b.{number:04d}.exr", dict.fromkeys(names, plane))

    def _write(self, path: Path, number: int, noise: int) -> None:
        seed = noise + (0 if self._one_seed else number)
        style = "flat" if self._style == "flat" else "cycles"
        moment = 0 if self._still else number
        frame = odd_shots.make_frame(moment, style, self._kind, seed)
        dice = Dice(f"{self._seed} {noise}")  # odd alike in all frames
        for odd in self._odd:
            odd(frame, dice)
        if self._style != "cached":
            odd_shots.write_frame(path, frame)
            return
        self._write_cached(path, moment, seed)
        for each in frame.after:
            each(path)

    def _write_cached(self, path: Path, moment: int, seed: int) -> None:
        """As `xrds render --sample-cache` does."""
        clean = odd_shots.make_frame(moment, "cycles", self._kind, seed).channels
        names = ("V.Noisy Image.RGB", "V.Denoising Albedo.RGB", "V.Normal.XYZ")
        light, albedo, normal = (
            np.dstack([clean[f"{name[:-3]}{letter}"] for letter in name[-3:]])
            for name in names
        )
        eye = odd_shots.make_camera(moment, self._kind)
        depth = clean["V.Depth.Z"]
        frame = Frame(
            number=moment,
            camera=eye,
            radiance=light,
            albedo=albedo,
            normal=normal,
            depth=depth,
            samples=4,
        )
        write_cached_frame(path, frame, Origin("key", "V", 2))


def _some(dice: Dice, of: Sequence[Any], counts: Sequence[int]) -> list[Any]:
    return dice.sample(list(of), dice.choice(counts))


def _touch(shot: _Shot, dice: Dice) -> None:
    when = dice.choice((0, 10**9, 2 * 10**9))
    os.utime(shot.path(dice.choice(shot.numbers)), (when, when))


def _replace(shot: _Shot, dice: Dice) -> None:
    number = dice.choice(shot.numbers)
    shot.write(number, dice.randrange(1000, 2000))
    if dice.random() < 0.5:
        os.utime(shot.path(number), (10**9, 10**9))


def _reattribute(shot: _Shot, dice: Dice) -> None:
    odd_headers.insert(
        shot.path(dice.choice(shot.numbers)), *odd_headers.chance_attribute(dice)
    )


def _remove(shot: _Shot, dice: Dice) -> None:
    if len(shot.numbers) > 1:
        shot.path(dice.choice(shot.numbers)).unlink()


def _damage(shot: _Shot, dice: Dice) -> None:
    """An input that is not whole."""
    path = shot.path(dice.choice(shot.numbers))
    data = path.read_bytes()
    path.write_bytes(data[: dice.randrange(max(len(data), 1))])


def _swap(shot: _Shot, dice: Dice) -> None:
    """Two inputs under each other's names."""
    one, two = (shot.path(dice.choice(shot.numbers)) for _ in range(2))
    first, second = one.read_bytes(), two.read_bytes()
    one.write_bytes(second)
    two.write_bytes(first)


def _late(shot: _Shot, _: Dice) -> None:
    shot.show()


def _further(shot: _Shot, dice: Dice) -> None:
    """A further frame, or one of the files that belong to a frame."""
    if dice.random() < 0.5:
        shot.write(max(shot.numbers) + 1)
        return
    path = dice.choice(sorted((shot.folder / "more").iterdir()))
    other = dice.choice(sorted((shot.folder / "more").iterdir()))
    path.write_bytes(other.read_bytes())


def _camera_file(shot: _Shot, dice: Dice) -> None:
    text = dice.choice(("", "{", '{"all": {"focal_length": 27}}', '{"1": {}}'))
    (shot.folder / "cameras.json").write_text(text)


def _output(shot: _Shot, dice: Dice) -> None:
    """An output that is cut off, gone, another frame's, or its input."""
    found = sorted((shot.folder / "out").glob("*.exr"))
    if not found:
        return
    path, other = dice.choice(found), dice.choice(found)
    data = path.read_bytes()
    how = dice.randrange(4)
    if how == 0:
        path.write_bytes(data[: dice.randrange(max(len(data), 1))])
    elif how == 1:
        path.unlink()
    elif how == 2:
        path.write_bytes(other.read_bytes())
    elif (source := shot.folder / "in" / path.name).is_file():
        path.write_bytes(source.read_bytes())


_CHANGES = (
    *(_touch, _replace, _reattribute, _remove, _damage, _swap, _late, _late),
    *(_further, _camera_file, _output, _output),
)
