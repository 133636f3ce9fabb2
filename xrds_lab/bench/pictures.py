"""The picture of every configuration on one shot, and its errors."""

from __future__ import annotations

import json
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from xrds_blender.planning.settings import DEFAULT_DENOISING, Network
from xrds_blender.planning.settings import Denoising as Mode
from xrds_core import denoising
from xrds_core.denoising import Denoiser
from xrds_core.errors import SceneError
from xrds_core.files import replacing
from xrds_core.superres import front_end

from .. import metrics
from ..checksum import checksum
from .inputs import GENERATION, Folder, Request, open_scene, sample_adaptively
from .journal import Strict
from .rivals import ENLARGEMENTS
from .windows import read_reference

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from xrds_core.arrays import Array

    from ..progress import Progress
    from .inputs import Arrays
    from .journal import Journal
    from .sweep import Config
    from .windows import Shot

HALF_SEEDS = (11, 12)  # of a reference's two halves
CACHE_BYTES = 600e6  # of rendered inputs held in memory
HALVES_GAIN = 3.01  # dB by which the mean of two halves is better than either


class Networks:
    """Upscalers by network, each loaded once."""

    def __init__(self, weights: Path | None, device: str) -> None:
        from xrds_core.superres import weights_header as files

        self.weights, self.device = weights, device
        self._loaded: dict[Network, Any] = {}
        self.records = {
            Network(record["preset"], record["scale"]): record
            for record in files.available(weights)
        }

    def digest(self, network: Network) -> str:
        """The first digits of the weights file's checksum."""
        return str(self.records[network]["sha256"])[:12]

    def __getitem__(self, network: Network) -> Any:
        if network not in self._loaded:
            from xrds_core.superres.upscaler import Upscaler

            self._loaded[network] = Upscaler(
                *network, self.device, weights=self.weights
            )
        return self._loaded[network]


class Pictures:
    """Makes pictures of rendered inputs and measures them against the reference."""

    def __init__(
        self,
        shot: Shot,
        folder: Folder,
        networks: Networks,
        reference_samples: int = 0,
    ) -> None:
        self.shot, self.folder, self.networks = shot, folder, networks
        self.reference_samples = reference_samples
        self._errors_file = folder.directory / f"{_identity(shot)}-errors.json"
        self._errors = _stored(self._errors_file)
        pixels = shot.window.width * shot.window.height
        kept = min(max(int(CACHE_BYTES / (24 * pixels)), 4), 64)
        self._read = lru_cache(maxsize=kept)(self._from_folder)

    # --- rendering --------------------------------------------------------------------

    def halves(self) -> list[Request]:
        """Renders of the reference's two halves; none if the shot has a reference."""
        if self.shot.reference is not None:
            return []
        samples = self.reference_samples
        return [
            Request("plain", samples, 1, DEFAULT_DENOISING, seed) for seed in HALF_SEEDS
        ]

    def missing(self, configs: Sequence[Config]) -> list[Request]:
        """Renders still missing for them and the reference.

        Guides come after the beauty that they go with, as the product renders them.
        """
        wanted = dict.fromkeys(r for config in configs for r in config.requests())
        for half in self.halves():
            wanted[half] = None
        return [r for r in wanted if not self.folder.has(r.file_name(self.shot))]

    def render(
        self,
        requests: Sequence[Request],
        journal: Journal | Strict,
        done: Callable[[Request], object],
    ) -> None:
        """Render requests into the folder; failures go into the journal."""
        from xrds_blender import run_job

        names = {r: f"{self.shot.name}: {r.file_name(self.shot)}" for r in requests}
        left = [r for r in requests if not journal.gives_up(names[r])]
        if not left:
            return

        def job(passes: Any, part: Sequence[Request], exposure: np.float32) -> None:
            for request in part:
                with journal.attempt(names[request]):
                    arrays, seconds = request.render(passes)
                    arrays["view_exposure"] = exposure
                    name = request.file_name(self.shot)
                    self.folder.write(name, arrays, seconds)
                done(request)

        for part in _sessions(left):
            with journal.attempt(f"{self.shot.name}: rendering its inputs"):
                scene = open_scene(self.shot.path, self.shot.window, self.shot.device)
                exposure = np.float32(scene.view_settings.exposure)
                first = part[0]
                if first.noise_threshold is not None:
                    sample_adaptively(scene, first.samples, first.noise_threshold)
                run_job(scene, partial(job, part=part, exposure=exposure))

    def render_missing(self, configs: Sequence[Config], progress: Progress) -> None:
        """Render what the configurations still need; raises the first failure."""
        self.render(
            self.missing(configs),
            Strict(),
            lambda r: progress(f"{self.shot.name}: rendered {r.kind} {r.samples} spp"),
        )

    # --- pictures ---------------------------------------------------------------------

    def picture(self, config: Config) -> Array:
        """Radiance (H, W, 3) of the window; raises SceneError without its renders."""
        beauty, *rest = (_cleaned(self._read(r)) for r in config.requests())
        radiance = beauty["radiance"]
        if config.method == "full_size":
            denoiser = Denoiser(Mode(config.denoiser).quality)
            return denoiser(radiance, beauty["albedo"], beauty["normal"]).radiance
        if config.scale == 1:
            return radiance
        guide = rest[0] if rest else {}
        if config.method == "xrds":
            upscaled = self.networks[config.network](
                radiance,
                guide["albedo"],
                guide["normal"],
                noisy=beauty.get("noisy"),
                guide_samples=config.guide_samples,
            )
            return np.asarray(upscaled.radiance[..., :3])
        albedo, normal = (
            front_end.pad_guide(guide[name], radiance, config.scale) if guide else None
            for name in ("albedo", "normal")
        )
        noisy = beauty.get("noisy", radiance)
        enlarge = ENLARGEMENTS[config.method]
        height, width = self.reference().shape[:2]
        return enlarge(radiance, noisy, albedo, normal, config.scale)[:height, :width]

    def reference(self) -> Array:
        """The reference (H, W, 3): the shot's own, or the mean of two halves."""
        if self.shot.reference is not None:
            return read_reference(self.shot.reference)
        first, second = self.references()
        return (first + second) / 2

    def references(self) -> tuple[Array, Array]:
        """Two references of independent noise; the shot's own one twice."""
        if self.shot.reference is not None:
            return (self.reference(),) * 2
        first, second = (self._read(half)["radiance"] for half in self.halves())
        return first, second

    def floor(self) -> float | None:
        """PSNR (dB) of the reference itself, by how its halves differ."""
        if self.shot.reference is not None:
            return self.shot.window.floor_psnr
        first, second = (self._read(half) for half in self.halves())
        stops = float(first["view_exposure"])
        apart = metrics.psnr(first["radiance"], second["radiance"], stops)
        return apart + HALVES_GAIN

    def knows(self, config: Config) -> bool:
        """Whether its errors were measured before."""
        return self._key(config) in self._errors

    def _key(self, config: Config) -> str:
        key = f"{config.key}-v{GENERATION}"
        if config.method == "full_size":
            return f"{key}-{_denoisers_code()}"
        if config.method != "xrds":
            return key
        key += f"-{self.networks.digest(config.network)}"
        if config.denoises_guides:
            key += "-denoised-guides"
        return key

    def errors(self, config: Config) -> dict[str, float]:
        """Error measures, computed once for these weights."""
        key = self._key(config)
        if key not in self._errors:
            self._errors[key] = metrics.all_metrics(
                self.picture(config), self.reference(), self.exposure(config)
            )
        return dict(self._errors[key])

    def save(self) -> None:
        """Keep the errors for the next run."""
        with replacing(self._errors_file) as part:
            part.write_text(json.dumps(self._errors), "utf-8")

    def exposure(self, config: Config) -> float:
        """Stops of the scene's view."""
        return float(self._read(config.beauty())["view_exposure"])

    def _from_folder(self, request: Request) -> Arrays:
        name = request.file_name(self.shot)
        arrays = self.folder.read(name)
        if arrays is None:
            path = self.folder.directory / name
            raise SceneError(f"{path} cannot be read: delete it and run again")
        return arrays


_CLEAN = {
    "radiance": front_end.clean_radiance,
    "noisy": front_end.clean_radiance,
    "albedo": front_end.clean_albedo,
    "normal": front_end.clean_normal,
}


def _cleaned(arrays: Arrays) -> Arrays:
    """The pictures as the product cleans its inputs."""
    return {n: _CLEAN[n](array)[0] for n, array in arrays.items() if n in _CLEAN}


@lru_cache(maxsize=1)
def _denoisers_code() -> str:
    return checksum(Path(denoising.__file__).parent.glob("*.py"))


def _sessions(requests: Sequence[Request]) -> list[list[Request]]:
    """Requests that one session of Cycles renders: adaptive sampling is a session's."""
    sessions: dict[tuple[float, int] | None, list[Request]] = {}
    for request in requests:
        threshold = request.noise_threshold
        key = None if threshold is None else (threshold, request.samples)
        sessions.setdefault(key, []).append(request)
    return list(sessions.values())


def _identity(shot: Shot) -> str:
    reference = "own" if shot.reference is None else shot.reference.stem
    return f"{shot.name}-{shot.digest}-{shot.window.label}-{reference}"


def _stored(path: Path) -> dict[str, dict[str, float]]:
    try:
        return dict(json.loads(path.read_text("utf-8")))
    except (OSError, ValueError):
        return {}
