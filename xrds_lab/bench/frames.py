"""What a whole frame takes with every method, from runs taken in turns."""

from __future__ import annotations

import hashlib
import json
import time
from typing import TYPE_CHECKING, Any

from xrds_blender.planning.denoiser import DEFAULT_DENOISER

from .contenders import ENLARGEMENTS
from .inputs import SEEDS, open_scene
from .tasks import noise
from .timing import FrameTimes

if TYPE_CHECKING:
    from collections.abc import Callable

    from .contenders import Case, Contenders
    from .timing import Stages
    from .windows import Shot

# Enough for the fixed part and the slope of plain Cycles with its denoiser.
PLAIN_SAMPLES = (1, 2)


class FrameSeconds:
    """Seconds of one scene's whole frame by case and method; measured on creation."""

    def __init__(self, shot: Shot, contenders: Contenders, rounds: int) -> None:
        self.shot, self.contenders = shot, contenders
        self.times = FrameTimes(shot, contenders.folder.directory, contenders.say)
        for samples in PLAIN_SAMPLES:
            self.times.add(f"plain {samples} spp", self._plain(samples))
        for case in contenders.settings.cases:
            self._add(case)
        self.times.measure(rounds)

    def plain(self, samples: int) -> Stages:
        """A frame of plain Cycles with its denoiser, as the fit of its runs has it."""
        fixed, per_sample = self._fit()
        return {"total": fixed + samples * per_sample, "samples": samples}

    def equal_time_samples(self, case: Case) -> int:
        """Samples that plain Cycles with its denoiser takes in the product's time."""
        fixed, per_sample = self._fit()
        return max(1, round((self.methods(case)["xrds"]["total"] - fixed) / per_sample))

    def methods(self, case: Case) -> dict[str, Stages]:
        """Seconds by stage of every method; the product's only with weights."""
        render = self.times.median(self._render_name(case))
        guides = render["guide_sync"] + render["guides"]
        result = {}
        for method in ENLARGEMENTS:
            own = self.times.median(f"{method} x{case.scale}")["total"]
            unused = guides if method == "bicubic" else 0.0
            result[method] = {"total": render["total"] - unused + own}
        samples = self.contenders.settings.equal_samples(case.scale)
        result["oidn_equal_spp"] = self.plain(samples)
        if self.contenders.upscaler(case) is not None:
            network = self.times.median(self._network_name(case))
            result["xrds"] = _product(render, network)
        return result

    def _fit(self) -> tuple[float, float]:
        """Fixed seconds and seconds per sample of plain Cycles."""
        low, high = (self.times.median(f"plain {n} spp") for n in PLAIN_SAMPLES)
        step = PLAIN_SAMPLES[1] - PLAIN_SAMPLES[0]
        # of the sampling stage alone: the denoiser's own scatter would drown it
        per_sample = max((high["beauty"] - low["beauty"]) / step, 1e-3)
        return low["total"] - PLAIN_SAMPLES[0] * per_sample, per_sample

    def _add(self, case: Case) -> None:
        """Tasks of a case; those it shares with another are listed once."""
        low, guide = noise(self.shot.window, case.scale)
        self.times.add(self._render_name(case), self._render(case))
        for method, enlarge in ENLARGEMENTS.items():
            self.times.add(
                f"{method} x{case.scale}",
                lambda enlarge=enlarge: enlarge(low, low, guide, guide, case.scale),
            )
        upscaler = self.contenders.upscaler(case)
        if upscaler is not None:
            extra = guide if case.guides == "full" else None
            samples = self.contenders.settings.guide_samples
            self.times.add(
                self._network_name(case),
                lambda: upscaler(
                    low,
                    guide,
                    guide,
                    noisy=low,
                    guide_radiance=extra,
                    guide_samples=samples,
                ),
                warm=True,
            )

    def _render_name(self, case: Case) -> str:
        chosen = self.contenders.settings
        guides = f"{case.guides} guides {chosen.guide_samples} spp"
        return f"x{case.scale} {chosen.samples} spp, {guides}"

    def _network_name(self, case: Case) -> str:
        """Carries the network's sizes: weights alone do not change its seconds."""
        config = self.contenders.upscaler(case).network.config.to_dict()
        digest = hashlib.sha256(json.dumps(config, sort_keys=True).encode())
        return f"{case.label} x{case.scale} {digest.hexdigest()[:8]}"

    def _plain(self, samples: int) -> Callable[[], Stages]:
        def job(passes: Any) -> Stages:
            seed = SEEDS["plain"]
            picture = passes.beauty(1, samples, seed=seed, denoiser=DEFAULT_DENOISER)
            return dict(picture.seconds)

        return lambda: _whole_frame(self.shot, job)

    def _render(self, case: Case) -> Callable[[], Stages]:
        chosen, full = self.contenders.settings, case.guides == "full"

        def job(passes: Any) -> Stages:
            beauty = passes.beauty(case.scale, chosen.samples, seed=SEEDS["low"])
            seed = SEEDS["full" if full else "guides"]
            guides = passes.guides(chosen.guide_samples, full=full, seed=seed)
            return dict(beauty.seconds) | {
                "guide_sync": guides.seconds["sync"],
                "guides": guides.seconds["guides"],
            }

        return lambda: _whole_frame(self.shot, job)


def _product(render: Stages, network: Stages) -> Stages:
    """Stages of the whole path from those of its renders and of its network."""
    stages = render | {"network": network["total"]}
    stages["sync"] += stages.pop("guide_sync")
    return stages | {both: render[both] + network[both] for both in ("total", "cpu")}


def _whole_frame(shot: Shot, job: Callable[[Any], Stages]) -> Stages:
    """Seconds of one whole frame rendered from a freshly opened file."""
    from xrds_blender import run_job

    scene = open_scene(shot.path, shot.window.whole)
    wall, cpu = time.perf_counter(), time.process_time()
    stages = run_job(scene, job)
    total = time.perf_counter() - wall
    return stages | {"total": total, "cpu": time.process_time() - cpu}
