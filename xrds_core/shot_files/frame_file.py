"""Reads one frame from an OpenEXR file, with all that reprojection needs."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..accumulation.camera import SKY_DEPTH, Camera
from ..accumulation.frame import Frame, Halves, Stored, store
from ..accumulation.noise import Noise
from ..accumulation.passes import LAYOUT, Passes
from ..accumulation.reprojection import centres, pixels_of
from ..denoising.light_passes import Wanted, find_parts, light_of
from ..errors import NotReusable, PictureError, Unfit
from ..exr import File
from ..exr.raw_header import is_mostly_empty
from ..frames import MOST_RADIUS, frame_path
from . import cameras
from .cameras import camera_of_frame, from_header, has_camera
from .pass_names import PassChannels, PassNames, find_passes

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from ..arrays import Array
    from ..denoising.light_passes import LightPart
    from ..exr.openexr_io import Attributes, Part, Window


SAMPLES, KEY, RADIUS, STILL = "xrds/samples", "xrds/key", "xrds/radius", "xrds/still"
SUBSET = "xrds/subset"
NAME = "cameraLabel"
"""Attributes: samples per pixel; a key of what the frame was rendered from; the
temporal radius that its sample subsets are for; 1 where nothing at all moves in the
shot; `Frame.subset`, none of a sequence of its own; the camera's name."""
_DEFAULT_SAMPLES = 16
_FITS = 2.0  # pixels by which a reprojected Position pass may be off
_NEAREST = 1e-30  # depth of a hit, in any unit: dividing by it stays within float32
_SPOTS = 4096  # pixels for which this is checked
_CENTRE = Camera(np.eye(4), np.eye(4), (1, 1))  # placeholder where none is needed


@dataclass(frozen=True)
class Reading:
    """Options for reading files, for what they do not say themselves.

    Attributes
    ----------
    names : PassNames
        What passes are called.
    cameras : mapping or None
        What `cameras.read_cameras` returns; None for the cameras of the headers.
    samples : int or None
        Samples per pixel.
    normal_space, position_space : {'world', 'camera'} or None
        None for what the passes' names say.
    motion_scale : tuple of float
        Factors that convert a motion pass of two channels to pixels to the next frame,
        x to the right and y upwards.
    halves : str or None
        Pattern of files with the second half buffers: as many other samples of each
        frame.
    light : Wanted
        AOVs and light passes to read as well.
    also : tuple of str
        Patterns of files with further passes. The picture of one without passes is
        called by the file's name without the number.
    """

    names: PassNames = field(default_factory=PassNames)
    cameras: Mapping[int | None, dict[str, Any]] | None = None
    samples: int | None = None
    normal_space: str | None = None
    position_space: str | None = None
    motion_scale: tuple[float, float] = (1.0, 1.0)
    halves: str | None = None
    light: Wanted = field(default_factory=Wanted)
    also: tuple[str, ...] = ()


@dataclass(frozen=True)
class FrameFile:
    """A frame read from a file.

    Attributes
    ----------
    stored : Stored
        Covers the display window and all that the picture's data window has beyond it;
        for a frame that is not to be reused, the data window alone.
    inner : tuple of slice
        Crops the arrays of `stored` to `data_window`.
    data_window : Window
        Data window of the picture.
    part : int
        The file's part with the picture.
    channels : list of str
        Channels of the picture: R, G, B and, where the file has alpha, A.
    key : str
        Frames with the same key have the same render settings; "" if unknown.
    radius : int or None
        The temporal radius that the file recommends.
    reusable : bool
        False where the frame cannot be reprojected.
    subset : int or None
        `Frame.subset`.
    light : tuple of LightPart
        AOVs and light passes that were read.
    places : mapping of str to (int, str)
        The part of the file that a channel of `light` lies in, and what it is called
        there.
    others : mapping of str to FrameFile
        The other views of a stereo file.
    unread : mapping of str to str
        Why some views are not read.
    """

    stored: Stored
    inner: tuple[slice, slice]
    data_window: Window
    part: int
    channels: list[str]
    key: str
    radius: int | None
    reusable: bool
    subset: int | None = None
    light: tuple[LightPart, ...] = ()
    places: Mapping[str, tuple[int, str]] = field(default_factory=dict)
    others: Mapping[str, FrameFile] = field(default_factory=dict)
    unread: Mapping[str, str] = field(default_factory=dict)


def read_frame(
    path: Path, number: int, reading: Reading, *, reusable: bool = True
) -> FrameFile:
    """Read a frame; of a stereo file the first view, with the others in `others`.

    Parameters
    ----------
    path : Path
        The file.
    number : int
        Frame number.
    reading : Reading
        Options.
    reusable : bool
        False for a frame that needs no camera and no depth.

    Returns
    -------
    frame : FrameFile

    Raises
    ------
    NotReusable
        If the frame can be denoised by itself, but not be reprojected.
    Unfit
        If the file lacks a pass, with the path and the remedy.
    PictureError
        If the file is incomplete.
    """
    first, *rest = File(path, _find_further_files(path, number, reading)).views()
    frame = _read_view(first, number, reading, reusable)
    others, unread = {}, {}
    for file in rest:
        try:
            others[file.view] = _read_view(file, number, reading, frame.reusable)
        except Unfit as error:
            unread[file.view] = str(error)
    return replace(frame, others=others, unread=unread)


def _read_view(file: File, number: int, reading: Reading, reusable: bool) -> FrameFile:
    passes = find_passes(file.names, reading.names)
    number_of_part, channels = _find_target(file, passes)
    part = file.parts[number_of_part]
    file.window = _choose_window(file.path, part) if reusable else part.data_window
    camera, depth = _read_geometry(file, part, passes, number, reading, reusable)
    beauty = _read_stack(file, passes.beauty)
    light = find_parts(file.names, _layer_of(passes), reading.light)
    frame = Frame(
        number=number,
        camera=camera or _CENTRE,
        radiance=beauty,
        albedo=_clean_guide(_read_stack(file, passes.albedo)),
        normal=_clean_guide(_read_normal(file, passes, camera, reading)),
        depth=np.full(beauty.shape[:2], np.inf, np.float32) if depth is None else depth,
        samples=_read_samples(file, part, reading),
        alpha=file.plane(passes.alpha) if passes.alpha else None,
        vector=_read_vector(file, passes, reading) if reusable else None,
        still=cameras.whole_or_none(part.attributes.get(STILL)) == 1,
        parts=_read_light(file, light),
        **_read_others(file, passes),
    )
    if reading.halves is not None:
        frame = _add_other_half(frame, file, camera, reading)
    stored = store(frame)
    if reading.halves is None and passes.noise:
        stored = replace(stored, noise=_read_noise(file, passes))
    return FrameFile(
        stored=stored,
        inner=_crop_to(file.window, part.data_window),
        data_window=part.data_window,
        part=number_of_part,
        channels=channels,
        key=str(part.attributes.get(KEY, "")),
        radius=cameras.whole_or_none(part.attributes.get(RADIUS), 0, MOST_RADIUS),
        reusable=camera is not None and depth is not None,
        subset=cameras.whole_or_none(part.attributes.get(SUBSET)),
        light=light,
        places={
            name: _choose_place(file, number_of_part, name)
            for light_part in light
            for name in (*light_part.channels, *light_part.colour)
        },
    )


def _find_further_files(path: Path, number: int, reading: Reading) -> dict[str, Path]:
    """Return the further files of a frame, by their names without its number."""
    files = {}
    for pattern in reading.also:
        other = frame_path(pattern, number)
        if not other.is_file():
            raise PictureError(f"there is no file {other}, which belongs to {path}")
        files[Path(pattern).stem.partition("#")[0].rstrip("._-")] = other
    return files


def _choose_place(file: File, part: int, name: str) -> tuple[int, str]:
    """Return where a channel is written: one of another file is added to `part`."""
    source_part, own_name = file.place(name)
    return (source_part, own_name) if source_part < file.own_parts else (part, name)


def _layer_of(passes: PassChannels) -> str:
    """Return the layer that the noisy radiance lies in; "" where it lies in none."""
    return passes.beauty[0].rpartition(".")[0].rpartition(".")[0]


def _read_light(file: File, parts: Sequence[LightPart]) -> dict[str, Array]:
    return light_of(parts, lambda names: _read_stack(file, list(names)))


def _add_other_half(
    frame: Frame, file: File, camera: Camera | None, reading: Reading
) -> Frame:
    """Return the mean of a frame and of its second half buffer."""
    assert reading.halves is not None
    path = frame_path(reading.halves, frame.number)
    if not path.is_file():
        raise PictureError(f"there is no file {path}, the frame's other half")
    views = {half.view: half for half in File(path).views()}
    other = views.get(file.view)
    if other is None:
        raise Unfit(f"{path} is no half of {file.path}: it lacks the view {file.view}")
    passes = find_passes(other.names, reading.names)
    part = other.parts[_find_target(other, passes)[0]]
    same_size = part.display_window == file.parts[0].display_window
    if not same_size or (passes.alpha is None) != (frame.alpha is None):
        raise Unfit(f"{path} is no half of {file.path}: its size or alpha differs")
    other.window = file.window
    light = find_parts(other.names, _layer_of(passes), reading.light)
    second = Passes(
        radiance=_read_stack(other, passes.beauty),
        albedo=_clean_guide(_read_stack(other, passes.albedo)),
        normal=_clean_guide(_read_normal(other, passes, camera, reading)),
        alpha=other.plane(passes.alpha) if passes.alpha else None,
        parts=_read_light(other, light),
    )
    if second.parts.keys() != frame.parts.keys():
        raise Unfit(f"{path} is no half of {file.path}: its parts of the light differ")
    halves = Halves.of(frame, second, (0.5, 0.5))
    return replace(
        frame.joined(second, halves.share()),
        samples=2 * frame.samples,
        halves=halves,
    )


_REMEDY = {
    "camera": "give --camera cameras.json (of a .blend file: xrds cameras "
    "shot.blend -o cameras.json), or --temporal-radius 0 to denoise each frame by "
    "itself",
    "depth": "render Position or Depth too, name it with --position or --depth, or "
    "give --temporal-radius 0",
}


def _read_geometry(
    file: File,
    part: Part,
    passes: PassChannels,
    number: int,
    reading: Reading,
    reusable: bool,
) -> tuple[Camera | None, Array | None]:
    """Camera and depth; if not `reusable`, a camera if there is one, and no depth.

    Raises NotReusable, if `reusable`, for what is missing or unusable.
    """
    try:
        camera = _read_camera(file, part, number, reading)
    except NotReusable:
        if reusable:
            raise
        camera = None
    if not reusable:
        return camera, None
    depth = None if camera is None else _read_depth(file, passes, camera, reading)
    if camera is None or depth is None:
        lacking = "camera" if camera is None else "depth"
        raise NotReusable(f"{file.path} has no {lacking}", _REMEDY[lacking])
    return camera, depth


def _read_camera(
    file: File, part: Part, number: int, reading: Reading
) -> Camera | None:
    """The camera from the options, or else from the header."""
    (left, top), (right, bottom) = part.display_window
    size = (right - left + 1, bottom - top + 1)
    header = _find_camera_header(file, part)
    try:
        if reading.cameras is not None:
            aspect = cameras.number(header.get("pixelAspectRatio", 1.0), 1e-3, 1e3)
            camera = camera_of_frame(reading.cameras, number, size, aspect)
        else:
            camera = from_header(header, size)
    except ValueError as error:
        raise NotReusable(
            f"{file.path}: its camera cannot be used ({error})", _REMEDY["camera"]
        ) from error
    if camera is None or file.window is None:
        return None
    (x, y), _ = file.window
    # Blender writes `Camera`
    name = camera.name or str(header.get(NAME) or header.get("Camera", ""))
    return replace(camera, window=(x - left, y - top), name=name)


def _find_camera_header(file: File, part: Part) -> Attributes:
    """The part's header, or else that of the first part that holds a camera."""
    headers = [part.attributes, *(other.attributes for other in file.parts)]
    return next((header for header in headers if has_camera(header)), part.attributes)


def _read_depth(
    file: File, passes: PassChannels, camera: Camera, reading: Reading
) -> Array | None:
    """Depth (H, W) along the camera's axis, infinite without a hit."""
    position, depth = passes.position, passes.depth
    if depth and position and _is_half(file, position):
        position = []  # half floats give positions only to centimetres
    if not position:
        if not depth:
            return None
        plane = file.plane(depth[0])
        if passes.has_length:
            height, width = plane.shape
            plane = plane * camera.depth_per_length((height, width))
        return _clean_depth(plane)
    points = _read_stack(file, position)
    points[~np.isfinite(points).all(axis=-1)] = 0.0
    if reading.position_space == "camera":
        return _clean_depth(points[..., 2])
    with np.errstate(over="ignore", invalid="ignore"):  # huge positions
        result = camera.depth(points)
    result[np.abs(result) < _NEAREST] = 0.0
    if camera.sphere is None and file.is_first:  # the header has one view's camera
        _check_fit(file, camera, points, result)
    return result


def _clean_depth(depth: Array) -> Array:
    """Depth; renderers write 0, infinity or a huge number where there is no hit."""
    depth = np.abs(depth)
    with np.errstate(invalid="ignore"):
        hit = (depth > _NEAREST) & (depth < SKY_DEPTH)
    return np.where(hit, depth, np.where(np.isnan(depth), depth, np.float32(np.inf)))


def _read_others(file: File, passes: PassChannels) -> dict[str, Any]:
    """The passes that have one name alone."""
    return {
        name: _read_stack(file, names)
        if LAYOUT[name].channels
        else file.plane(names[0])
        for name, names in passes.others.items()
    }


def _check_fit(file: File, camera: Camera, points: Array, depth: Array) -> None:
    """Raise NotReusable if the camera does not project positions to their pixels."""
    seen = np.flatnonzero(np.isfinite(depth.ravel()) & (depth.ravel() > 0.0))
    if not seen.size:
        return
    spots = seen[:: max(1, seen.size // _SPOTS)]
    world = points.reshape(-1, 3)[spots].astype(np.float64)
    projected = pixels_of(camera) @ np.column_stack((world, np.ones(len(world)))).T
    x, y = centres(spots, depth.shape[1])
    with np.errstate(all="ignore"):  # a wrong camera may be at a point, or far off
        apart = np.hypot(
            projected[0] / projected[2] - x, projected[1] / projected[2] - y
        )
        off = float(np.median(apart))
    if not off < _FITS:
        raise NotReusable(
            f"{file.path}: its camera shows the Position pass {off:.0f} pixels beside "
            "its pixels",
            "give another --camera, --position-space camera, or --temporal-radius 0",
        )


def _read_normal(
    file: File, passes: PassChannels, camera: Camera | None, reading: Reading
) -> Array:
    """Return normals in the camera's axes, Z away from the viewer."""
    normal = _read_stack(file, passes.normal)
    space = reading.normal_space
    if space is None:
        space = "camera" if passes.has_camera_normal else "world"
    if space == "camera" or camera is None:
        return normal
    turn = np.diag([1.0, 1.0, -1.0]) @ camera.view[:3, :3]
    with np.errstate(over="ignore", invalid="ignore"):  # of vectors that are no normals
        return normal @ turn.T.astype(np.float32)


def _read_vector(file: File, passes: PassChannels, reading: Reading) -> Array | None:
    """Cycles' Vector pass, or one of one direction: motion is assumed to be uniform."""
    if not passes.vector:
        return None
    motion = _read_stack(file, passes.vector)
    if motion.shape[-1] == 2:
        motion = motion * np.array(reading.motion_scale, np.float32)
        return -np.concatenate((motion, motion), axis=-1)
    return motion


def _read_noise(file: File, passes: PassChannels) -> Noise:
    """The noise of a frame as XRDS stored it."""
    return Noise.of(*(file.plane(name) for name in passes.noise))


def _read_samples(file: File, part: Part, reading: Reading) -> float:
    """Samples per pixel: from the options, or as XRDS or Blender wrote them."""
    if reading.samples:
        return reading.samples
    mean = part.attributes.get(SAMPLES)
    if isinstance(mean, float) and 1.0 <= mean <= cameras.MOST:
        return mean
    values = []
    for file_part in (part, *file.parts):  # renderers may tell the first part alone
        values.append(file_part.attributes.get(SAMPLES))
        values += [v for k, v in file_part.attributes.items() if _is_cycles_samples(k)]
    counts = [cameras.whole_or_none(x, 1) for x in values]
    return next((x for x in counts if x is not None), _DEFAULT_SAMPLES)


def _is_cycles_samples(name: str) -> bool:
    return name.startswith("cycles.") and name.endswith(".samples")


def _find_target(file: File, passes: PassChannels) -> tuple[int, list[str]]:
    """Return the part that the picture is written to, and its channels' names there.

    Raises Unfit where it lies in another file than the one that is copied.
    """
    part, names = _find_any_target(file, passes)
    if part >= file.own_parts:
        raise Unfit(
            f"the picture of {file.path} lies in a file of --also: give that file as "
            "the input, and this one by --also"
        )
    return part, names


def _find_any_target(file: File, passes: PassChannels) -> tuple[int, list[str]]:
    prefix = passes.picture[0].rpartition(".")[0]
    alpha = f"{prefix}.A" if prefix else "A"
    wanted = [*passes.picture, alpha] if passes.alpha is not None else passes.picture
    present = [name for name in wanted if name in file.names.names]
    parts = {file.place(name)[0] for name in present}
    if len(parts) > 1:
        raise Unfit(
            f"{file.path} holds {', '.join(present)} in several parts; save them in one"
        )
    if not parts:
        names = [_name_in_layer(file.view, x.rpartition(".")[2]) for x in wanted]
        return file.place(passes.beauty[0])[0], names
    ahead = file.place(present[0])[1].rpartition(".")[0]
    return parts.pop(), [_name_in_layer(ahead, x.rpartition(".")[2]) for x in wanted]


def _name_in_layer(layer: str, letter: str) -> str:
    return f"{layer}.{letter}" if layer else letter


def _clean_guide(guide: Array) -> Array:
    """Guides without NaN: a sky may have no normal, and its light is valid anyway."""
    known = np.isfinite(guide).all(axis=-1, keepdims=True)
    return guide if known.all() else np.where(known, guide, np.float32(0.0))


def _read_stack(file: File, names: list[str]) -> Array:
    return np.stack([file.plane(name) for name in names], axis=-1)


def _is_half(file: File, names: list[str]) -> bool:
    return any(file.pixels(name).dtype == np.float16 for name in names)


def _choose_window(path: str | Path, part: Part) -> Window:
    """The window that the arrays of a frame cover.

    Renderers may crop each frame to its content, so that the display window is what
    frames have in common. Our own files all have the same crop. Raises NotReusable if
    the window would be mostly empty and fill the memory.
    """
    if KEY in part.attributes:
        return part.data_window
    (a, b), (c, d) = part.data_window
    (e, f), (g, h) = part.display_window
    whole = (min(a, e), min(b, f)), (max(c, g), max(d, h))
    if is_mostly_empty(_count_pixels(part.data_window), _count_pixels(whole)):
        (left, top), (right, bottom) = whole
        raise NotReusable(
            f"{path} holds few of the {right - left + 1}x{bottom - top + 1} pixels of "
            "its windows",
            "if it is sound give --read-limit, or else --temporal-radius 0",
        )
    return whole


def _count_pixels(window: Window) -> int:
    (left, top), (right, bottom) = window
    return (right - left + 1) * (bottom - top + 1)


def _crop_to(whole: Window, part: Window) -> tuple[slice, slice]:
    """Rows and columns of a data window in the arrays of a larger one."""
    (left, top), _ = whole
    (x, y), (right, bottom) = part
    return slice(y - top, bottom - top + 1), slice(x - left, right - left + 1)
