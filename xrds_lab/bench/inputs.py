"""Rendered inputs of the standard measure, each rendered once and kept in a folder.

Everything goes through the product's own passes, in one Blender render per scene.
"""

from __future__ import annotations

import json
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from xrds_blender.planning.denoiser import DEFAULT_DENOISER, Denoiser
from xrds_core.atomic import replacing
from xrds_core.errors import SceneError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from .windows import Shot, Window

    Arrays = dict[str, np.ndarray]
    Say = Callable[[str], object]

# Counts up whenever the pass code changes what it renders: old files are then left.
GENERATION = 2
# Unlike each other and unlike the references', so that no noise is shared.
OFF = "OFF"  # in place of a denoiser's mode: the picture as rendered
SEEDS = {"low": 101, "guides": 202, "full": 303, "plain": 404}


def silent(line: str) -> None:
    """Tell nobody: in the place of a progress line's listener."""


@dataclass(frozen=True)
class Request:
    """One rendered input.

    low: beauty at 1/scale, denoised and before; guides: albedo and normal; full: the
    same with the radiance of all bounces; plain: denoised full-resolution Cycles.
    ``denoiser`` is one of budget.DENOISERS or OFF; None is what the standard measure
    takes.
    """

    kind: str
    samples: int
    scale: int = 1
    denoiser: str | None = None
    seed: int | None = None

    def file_name(self, shot: Shot) -> str:
        """Name that changes with everything the pixels depend on."""
        import bpy

        mode = "" if self.denoiser is None else f"-{self.denoiser}"
        what = f"{self.kind}{self.scale}-{self.samples}spp{mode}-seed{self._seed}"
        what += f"-v{GENERATION}"
        version = bpy.app.version_string.replace(" ", "")
        scene = f"{shot.name}-{shot.digest}-{shot.window.label}"
        return f"{scene}-{what}-blender{version}.npz"

    def render(self, passes: Any) -> tuple[Arrays, dict[str, float]]:
        """Arrays and seconds by stage, from inside run_job."""
        seed = self._seed
        if self.kind in {"guides", "full"}:
            full = self.kind == "full"
            guides = passes.guides(self.samples, full=full, seed=seed)
            arrays = {"albedo": guides.albedo, "normal": guides.normal}
            return arrays | ({"radiance": guides.radiance} if full else {}), (
                guides.seconds
            )
        beauty = passes.beauty(self.scale, self.samples, seed=seed, **self._denoising())
        if any(beauty.offset):
            raise SceneError(
                f"the window does not start on whole pixels at scale {self.scale}: "
                f"move it by {tuple(beauty.offset)}"
            )
        arrays = {"radiance": beauty.radiance}
        if beauty.noisy is not None and self.kind == "low":
            arrays["noisy"] = beauty.noisy
        return arrays, beauty.seconds

    @property
    def _seed(self) -> int:
        return SEEDS[self.kind] if self.seed is None else self.seed

    def _denoising(self) -> dict[str, Any]:
        """Arguments of passes.beauty."""
        if self.denoiser == OFF:
            return {"denoise": False}
        if self.denoiser is not None:
            return {"denoiser": Denoiser(self.denoiser)}
        # Blender's own default for plain pictures; the product's choice for low ones
        return {"denoiser": DEFAULT_DENOISER if self.kind == "plain" else None}


class Folder:
    """Rendered inputs on disk; without a folder they last as long as the object."""

    def __init__(self, directory: Path | None) -> None:
        self.directory = directory
        self.kept: dict[str, Arrays] = {}

    def read(self, name: str) -> Arrays | None:
        """Arrays of a file, or None when there is none that can be read."""
        if name in self.kept or self.directory is None:
            return self.kept.get(name)
        try:
            with np.load(self.directory / name) as file:
                return dict(file)
        except (OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error):
            return None

    def has(self, name: str) -> bool:
        """Whether there is such a file, not yet whether it can be read."""
        if self.directory is None:
            return name in self.kept
        return (self.directory / name).is_file()

    def write(self, name: str, arrays: Arrays, seconds: dict[str, float]) -> None:
        """Keep arrays (as float32); a reader never sees half a file."""
        arrays = {key: np.asarray(a, np.float32) for key, a in arrays.items()}
        if self.directory is None:
            self.kept[name] = arrays
            return
        self.directory.mkdir(parents=True, exist_ok=True)
        note = np.array(json.dumps(seconds))
        with replacing(self.directory / name) as part, part.open("wb") as file:
            np.savez(file, **arrays, seconds=note)


def rendered(
    shot: Shot, requests: Sequence[Request], folder: Folder, say: Say
) -> dict[Request, Arrays]:
    """The arrays of every request; what is not in the folder is rendered.

    Beside the pixels each holds ``view_exposure``, the stops of the scene's view.
    """
    found = {r: folder.read(r.file_name(shot)) for r in requests}
    missing = [r for r, arrays in found.items() if arrays is None]
    if missing:
        _render(shot, missing, folder, say)
    return {r: _kept(folder, r.file_name(shot), found[r]) for r in requests}


def open_scene(path: Path, window: Window) -> Any:
    """Open a scene file and set it up for the standard measure; returns the scene."""
    import bpy

    from xrds_blender.interface.registration import ensure_registered

    bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False, use_scripts=False)
    ensure_registered()
    scene = bpy.context.scene
    window.apply(scene)
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.time_limit = 0
    return scene


def _render(shot: Shot, missing: list[Request], folder: Folder, say: Say) -> None:
    from xrds_blender import run_job

    scene = open_scene(shot.path, shot.window)
    exposure = np.float32(scene.view_settings.exposure)

    def job(passes: Any) -> None:
        for request in missing:
            arrays, seconds = request.render(passes)
            arrays["view_exposure"] = exposure
            folder.write(request.file_name(shot), arrays, seconds)
            spent = ", ".join(f"{k} {s:.1f} s" for k, s in seconds.items())
            say(f"{shot.name}: rendered {request.kind} {request.samples} spp, {spent}")

    run_job(scene, job)


def _kept(folder: Folder, name: str, arrays: Arrays | None) -> Arrays:
    arrays = folder.read(name) if arrays is None else arrays
    if arrays is None:
        raise SceneError(f"{name} was rendered but cannot be read back")
    return {key: value for key, value in arrays.items() if key != "seconds"}
