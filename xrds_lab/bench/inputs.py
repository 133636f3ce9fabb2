"""Inputs of a measurement: rendered once by the product's passes, kept in a folder."""

from __future__ import annotations

import json
import tempfile
import zipfile
import zlib
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from xrds_blender.planning.settings import DEFAULT_DENOISING, Denoising
from xrds_core.arrays import Array
from xrds_core.errors import SceneError
from xrds_core.files import replacing

from ..cards.cycles import render_on

if TYPE_CHECKING:
    from collections.abc import Iterator

    from .windows import Shot, Window

Arrays = dict[str, Array]
# Counts up whenever the pass code changes what it renders: old files are then left.
GENERATION = 3
OFF: Literal["OFF"] = "OFF"
"""In place of a denoiser's mode: the picture as rendered."""
Mode = Denoising | Literal["OFF"]
# Unlike the references', so that no noise is shared with them or between a picture's
# light and its guides. What denoises in Cycles and what does so outside get the same.
SEEDS = {"low": 101, "guides": 202, "full": 404, "plain": 404}


@dataclass(frozen=True)
class Request:
    """One rendered input.

    low: beauty at 1/scale, denoised and before; guides: albedo and normal; full: noisy
    full-resolution beauty, with the guides that our denoiser asks for; plain: denoised
    full-resolution Cycles.
    `denoiser` None is the standard measure's: Blender's default for plain, the scene's
    own mode for low. With a `noise_threshold`, of plain alone, Cycles samples
    adaptively: `samples` are the most that a pixel gets.
    """

    kind: str
    samples: int
    scale: int = 1
    denoiser: Mode | None = None
    seed: int | None = None
    noise_threshold: float | None = None

    @property
    def has_guides(self) -> bool:
        """Whether it holds albedo and normal."""
        return self.kind in {"guides", "full"}

    def file_name(self, shot: Shot) -> str:
        """A name that depends on everything the pixels depend on."""
        import bpy

        mode = "" if self.denoiser is None else f"-{self.denoiser}"
        what = f"{self.kind}{self.scale}-{self.samples}spp{mode}-seed{self._seed}"
        if self.noise_threshold is not None:
            what += f"-noise{self.noise_threshold:g}"
        what += f"-v{GENERATION}"
        version = bpy.app.version_string.replace(" ", "")
        scene = f"{shot.name}-{shot.digest}-{shot.window.label}"
        return f"{scene}-{what}-blender{version}.npz"

    def render(self, passes: Any) -> tuple[Arrays, dict[str, float]]:
        """Arrays and seconds by stage, from inside run_job.

        Adaptive sampling is the scene's: `sample_adaptively` sets it before.
        """
        seed = self._seed
        if self.kind == "guides":
            guides = passes.guides(self.samples, seed=seed)
            return {"albedo": guides.albedo, "normal": guides.normal}, guides.seconds
        if self.kind == "full":
            noisy = passes.low_samples(1, self.samples, seed=seed)[passes.views[0]]
            found = noisy.samples
            arrays = {"radiance": found.picture[..., :3]}
            arrays |= {"albedo": found.albedo, "normal": found.normal}
            return arrays, noisy.place.seconds
        samples = self.samples if self.noise_threshold is None else None
        beauty = passes.beauty(self.scale, samples, seed=seed, **self._denoising())
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
        if self.denoiser is None and self.kind == "plain":
            return {"denoiser": DEFAULT_DENOISING}
        return {"denoiser": self.denoiser}


class Folder:
    """Rendered inputs on disk."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        directory.mkdir(parents=True, exist_ok=True)

    def read(self, name: str) -> Arrays | None:
        """Arrays of a file; None if it is missing or damaged."""
        try:
            with np.load(self.directory / name) as file:
                return dict(file)
        except (OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error):
            return None

    def has(self, name: str) -> bool:
        """Whether the file exists and is complete."""
        path = self.directory / name
        return path.is_file() and zipfile.is_zipfile(path)

    def write(self, name: str, arrays: Arrays, seconds: dict[str, float]) -> None:
        """Keep arrays; a reader never sees half a file."""
        note = np.array(json.dumps(seconds))
        with replacing(self.directory / name) as part, part.open("wb") as file:
            np.savez(file, **arrays, seconds=note)


@contextmanager
def kept(directory: Path | None) -> Iterator[Folder]:
    """A folder of rendered inputs; without a directory, a temporary one."""
    if directory is not None:
        yield Folder(directory)
        return
    with tempfile.TemporaryDirectory() as temporary:
        yield Folder(Path(temporary))


def open_scene(path: Path, window: Window, device: str | None = None) -> Any:
    """Open a scene file and set it up for the standard measure; returns the scene.

    Cycles renders on a `device` as in `Shot`, None for what the file says.
    """
    import bpy

    from xrds_blender.interface.registration import ensure_registered

    bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False, use_scripts=False)
    ensure_registered()
    scene = bpy.context.scene
    window.apply(scene)
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.time_limit = 0
    if device is not None:
        render_on(scene, device)
    return scene


def sample_adaptively(scene: Any, samples: int, noise_threshold: float) -> None:
    """Let Cycles stop early where the noise is below a threshold.

    Its least samples stay Cycles' own choice, as for users.
    """
    scene.cycles.samples = samples
    scene.cycles.use_adaptive_sampling = True
    scene.cycles.adaptive_threshold = noise_threshold
    scene.cycles.adaptive_min_samples = 0
    for layer in scene.view_layers:
        layer.samples = 0
