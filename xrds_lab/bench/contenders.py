"""Every picture of the standard measure's table, made of the same rendered inputs."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from itertools import product
from typing import TYPE_CHECKING, Any

from xrds_core import baselines, front_end
from xrds_core.errors import UsageError

from .inputs import Folder, Request, rendered

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    import numpy as np

    from .inputs import Arrays, Say
    from .windows import Shot

    Enlargement = Callable[
        [np.ndarray, np.ndarray, np.ndarray, np.ndarray, int], np.ndarray
    ]

GUIDES = ("fast", "full")

# By the method's name in every report:
# (radiance, the same before denoising, albedo, normal, scale) -> picture.
ENLARGEMENTS: dict[str, Enlargement] = {
    "bicubic": lambda low, noisy, albedo, normal, s: baselines.bicubic(low, s),
    "demodulated_bilinear": lambda low, noisy, albedo, normal, s: (
        front_end.demodulated_base(low, albedo, s)
    ),
    "joint_bilateral": lambda low, noisy, *guides: baselines.joint_bilateral(
        low, *guides
    ),
    "regressed": front_end.regressed_base,
}


@dataclass(frozen=True)
class Case:
    """One row block of the table: a network and the inputs it is given."""

    scale: int
    preset: str
    guides: str

    @property
    def label(self) -> str:
        """Preset as the weights files name it: with ``_full`` for those guides."""
        return self.preset if self.guides == "fast" else f"{self.preset}_{self.guides}"


@dataclass(frozen=True)
class Settings:
    """What is rendered and compared; the defaults are the standard measure."""

    scales: tuple[int, ...] = (2, 4)
    presets: tuple[str, ...] = ("fast",)
    guides: tuple[str, ...] = ("fast",)
    samples: int = 16
    guide_samples: int = 4
    device: str = "auto"

    def __post_init__(self) -> None:
        unknown = set(self.guides) - set(GUIDES)
        if unknown:
            raise UsageError(f"guides {sorted(unknown)} do not exist: take {GUIDES}")

    @property
    def cases(self) -> list[Case]:
        """Every scale with every preset and guide set."""
        return [Case(*each) for each in product(self.scales, self.presets, self.guides)]

    def equal_samples(self, scale: int) -> int:
        """Full-resolution samples with as many rays, guides counted in."""
        return max(1, round(self.samples / scale**2 + self.guide_samples))


@dataclass
class Inputs:
    """Arrays of one case, cleaned as the product cleans them."""

    radiance: np.ndarray
    noisy: np.ndarray
    albedo: np.ndarray
    normal: np.ndarray
    guide_radiance: np.ndarray | None
    exposure_stops: float


class Contenders:
    """Renders or reads inputs and makes the pictures that are compared."""

    def __init__(
        self, settings: Settings, folder: Folder, weights: Path | None, say: Say
    ) -> None:
        self.settings, self.folder, self.say = settings, folder, say
        self.weights = weights
        self._upscalers: dict[Case, Any] = {}

    def upscaler(self, case: Case) -> Any | None:
        """The case's Upscaler, None where there are no weights for it."""
        if case not in self._upscalers:
            self._upscalers[case] = self._load(case)
        return self._upscalers[case]

    def pictures(self, shot: Shot, case: Case) -> tuple[dict[str, np.ndarray], float]:
        """Pictures by method, the product's first, and the view's stops."""
        inputs = self.inputs(shot, case)
        guides = inputs.albedo, inputs.normal
        result = {}
        upscaler = self.upscaler(case)
        if upscaler is not None:
            result["xrds"] = upscaler(
                inputs.radiance,
                *guides,
                noisy=inputs.noisy,
                guide_radiance=inputs.guide_radiance,
                guide_samples=self.settings.guide_samples,
            ).radiance[..., :3]
        for name, enlarge in ENLARGEMENTS.items():
            result[name] = enlarge(inputs.radiance, inputs.noisy, *guides, case.scale)
        samples = self.settings.equal_samples(case.scale)
        result["oidn_equal_spp"] = self.plain(shot, samples)
        return result, inputs.exposure_stops

    def plain(self, shot: Shot, samples: int) -> np.ndarray:
        """Full-resolution Cycles with Blender's default denoiser settings."""
        request = Request("plain", samples)
        return self._rendered(shot, request)["radiance"]

    def inputs(self, shot: Shot, case: Case) -> Inputs:
        """What the product would have rendered for the case."""
        low = self._rendered(shot, self._low(case.scale))
        guides = self._rendered(shot, self._guides(case.guides))
        radiance = guides.get("radiance")
        return Inputs(
            front_end.clean_radiance(low["radiance"])[0],
            front_end.clean_radiance(low.get("noisy", low["radiance"]))[0],
            front_end.clean_albedo(guides["albedo"])[0],
            front_end.clean_normal(guides["normal"])[0],
            None if radiance is None else front_end.clean_radiance(radiance)[0],
            float(low["view_exposure"]),
        )

    def _requests(self) -> list[Request]:
        """All that a scene will be asked for: one Blender render makes them."""
        chosen = self.settings
        plain = {chosen.equal_samples(scale) for scale in chosen.scales}
        return [
            *(self._low(scale) for scale in chosen.scales),
            *(self._guides(kind) for kind in chosen.guides),
            *(Request("plain", samples) for samples in sorted(plain)),
        ]

    def _low(self, scale: int) -> Request:
        return Request("low", self.settings.samples, scale)

    def _guides(self, kind: str) -> Request:
        name = "full" if kind == "full" else "guides"
        return Request(name, self.settings.guide_samples)

    def _rendered(self, shot: Shot, request: Request) -> Arrays:
        found = self.folder.read(request.file_name(shot))
        if found is not None:
            return found
        wanted = dict.fromkeys([*self._requests(), request])
        return rendered(shot, list(wanted), self.folder, self.say)[request]

    def _load(self, case: Case) -> Any | None:
        from xrds_core import weights
        from xrds_core.upscaler import Upscaler

        wanted = asdict(case)
        if not any(
            wanted.items() <= r.items() for r in weights.available(self.weights)
        ):
            self.say(f"x{case.scale} {case.label} has no weights yet: rivals alone")
            return None
        return Upscaler(**wanted, device=self.settings.device, weights=self.weights)
