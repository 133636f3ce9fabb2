"""Small shots for `fuzz`, made odd by chance: files, cameras and options."""

from __future__ import annotations

import json
import os
import random
import struct
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from xrds_core import exr
from xrds_core.accumulation.camera import Camera, Sphere
from xrds_core.shot_files import cameras

from .odd_headers import chance_attribute, insert

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

WIDTH, HEIGHT = 24, 18
_CAMERAS = ("perspective", "perspective", "orthographic", "panorama")
_NUMBERS = (0, 1, -1, 2, 16, 33, 0.0, 1.0, -0.5, 1.5, 1e-30, 1e30, 3e38, 2**31 - 1)
_ODD = (float("nan"), float("inf"), -float("inf"))
_TEXTS = ("", "0", "1", "4", "-1", "1.5", "nan", "²", "９", "0 0 0 0", "-3 3 1 1", "\n")
_TEXTS = (*_TEXTS, "-3 3 -1.5 1.5", "9" * 400, "9" * 5000, "a b c d", "\x1b[2J", "é")
_ATTRIBUTES = (
    *("worldToCamera", "worldToNDC", "xrds/project", "xrds/sphere", "xrds/samples"),
    *("xrds/key", "xrds/radius", "xrds/still", "cameraLabel", "Camera", "owner"),
    *("cycles.ViewLayer.samples", "pixelAspectRatio", "screenWindowWidth"),
)
_POISON = (*_ODD, 3e38, -3e38, 1e20, -1.0, 0.0, 1e-40, 65505.0, 1e10)
_NAMES = ("R", "G", "A", "Z", "Combined.R", "V.Noisy Image.A", "V.Position.X", "x")
_NAMES = (*_NAMES, "Depth.Z", "motion.R", "V.XRDS Noise.X", "other.albedo.R", "N.X")


@dataclass
class Case:
    """One shot and how it is denoised; `least` outputs are due at status 0."""

    folder: Path
    output: Path
    words: list[str]
    least: int = 0

    def picture(self, path: Path) -> list[str]:
        """The channels of an output that must be finite."""

        names = exr.File(path).names.names
        kinds = ["", "Combined.", "V.Combined."]
        if "--beauty=albedo" in self.words:  # then these are other passes, kept as is
            kinds = ["albedo."]
        there = [[f"{kind}{x}" for x in "RGB"] for kind in kinds]
        return next((x for x in there if all(name in names for name in x)), [])


@dataclass
class FrameFile:
    """A frame before it is written."""

    header: dict[str, Any]
    channels: dict[str, Any]
    number: int
    after: list[Callable[[Path], None]] = field(default_factory=list)


def make_case(folder: Path, seed: int, number: int) -> Case:
    """Write the shot of one case into a folder; the same for the same numbers."""
    dice = random.Random(f"{seed} {number}")
    (folder / "in").mkdir()
    (folder / "out").mkdir()
    style, kind = dice.choice(("flat", "cycles")), dice.choice(_CAMERAS)
    frames = [make_frame(i, style, kind) for i in (1, 2, 3)]
    if dice.random() < 0.85:
        for _ in range(dice.choice((1, 1, 2, 4))):
            odd = dice.choice(_FILES)
            which = frames if dice.random() < 0.4 else [dice.choice(frames)]
            for frame in which:
                odd(frame, dice)
    for frame in frames:
        write_frame(folder / "in" / f"{frame.number:04d}.exr", frame)
    words = ["denoise", "in/####.exr", "-o", "out/####.exr", "--denoise", "fast"]
    case = Case(folder, folder / "out", words)
    words += _camera(folder, dice) if dice.random() < 0.35 else []
    if dice.random() < 0.5:
        for _ in range(dice.choice((1, 1, 2, 3))):
            words += dice.choice(_OPTIONS)(dice)
    elif not any(frame.after for frame in frames):
        case.least = 3
    return case


# --- frames ---------------------------------------------------------------------------


def make_camera(number: int, kind: str) -> Camera:
    """One that moves to the right."""
    world = np.eye(4)
    world[0, 3] = 0.1 * number
    project = np.diag([1.5, 1.5 * WIDTH / HEIGHT, -1.0, 0.0])
    project[2, 3], project[3, 2] = -0.2, -1.0
    if kind == "orthographic":
        project = np.diag([0.2, 0.2 * WIDTH / HEIGHT, -0.01, 1.0])
    sphere = Sphere() if kind == "panorama" else None
    return Camera(np.linalg.inv(world), project, (WIDTH, HEIGHT), sphere=sphere)


def make_frame(
    number: int, style: str, kind: str, seed: int | None = None
) -> FrameFile:
    """A wall before a moving camera, as a renderer writes it."""
    camera = make_camera(number, kind)
    chance = np.random.default_rng(number if seed is None else seed)
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(np.float32)
    albedo = 0.5 + 0.4 * np.sin((x + 0.3 * number) / 3) * np.cos(y / 4)
    light = albedo * chance.exponential(1.0, albedo.shape)
    ones = np.ones((HEIGHT, WIDTH))
    prefix = {"flat": "", "cycles": "V.Noisy Image."}[style]
    guides = {"flat": ("albedo.", "N."), "cycles": ("V.Denoising Albedo.", "V.Normal.")}
    channels = {
        f"{prefix}{c}": light * s for c, s in zip("RGB", (1, 0.8, 0.6), strict=True)
    }
    channels |= {f"{guides[style][0]}{c}": albedo for c in "RGB"}
    channels |= {f"{guides[style][1]}{c}": ones * (c == "Z") for c in "XYZ"}
    channels["V.Depth.Z" if style == "cycles" else "Z"] = 5 * ones
    header: dict[str, Any] = {**cameras.to_header(camera), "xrds/samples": 4}
    planes = {k: v.astype(np.float32) for k, v in channels.items()}
    return FrameFile(header, planes, number)


def write_frame(path: Path, frame: FrameFile) -> None:
    """Write a frame, and do to its file what else was chosen."""
    import OpenEXR

    header = {"type": OpenEXR.scanlineimage, **frame.header}
    for name, value in header.items():
        if isinstance(value, list) and not isinstance(value[0], str):
            header[name] = np.asarray(value, np.float32)
    parts, views = header.pop("parts", 1), header.pop("views", ())
    try:
        if views:
            OpenEXR.File(
                [
                    OpenEXR.Part({**header, "view": x}, dict(frame.channels), x)
                    for x in views
                ]
            ).write(str(path))
        elif parts == 1:
            OpenEXR.File(header, dict(frame.channels)).write(str(path))
        else:
            names = list(frame.channels)
            OpenEXR.File(
                [
                    OpenEXR.Part(
                        dict(header),
                        {x: frame.channels[x] for x in names[i::parts]},
                        f"p{i}",
                    )
                    for i in range(parts)
                ]
            ).write(str(path))
    except Exception:  # what the library does not even write is an empty file
        path.write_bytes(b"")
    for each in frame.after:
        each(path)


def _value(dice: random.Random) -> Any:
    kind = dice.randrange(5)
    if kind == 0:
        return dice.choice(_NUMBERS)
    if kind == 1:
        return dice.choice(_TEXTS)
    if kind == 2:
        return dice.choice(_ODD)
    matrix = np.eye(4)
    for _ in range(dice.randrange(1, 9)):
        place = dice.randrange(4), dice.randrange(4)
        matrix[place] = dice.choice((0.0, 1.0, -1.0, 0.5, 1e-20, 1e20, 3e38, *_ODD))
    return matrix.tolist() if kind == 3 else matrix[:3, :3].tolist()


def _attribute(frame: FrameFile, dice: random.Random) -> None:
    frame.header[dice.choice(_ATTRIBUTES)] = _value(dice)


def _bent(frame: FrameFile, dice: random.Random) -> None:
    """One number of a camera's matrix."""
    name = dice.choice(("worldToCamera", "worldToNDC", "xrds/project"))
    try:
        matrix = np.array(frame.header.get(name, np.eye(4).tolist()), np.float64)
    except (TypeError, ValueError):  # something else stands there by now
        return
    if matrix.shape == (4, 4):
        place = dice.randrange(4), dice.randrange(4)
        matrix[place] = dice.choice((*_NUMBERS[:12], *_ODD, -matrix[place]))
        frame.header[name] = matrix.tolist()


def _without(frame: FrameFile, dice: random.Random) -> None:
    name = dice.choice([*frame.header, *frame.channels])
    frame.header.pop(name, None)
    if len(frame.channels) > 1:
        frame.channels.pop(name, None)


def _windows(frame: FrameFile, dice: random.Random) -> None:
    corner = [dice.choice((0, 0, 1, -5, 300, -300, 30000, -(2**30))) for _ in "xy"]
    name = dice.choice(("dataWindow", "displayWindow"))
    size = (WIDTH, HEIGHT)
    if name == "displayWindow":
        size = tuple(dice.choice((1, 7, WIDTH, 500, 3000, 70000)) for _ in "xy")
    last = [a + b - 1 for a, b in zip(corner, size, strict=True)]
    frame.header[name] = (np.array(corner, np.int32), np.array(last, np.int32))


def _channel(frame: FrameFile, dice: random.Random) -> None:
    """A channel more, or one called otherwise."""
    name = dice.choice(list(frame.channels))
    plane = frame.channels[name]
    if dice.random() < 0.5 and len(frame.channels) > 1:
        del frame.channels[name]
    frame.channels[dice.choice(_NAMES)] = plane


def _kind(frame: FrameFile, dice: random.Random) -> None:
    kind = dice.choice((np.float16, np.uint32))
    some = dice.choice((list(frame.channels), [dice.choice(list(frame.channels))]))
    for name in some:
        frame.channels[name] = np.nan_to_num(
            np.clip(frame.channels[name], 0, 60000)
        ).astype(kind)


def _poison(frame: FrameFile, dice: random.Random) -> None:
    names = dice.sample(list(frame.channels), dice.randint(1, len(frame.channels)))
    place: Any = dice.choice(((slice(None),), (slice(5, 9), slice(3, 20)), (0, 0)))
    value = dice.choice(_POISON)
    for name in names:
        if frame.channels[name].dtype != np.uint32:
            plane = frame.channels[name].copy()
            with np.errstate(over="ignore"):
                plane[place] = value
            frame.channels[name] = plane


def _passes(frame: FrameFile, dice: random.Random) -> None:
    """Passes that renderers may add."""
    chance = np.random.default_rng(dice.randrange(99))
    name, letters = dice.choice(
        (
            ("V.Vector", "XYZW"),
            ("motion", "RG"),
            ("V.Position", "XYZ"),
            ("V.XRDS Noise", "XYZ"),
            ("V.Combined", "RGBA"),
            ("V.Noisy Image", "A"),
        )
    )
    scale = dice.choice((0.0, 1.0, 100.0, 1e6, 1e30))
    for letter in letters:
        plane = scale * chance.standard_normal((HEIGHT, WIDTH))
        frame.channels[f"{name}.{letter}"] = plane.astype(np.float32)


def _form(frame: FrameFile, dice: random.Random) -> None:
    import OpenEXR

    if dice.random() < 0.5:
        frame.header["parts"] = dice.choice((2, 3))
        return
    frame.header["type"] = OpenEXR.tiledimage
    frame.header["tiles"] = OpenEXR.TileDescription()


def _views(frame: FrameFile, dice: random.Random) -> None:
    """A second eye: in parts of its own, or in channels with or without a list."""
    how = dice.randrange(3)
    if how == 0:
        frame.header["views"] = ("left", "right")
        return
    if how == 1:
        frame.header["multiView"] = ["left", "right"]
    for name, plane in list(frame.channels.items()):
        layers, dot, letter = name.rpartition(".")
        for view in ("left", "right")[how == 1 :]:
            frame.channels[f"{layers}{dot}{view}.{letter}"] = plane
        if how == 2:
            del frame.channels[name]


def _raw_attributes(frame: FrameFile, dice: random.Random) -> None:
    """Of any kind, name and bytes."""
    chosen = [chance_attribute(dice) for _ in range(dice.choice((1, 1, 3)))]

    def insert_all(path: Path) -> None:
        for each in chosen:
            if path.is_file():
                insert(path, *each)

    frame.after.append(insert_all)


def _small(frame: FrameFile, dice: random.Random) -> None:
    """Another size."""
    rows, columns = dice.choice(((1, 1), (1, WIDTH), (HEIGHT, 1), (13, 17)))
    for name, plane in frame.channels.items():
        frame.channels[name] = np.ascontiguousarray(plane[:rows, :columns])


def _bytes(frame: FrameFile, dice: random.Random) -> None:
    how, spot, bits = dice.randrange(5), dice.random(), dice.randrange(256)
    word = dice.choice((0, 1, 2**31 - 1, 2**32 - 1, 65536, 2**30))

    def damage(path: Path) -> None:
        data = bytearray(path.read_bytes() if path.is_file() else b"")
        if len(data) < 100:
            return
        place = int(spot * (min(len(data), 1500) if how < 3 else len(data)))
        if how in (0, 3):
            data[place] ^= 1 << bits % 8
        elif how in (1, 4):
            data[place : place + 4] = struct.pack("<I", word)
        else:
            del data[place:]
        path.write_bytes(bytes(data))

    frame.after.append(damage)


def _no_file(frame: FrameFile, dice: random.Random) -> None:
    what = dice.randrange(4)

    def replace(path: Path) -> None:
        if not path.is_file():
            return
        path.unlink()
        if what == 0:
            path.mkdir()
        elif what == 1:
            os.mkfifo(path)
        elif what == 2:
            path.symlink_to("nowhere")

    frame.after.append(replace)


HARMLESS = (
    *(_attribute, _bent, _kind, _poison, _passes, _form, _views),
    *(_raw_attributes, _raw_attributes),
)
"""What files may hold and still be finished."""
_FILES = (
    *(*HARMLESS, _attribute, _without, _windows, _channel),
    *(_poison, _small, _bytes, _bytes, _no_file),
)

# --- cameras and options --------------------------------------------------------------


def _camera(folder: Path, dice: random.Random) -> list[str]:
    if dice.random() < 0.05:
        return ["--camera", dice.choice(("/dev/zero", "in", "nothing.json"))]
    path = folder / "cameras.json"
    if dice.random() < 0.02:
        os.mkfifo(path)
        return ["--camera", "cameras.json"]
    told: dict[str, Any] = {"to_world": np.eye(4).tolist(), "focal_length": 27}
    for _ in range(dice.randrange(4)):
        _odd_camera(told, dice)
    keys = dice.choice((["all"], ["1", "2", "3"], ["1"], ["²"], ["9" * 30], []))
    text = json.dumps(dict.fromkeys(keys, told))
    if dice.random() < 0.2:
        place = dice.randrange(max(len(text), 1))
        extra = dice.choice(
            ("", "[" * 3000, "1e999", "\x00", "9" * 5000, "NaN", "null")
        )
        text = text[:place] + extra + text[place + dice.randrange(9) :]
    path.write_text(text)
    return ["--camera", "cameras.json"]


def _odd_camera(told: dict[str, Any], dice: random.Random) -> None:
    values = (
        *_NUMBERS,
        *_ODD,
        *_TEXTS[:8],
        None,
        [],
        {},
        True,
        10**400,
        [1, 2],
        [0, 0],
    )
    name = dice.choice(
        ("to_world", "project", "focal_length", "sensor_width", "ortho_width", "shift")
    )
    rows = told.get("to_world")
    whole = isinstance(rows, list) and len(rows) == 4
    if name == "to_world" and whole and dice.random() < 0.7:
        changed = [list(row) for row in rows]
        changed[dice.randrange(4)][dice.randrange(4)] = dice.choice(values)
        told[name] = changed
    elif dice.random() < 0.1:
        told.pop(name, None)
    else:
        told[name] = dice.choice(values)


def _pick(name: str, *values: str) -> Callable[[random.Random], list[str]]:
    """One of some values of an option; without values its name alone."""
    return lambda dice: [f"{name}={dice.choice(values)}" if values else name]


_OPTIONS = (
    _pick("--temporal-radius", "0", "1", "2", "40", "2147483647", "²"),
    _pick("--frames", "1", "2-3", "1-3x2", "3,1", "0-5", "1-100000", "-5-5", "1-"),
    _pick("--samples", "1", "4096", "2147483647", "9" * 400),
    _pick("--normal-space", "camera", "world", "x"),
    _pick("--position-space", "camera", "world"),
    _pick("--motion-scale", "1,-1", "1e300,1", "0,0", "nan,1", "1"),
    _pick("--picture-only"),
    _pick("--resume"),
    _pick("--json"),
    _pick("--read-limit", "1", "10K", "20G", "x"),
    _pick("--memory-limit", "1", "1M", "4G"),
    _pick("--beauty", "V.Noisy Image", "albedo", "nothing", ""),
    _pick("--depth", "Z", "V.Depth", "R", ""),
    _pick("--vector", "motion", "V.Vector", "albedo"),
    _pick("--out", "in/####.exr", "in/1#.exr", "out/a.exr", "out/#.png", "no/o/#.exr"),
)
