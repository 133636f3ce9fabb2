"""Which configurations are compared: every method over its range of samples."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from itertools import product
from typing import TYPE_CHECKING, Any

from xrds_blender.planning.settings import (
    CYCLES_DENOISING,
    DEFAULT_DENOISING,
    LOW_DENOISING,
    OUR_DENOISING,
    Denoising,
    Network,
)

from .inputs import OFF, Mode, Request

if TYPE_CHECKING:
    from collections.abc import Iterable

# Fine steps: what is quicker takes more samples, and a budget must show it.
PLAIN_SAMPLES = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)
# Every mode of the denoiser is tried on few samples; on many only those that can
# still win: there the denoiser's own seconds count for little.
FEW_SAMPLES = 8
DENOISERS = CYCLES_DENOISING
MANY_DENOISERS = (Denoising.HIGH_ACCURATE, Denoising.HIGH_FAST)
LOW_SAMPLES = {
    2: (2, 4, 8, 16, 32, 64),
    4: (4, 8, 16, 32, 64, 128),
    8: (16, 32, 64, 128, 256),
}
# Enough where super-resolution wins: with more of either, full size does.
COARSE_LOW_SAMPLES = {2: (2, 4, 8), 4: (8, 16), 8: (32,)}
COARSE_GUIDE_SAMPLES = (1, 2)
NOISE_THRESHOLDS = (0.01, 0.03, 0.1, 0.3)
MOST_ADAPTIVE_SAMPLES = 64
GUIDE_SAMPLES = (1, 2, 4, 8, 16)


@dataclass(frozen=True)
class Config:
    """One way to a picture.

    cycles, oidn, oidn_adaptive (Cycles' adaptive sampling, of `samples` at most),
    `rivals.ENLARGEMENTS`, full_size or xrds. `samples` are per pixel of the beauty
    render, at 1/`scale` of the size. `denoiser` OFF is none; None is as of `Request`.
    """

    method: str
    samples: int
    denoiser: Mode | None = OFF
    scale: int = 1
    preset: str = ""
    guide_samples: int = 0
    noise_threshold: float | None = None

    @property
    def label(self) -> str:
        """Name in plots and tables."""
        if self.method == "full_size":
            return f"XRDS full size, {self.samples} spp, {self.denoiser}"
        if self.noise_threshold is not None:
            until = f"adaptive {self.noise_threshold:g}, at most {self.samples} spp"
            return f"OIDN {self.denoiser}, {until}"
        if self.method in {"cycles", "oidn"}:
            name = "Cycles" if self.method == "cycles" else f"OIDN {self.denoiser}"
            return f"{name}, {self.samples} spp"
        name = {"xrds": f"XRDS {self.preset}"}.get(self.method, self.method)
        samples = f"{self.samples}"
        if self.guide_samples:
            samples += f" + {self.guide_samples}"
        return f"{name} x{self.scale}, {samples} spp, {self.denoiser}"

    @property
    def key(self) -> str:
        """Unique name in files and journals."""
        return "_".join(str(value) for value in _chosen(self).values() if value != "")

    @property
    def network(self) -> Network:
        """The weights it needs."""
        return Network(self.preset, self.scale)

    @property
    def denoises_guides(self) -> bool:
        """Whether OIDN takes the noise of its guides out."""
        from xrds_core.superres.guide_noise import is_noisy

        return self.method == "xrds" and is_noisy(self.guide_samples)

    def beauty(self) -> Request:
        """The render that the picture's light comes from."""
        if self.method == "full_size":  # our denoiser asks for the guides as well
            return Request("full", self.samples)
        kind = "plain" if self.scale == 1 else "low"
        return Request(
            kind,
            self.samples,
            self.scale,
            self.denoiser,
            noise_threshold=self.noise_threshold,
        )

    def guide(self) -> Request | None:
        """The guides' render, None for methods that need none."""
        if not self.guide_samples:
            return None
        return Request("guides", self.guide_samples)

    def requests(self) -> list[Request]:
        """All renders that it needs."""
        guide = self.guide()
        return [self.beauty()] + ([] if guide is None else [guide])


@dataclass(frozen=True)
class Sweep:
    """Sample counts and networks of a run."""

    networks: tuple[Network, ...]
    plain_samples: tuple[int, ...] = PLAIN_SAMPLES
    low_samples: dict[int, tuple[int, ...]] = field(
        default_factory=lambda: dict(LOW_SAMPLES)
    )
    guide_samples: tuple[int, ...] = GUIDE_SAMPLES
    noise_thresholds: tuple[float, ...] = ()
    """Of Cycles' adaptive sampling; each is timed as whole frames of its own."""

    def coarser(self) -> Sweep:
        """Return the sweep with few samples for super-resolution alone."""
        return replace(
            self,
            low_samples=COARSE_LOW_SAMPLES,
            guide_samples=COARSE_GUIDE_SAMPLES,
        )

    @property
    def scales(self) -> list[int]:
        """Scales of the networks, each once."""
        return sorted({network.scale for network in self.networks})

    def configurations(self) -> list[Config]:
        """Everything that is compared, the rivals first."""
        configs = [Config("cycles", n) for n in self.plain_samples]
        configs += [
            Config("oidn", n, denoiser)
            for n in self.plain_samples
            for denoiser in DENOISERS
            if n <= FEW_SAMPLES or denoiser in MANY_DENOISERS
        ]
        configs += [
            adaptive(threshold, denoiser)
            for threshold in self.noise_thresholds
            for denoiser in MANY_DENOISERS
        ]
        configs += [
            Config("full_size", n, denoiser)
            for n in self.plain_samples
            for denoiser in OUR_DENOISING
        ]
        for scale in self.scales:
            configs += self._baselines(scale)
        for network in self.networks:
            configs += self._enlarged(network)
        return configs

    def _baselines(self, scale: int) -> list[Config]:
        configs = []
        for n in self.low_samples[scale]:
            bicubic = Config("bicubic", n, DEFAULT_DENOISING, scale)
            configs.append(bicubic)
            configs += [
                replace(
                    bicubic,
                    method="demodulated_bilinear",
                    guide_samples=guide_samples,
                )
                for guide_samples in self.guide_samples
            ]
        return configs

    def _enlarged(self, network: Network) -> list[Config]:
        return [
            xrds(network, n, denoiser, guide_samples)
            for n, denoiser, guide_samples in product(
                self.low_samples[network.scale],
                LOW_DENOISING,
                self.guide_samples,
            )
        ]


def xrds(
    network: Network,
    samples: int = 1,
    denoiser: Mode | None = OFF,
    guide_samples: int = 0,
) -> Config:
    """A configuration of the product."""
    preset, scale = network
    return Config("xrds", samples, denoiser, scale, preset, guide_samples)


def adaptive(noise_threshold: float, denoiser: Mode) -> Config:
    """Cycles with its adaptive sampling and its denoiser."""
    return Config(
        "oidn_adaptive",
        MOST_ADAPTIVE_SAMPLES,
        denoiser,
        noise_threshold=noise_threshold,
    )


def anchor(
    kind: str, scale: int = 1, denoiser: Mode | None = OFF, more: bool = False
) -> Request:
    """A render that is timed: of few samples, or of `more` for the line's slope."""
    samples = (scale if kind == "low" else 1) * (4 if more else 1)
    request = Request(kind, samples, scale, denoiser)
    return replace(request, denoiser=None) if request.has_guides else request


def anchors(configs: Iterable[Config]) -> list[Request]:
    """Renders of a whole frame from which the seconds of every configuration follow.

    Two sample counts for the line through each kind of render, and every mode of the
    denoiser once. Not of adaptive sampling, whose seconds are no line.
    """
    needed: dict[Request, None] = {}
    lines = [config for config in configs if config.noise_threshold is None]
    for request in (request for config in lines for request in config.requests()):
        for more in (False, True):
            needed[anchor(request.kind, request.scale, more=more)] = None
        if not request.has_guides and request.denoiser != OFF:
            needed[anchor(request.kind, request.scale, request.denoiser)] = None
    return list(needed)


def describe(config: Config) -> dict[str, Any]:
    """The entry `settings` of results.json."""
    return {key: value for key, value in _chosen(config).items() if key != "method"}


def _chosen(config: Config) -> dict[str, Any]:
    """The fields; the noise threshold only where there is one."""
    fields = asdict(config)
    if config.noise_threshold is None:
        del fields["noise_threshold"]
    return fields
