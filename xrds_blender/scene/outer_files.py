"""The files that an open .blend file reads beside itself: textures, caches, libraries.

Blender's own list of them names the first file of a sequence alone, and no input of
geometry nodes. So every path that data-blocks hold is looked at.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

# Collections of `bpy.data` whose paths a render reads.
_KINDS = (
    "libraries images fonts volumes cache_files objects materials worlds lights "
    "textures particles node_groups"
)
_PATHS = {"FILE_PATH", "DIR_PATH"}
_SEQUENCES = {"SEQUENCE", "MOVIE"}  # sources of images
_IN_MEMORY = {"GENERATED", "VIEWER"}
_SETTINGS = ("modifiers", "particle_systems", "soft_body", "rigid_body")  # of objects
# Particles by the thousand, and the caches of a system, which lead to each other.
_SHIPPED = "datafiles/assets/"
_LEFT_OUT = {"particles", "child_particles", "seed", "vertex_groups"}


@dataclass(frozen=True)
class OuterFile:
    """What a data-block reads: its `kind` and `owner` in words, a `path`, its `files`.

    Those of a sequence, of tiles and of a folder are many; one that is not there is
    among them where the path names it.
    """

    kind: str
    owner: str
    path: Path
    files: tuple[Path, ...]

    @property
    def missing(self) -> Path | None:
        """The first file that is not there."""
        return next((file for file in self.files if not file.exists()), None)


def outer_files() -> list[OuterFile]:
    """All that the open file reads, by their paths; packed data lies in the file."""
    import bpy

    files = [
        file
        for kind in _KINDS.split()
        for item in getattr(bpy.data, kind)
        if not _is_inside(item)
        for file in _find_files_of(item)
    ]
    known = {file.path for file in files}
    files += [
        OuterFile("", "the file", path, _list_files(path))
        for path in map(Path, bpy.utils.blend_paths(absolute=True))
        if path not in known and path.exists()
    ]
    # Blender's own assets, of its version
    files = [file for file in files if _SHIPPED not in file.path.as_posix()]
    return sorted(files, key=lambda file: (str(file.path), file.owner))


def _is_inside(item: Any) -> bool:
    """Whether a data-block reads no file: it is packed, computed or built in."""
    import bpy

    if isinstance(item, bpy.types.Image):
        return bool(item.packed_files) or item.source in _IN_MEMORY
    if isinstance(item, bpy.types.NodeTree):  # the compositor's paths are outputs
        return item.bl_idname == "CompositorNodeTree"
    return bool(getattr(item, "packed_file", None))


def _find_files_of(item: Any) -> Iterator[OuterFile]:
    kind = item.bl_rna.name.lower()
    owner = f"{kind} {item.name!r}"
    for text in dict.fromkeys(_paths_in(item)):
        path = _resolve_path(item, text)
        if not text.startswith("<") and not _is_around(path):
            yield OuterFile(kind, owner, path, _list_files(path, item))


def _list_files(path: Path, item: Any = None) -> tuple[Path, ...]:
    if path.is_dir():
        return tuple(sorted(file for file in path.rglob("*") if file.is_file()))
    is_sequence = getattr(item, "is_sequence", False)
    is_sequence |= getattr(item, "source", "") in _SEQUENCES
    files = files_of(path, is_sequence)
    tiles = [str(tile.number) for tile in getattr(item, "tiles", ())]
    if "<UDIM>" in path.name:
        files += [path.with_name(path.name.replace("<UDIM>", tile)) for tile in tiles]
    return tuple(sorted({tile for tile in files if "<UDIM>" not in tile.name}) or files)


def _is_around(path: Path) -> bool:
    """Whether a folder holds the .blend file: also what is rendered may lie there."""
    import bpy

    return path.is_dir() and Path(bpy.data.filepath).is_relative_to(path)


def _paths_in(item: Any) -> Iterator[str]:
    """The paths that a data-block, its settings and its own nodes hold."""
    import bpy

    yield from _find_texts(item)
    if isinstance(item, bpy.types.Object):
        for name in _SETTINGS:
            value = getattr(item, name, None)
            values: Any = value if hasattr(value, "keys") else [value]
            for setting in values:
                yield from _find_paths_inside(setting, set())
    if isinstance(item, bpy.types.CacheFile):
        for layer in item.layers:
            yield from _find_texts(layer)
    tree = item if isinstance(item, bpy.types.NodeTree) else None
    tree = tree or getattr(item, "node_tree", None)
    for node in tree.nodes if tree else ():
        yield from _find_texts(node)
        for socket in node.inputs:
            yield from _find_texts(socket)


def _find_paths_inside(struct: Any, seen: set[tuple[type, int]]) -> Iterator[str]:
    """The same of a struct and of the structs inside."""
    import bpy

    if struct is None or isinstance(struct, bpy.types.ID):
        return
    place = type(struct), struct.as_pointer()
    if place in seen or _is_in_flux(struct):
        return
    seen.add(place)
    yield from _find_texts(struct)
    for member in struct.bl_rna.properties:
        if member.identifier in _LEFT_OUT:
            continue
        if member.type == "POINTER" and member.identifier != "rna_type":
            yield from _find_paths_inside(getattr(struct, member.identifier), seen)
        if member.type == "COLLECTION":
            for inner in getattr(struct, member.identifier):
                yield from _find_paths_inside(inner, seen)


def _is_in_flux(struct: Any) -> bool:
    """Whether a path is one to write to, such as that of a simulation not baked yet."""
    if getattr(struct, "type", "") == "OCEAN" and not struct.is_cached:
        return True
    is_output = type(struct).__name__ == "DynamicPaintSurface"
    return is_output or getattr(struct, "cache_type", "") == "REPLAY"


def _find_texts(struct: Any) -> Iterator[str]:
    """The paths among the values of a struct, not of those inside."""
    import bpy

    for member in struct.bl_rna.properties:
        if member.type == "STRING" and member.subtype in _PATHS:
            text = getattr(struct, member.identifier)
            # one that is not there was not baked
            is_folder = member.subtype == "DIR_PATH"
            if text and not (is_folder and not _resolve_path(struct, text).is_dir()):
                yield text
    if _is_disk_cache(struct):
        blend = Path(bpy.data.filepath)
        yield str(blend.with_name(f"blendcache_{blend.stem}"))
    try:
        values = [struct[name] for name in struct.keys()]  # noqa: SIM118  # no iterator
    except TypeError:  # this type of struct has no custom properties
        return
    texts = [value for value in values if isinstance(value, str)]
    # inputs of geometry nodes, say: a text is a path where there is such a file
    yield from (
        text
        for text in texts
        if {"/", "\\"} & {*text} and _resolve_path(struct, text).is_file()
    )


def _resolve_path(struct: Any, text: str) -> Path:
    import bpy

    library = getattr(struct.id_data, "library", None)
    return Path(bpy.path.abspath(text, library=library))


def _is_disk_cache(struct: Any) -> bool:
    return getattr(struct, "use_disk_cache", False) and struct.is_baked


def image_digest(image: Any) -> tuple[Any, ...]:
    """What identifies an image's pixels."""
    image = image.original or image
    if image.is_dirty or image.source == "VIEWER":
        return "painted", _hash_pixels(image)
    if image.packed_files:
        packed = [file.packed_file for file in image.packed_files]
        return "packed", *(
            _hash(packed_file.data) for packed_file in packed if packed_file
        )
    if image.source == "GENERATED":
        return ("generated",)  # its settings, hashed elsewhere, decide
    return file_digest(image.filepath, image.library, image.source == "SEQUENCE")


def file_digest(
    path: str, library: Any = None, is_sequence: bool = False
) -> tuple[Any, ...]:
    """Name, size and times of a file, or of all tiles and frames of one."""
    import bpy

    where = Path(bpy.path.abspath(path, library=library))
    return tuple(_stat(file) for file in files_of(where, is_sequence))


def files_of(where: Path, is_sequence: bool = False) -> list[Path]:
    """The file at a path, there or not, or all tiles and frames of one."""
    pattern = re.escape(where.name)
    for word in ("<UDIM>", "<UVTILE>"):
        pattern = pattern.replace(re.escape(word), ".*")
    if is_sequence:
        # The last number of the name, whatever its digits, counts the frames.
        pattern = re.sub(r"\d+(?=\D*$)", r"\\d+", pattern)
    if pattern == re.escape(where.name):
        return [where]
    try:
        files = [x for x in where.parent.iterdir() if re.fullmatch(pattern, x.name)]
    except OSError:
        return [where]
    return sorted(files) or [where]


_ENDS = 1 << 16  # bytes


def trace(file: Path) -> tuple[str, int, int, str]:
    """Name, size and time of a file on any machine, and what it begins and ends with.

    Copies keep times in whole seconds, on some disks.
    """
    try:
        with file.open("rb") as opened:
            about = os.fstat(opened.fileno())
            ends = opened.read(_ENDS)
            opened.seek(max(about.st_size - _ENDS, 0))
            ends += opened.read(_ENDS)
    except OSError:
        return file.name, -1, -1, ""
    return file.name, about.st_size, int(about.st_mtime), _hash(ends)


def _stat(file: Path) -> tuple[str, int, int, int]:
    """Beside the time of writing, which can be set, that of the last change."""
    try:
        status = file.stat()
    except (OSError, ValueError):
        return str(file), -1, -1, -1
    return str(file), status.st_size, status.st_mtime_ns, status.st_ctime_ns


def _hash_pixels(image: Any) -> str:
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    return _hash(pixels.data)


def _hash(data: Any) -> str:
    return hashlib.blake2b(data, digest_size=20).hexdigest()
