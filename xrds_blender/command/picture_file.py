"""Pictures to files: EXR as scene-linear radiance, PNG as Blender saves it."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from xrds_core import files
from xrds_core.accumulation.noise import luminance
from xrds_core.arrays import Array
from xrds_core.errors import PictureError, UsageError
from xrds_core.exr.openexr_io import FLOAT_ZIP, Encoding
from xrds_core.files import replacing
from xrds_core.frames import check_pattern, frame_path

SUFFIXES = (".exr", ".png")
SHOWN = {".png": "PNG", ".webp": "WEBP", ".jpg": "JPEG", ".jpeg": "JPEG"}
"""Blender's kinds of files that hold a picture as it is shown."""
_QUALITY = 95  # of those that lose some; of 100


def check_output(
    pattern: str, frames: Sequence[int], *, has_passes: bool = False
) -> None:
    """Refuse, before anything is rendered, an output that could not be written.

    The folder is made.

    Parameters
    ----------
    pattern : str
        Path of the pictures, with # for the digits of the frame number.
    frames : sequence of int
        Frame numbers.
    has_passes : bool
        Whether the files are to hold passes beside the picture.

    Raises
    ------
    UsageError
        For a suffix that is neither .exr nor .png, for one that holds no passes where
        there are some, for several frames of one name, and for other programs' frame
        numbers.
    PictureError
        If a file cannot be written.
    """
    path = Path(pattern)
    check_pattern(pattern)
    if has_passes and path.suffix.lower() != ".exr":
        raise UsageError(f"--passes needs an output that ends in .exr, not {pattern!r}")
    if path.suffix.lower() not in SUFFIXES:
        raise UsageError(f"output {pattern!r} must end in .exr or .png")
    if len(frames) > 1 and "#" not in path.name:
        raise UsageError(
            f"all {len(frames)} frames would be written to {pattern!r}; add #### for "
            f"the frame number, such as {path.stem}_####{path.suffix}"
        )
    for number in frames:
        files.check_place(frame_path(pattern, number))
    files.check_folder(path.parent)


def save(
    path: Path,
    radiance: Array,
    alpha: Array,
    scene: Any,
    encoding: Encoding = FLOAT_ZIP,
    metadata: Mapping[str, str] | None = None,
    parts: Mapping[str, Array] | None = None,
) -> None:
    """Write one frame, all at once or not at all.

    Parameters
    ----------
    path : Path
        Ends in .exr or .png.
    radiance : (H, W, 3) float32 array
        Scene-linear, premultiplied.
    alpha : (H, W) float32 array
        In [0, 1].
    scene : bpy.types.Scene
        Its view settings shape the PNG, and its output settings where they are for PNG;
        else with a transparent film both formats hold alpha.
    encoding : Encoding
        How numbers are stored in an .exr.
    metadata : mapping of str to str, optional
        Texts by name that the file is to hold.
    parts : mapping of str to (H, W, 3) float32 array, optional
        AOVs and light passes of an .exr, by name.

    Raises
    ------
    PictureError
        If it cannot be written.
    """
    if path.suffix.lower() == ".png":
        _write_png(path, radiance, alpha, scene, metadata or {})
        return
    from xrds_core import exr

    channels = {name: radiance[..., i] for i, name in enumerate("RGB")}
    if scene.render.film_transparent:
        channels["A"] = alpha
    for name, pixels in (parts or {}).items():
        channels |= {f"{name}.{x}": pixels[..., i] for i, x in enumerate("RGB")}
    exr.write_picture(path, channels, encoding, metadata)


def _write_png(
    path: Path, radiance: Array, alpha: Array, scene: Any, metadata: Mapping[str, str]
) -> None:
    with _as_shown(path, radiance, alpha, scene) as unfinished:
        if png_size(unfinished) != alpha.shape[::-1]:
            raise PictureError(f"cannot write {path}: is the disk full?")
        add(unfinished, metadata)


def save_as_shown(path: Path, pixels: Array, scene: Any) -> None:
    """Write a picture (H, W, 4) as Blender shows it, all at once or not at all.

    The path ends in one of SHOWN. Raises PictureError if it cannot be written.
    """
    with _as_shown(path, pixels[..., :3], pixels[..., 3], scene) as unfinished:
        if not unfinished.stat().st_size:
            raise PictureError(f"cannot write {path}: is the disk full?")


@contextmanager
def _as_shown(path: Path, radiance: Array, alpha: Array, scene: Any) -> Iterator[Path]:
    """Yield a file that takes the place of `path` at the end."""
    if not path.parent.is_dir():  # Blender would make it anew, wherever that is by now
        raise PictureError(f"cannot write {path}: its folder no longer exists")
    try:
        with replacing(path) as unfinished:
            _save(unfinished, SHOWN[path.suffix.lower()], radiance, alpha, scene)
            yield unfinished
    except OSError as error:
        raise PictureError(f"cannot write {path}: {error.strerror}") from error


def _save(path: Path, kind: str, radiance: Array, alpha: Array, scene: Any) -> None:
    """Let Blender apply the scene's view transform and write a file of a kind."""
    import bpy

    height, width = alpha.shape
    if _colours(scene) == "BW":  # as Blender's renders: grey before the view transform
        radiance = np.repeat(luminance(radiance)[..., None], 3, axis=2)
    image = bpy.data.images.new("xrds", width, height, alpha=True, float_buffer=True)
    try:
        image.alpha_mode = "PREMUL"
        rows = np.dstack((radiance, alpha))[::-1]  # Blender's first row is the lowest
        image.pixels.foreach_set(np.ascontiguousarray(rows, np.float32).ravel())
        with _settings_for(kind, scene):
            image.save_render(str(path.resolve()), scene=scene)
    except RuntimeError as error:
        reason = " ".join(str(error).removeprefix("Error:").split())
        raise PictureError(f"Blender cannot save the picture: {reason}") from error
    finally:
        bpy.data.images.remove(image)


def _colours(scene: Any) -> str:
    settings = scene.render.image_settings
    if settings.file_format == "PNG" or settings.color_mode == "BW":
        return str(settings.color_mode)
    return "RGBA" if scene.render.film_transparent else "RGB"


@contextmanager
def _settings_for(kind: str, scene: Any) -> Iterator[None]:
    """Ask Blender for a kind of file: of the file's colours and bits if it is for PNG.

    Else with alpha where the film is transparent.
    """
    settings = scene.render.image_settings
    colours = _colours(scene)
    wanted = {
        "media_type": "IMAGE",  # from Blender 5.0 on, and to be set before the format
        "file_format": kind,
        "color_mode": "RGB" if kind == "JPEG" and colours == "RGBA" else colours,
        "quality": _QUALITY,
    }
    wanted = {name: value for name, value in wanted.items() if hasattr(settings, name)}
    # the format decides which depths there are
    old = {name: getattr(settings, name) for name in (*wanted, "color_depth")}
    try:
        for name, value in wanted.items():
            setattr(settings, name, value)
        yield
    finally:
        for name, value in old.items():
            setattr(settings, name, value)


_SIGNATURE, _HEADER = 8, 25  # bytes: of the file, and of its first chunk, IHDR
_LONGEST = 79  # letters of a name


def add(path: Path, texts: Mapping[str, str]) -> None:
    """Put texts by name into a PNG that is whole; longer names are cut."""
    data = path.read_bytes()
    at = _SIGNATURE + _HEADER
    chunks = b"".join(_chunk(name[:_LONGEST], text) for name, text in texts.items())
    path.write_bytes(data[:at] + chunks + data[at:])


def _chunk(name: str, text: str) -> bytes:
    keyword = name.encode("latin-1", "replace")
    try:
        content = b"tEXt" + keyword + b"\0" + text.encode("latin-1")
    except UnicodeEncodeError:  # no compression, no language, no translated name
        content = b"iTXt" + keyword + b"\0\0\0\0\0" + text.encode()
    length = struct.pack(">I", len(content) - 4)
    return length + content + struct.pack(">I", zlib.crc32(content))


_BEGINNING = b"\x89PNG\r\n\x1a\n"


def is_whole(path: Path, size: tuple[int, int]) -> bool:
    """Whether `path`, .exr or .png, holds a whole picture of `size` (width, height)."""
    size_of = png_size if path.suffix.lower() == ".png" else _exr_size
    try:
        return size_of(path) == size
    except (OSError, PictureError):
        return False


def png_size(path: Path) -> tuple[int, int] | None:
    """Width and height of a PNG; None where any of its checksums is not right."""
    data = path.read_bytes()
    at, size = len(_BEGINNING), None
    if not data.startswith(_BEGINNING):
        return None
    while at + 12 <= len(data):  # length, kind, content, checksum
        length, kind = struct.unpack_from(">I4s", data, at)
        content, after = at + 8, at + 8 + length
        checksum = zlib.crc32(data[at + 4 : after])
        if data[after : after + 4] != checksum.to_bytes(4, "big"):
            return None
        if kind == b"IHDR":
            size = struct.unpack_from(">II", data, content)
        if kind == b"IEND":
            return size
        at = after + 4
    return None


def _exr_size(path: Path) -> tuple[int, int]:
    from xrds_core import exr

    height, width = exr.read_beauty(path).radiance.shape[:2]
    return width, height
