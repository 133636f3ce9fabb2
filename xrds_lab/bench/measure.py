"""One scene of the report: its seconds, its errors, and the picker at its budgets."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

from xrds_blender.planning import budget
from xrds_blender.planning.estimates import GUIDE_SHARE
from xrds_blender.planning.request import Machine, render_request
from xrds_blender.planning.settings import DEFAULT_DENOISING, Mode
from xrds_blender.planning.settings import Settings as RenderSettings
from xrds_blender.rendering.time_budget import measure
from xrds_core.files import read_json, write_json

from . import tasks, workload
from .inputs import Folder, open_scene
from .pictures import Networks, Pictures
from .stages import PLAIN_FRAME, StageTimes, Stopwatch
from .sweep import DENOISERS, Config, Sweep, anchor, anchors, describe

if TYPE_CHECKING:
    from .inputs import Request
    from .journal import Journal
    from .windows import Shot
    from .workload import Meter

    Point = dict[str, Any]

# Configurations a little above the largest budget still shape the curves.
MOST_OVER_BUDGET = 1.3
DEFAULT = Config("oidn", 1, DEFAULT_DENOISING)  # the unit of the budgets


@dataclass(frozen=True)
class Settings:
    """The settings that all scenes of a run share."""

    sweep: Sweep
    folder: Folder
    networks: Networks
    journal: Journal
    budgets: tuple[float, ...]
    rounds: int
    reference_samples: int
    timing: bool = True
    picker: bool = True


class SceneBench:
    """Measures one shot; keeps every result in files and repeats nothing."""

    def __init__(self, shot: Shot, settings: Settings) -> None:
        self.shot, self.settings = shot, settings
        self._configs = settings.sweep.configurations()
        directory = settings.folder.directory
        self.times = StageTimes(directory / f"{shot.identity}-stages.json")
        self._picks_file = directory / f"{shot.identity}-picks.json"
        # Encoded, by label: the report is written again after every scene.
        self.crops: dict[str, str] = {}
        self.pictures = Pictures(
            shot, settings.folder, settings.networks, settings.reference_samples
        )

    @property
    def name(self) -> str:
        """The scene's name."""
        return self.shot.name

    @property
    def configs(self) -> list[Config]:
        """All that is compared: what takes longer than any budget is left out."""
        if not self.settings.timing:
            return self._configs
        limit = MOST_OVER_BUDGET * max(self.settings.budgets) * self.unit()
        return [c for c in self._configs if self._predicted(c) <= limit]

    def _unknown(self) -> list[Config]:
        """Those whose errors are still to be measured."""
        return [c for c in self.configs if not self.pictures.knows(c)]

    def _predicted(self, config: Config) -> float:
        """Seconds of its frame: as timed, or from the tries where nothing is timed."""
        try:
            return self.times.cost(config).total
        except KeyError:
            return workload.config_seconds(config, self.costs)

    # --- estimate ---------------------------------------------------------------------

    @cached_property
    def costs(self) -> budget.Costs:
        """Costs of the scene's whole frame: its tries, and guesses for x2 and more."""
        from xrds_blender import run_job

        model = budget.shipped()
        slowest = max(model.network_speed.values())
        scene = open_scene(self.shot.path, self.shot.window.whole)
        start = time.perf_counter()

        costs: budget.Costs = run_job(
            scene, lambda passes: measure(passes, model, start, Machine())
        )
        unit = costs.denoise[DEFAULT_DENOISING]
        networks = self.settings.sweep.networks
        return replace(
            costs,
            guide=GUIDE_SHARE * costs.beauty,
            network={n: unit * model.network_speed.get(n, slowest) for n in networks},
        )

    def estimate(self) -> float:
        """Predicted seconds of the work that is left."""
        part, window = workload.share(self.shot.window), self.shot.window
        seconds = [
            workload.render_seconds(request, self.costs, part)
            for request in self.pictures.missing(self._unknown())
        ]
        seconds += [
            workload.picture_seconds(config, self.costs, window)
            for config in self._unknown()
        ]
        if self.settings.timing:
            left = self._stopwatch.left(self.settings.rounds)
            seconds += [self._task_seconds(name) for name in left]
            seconds += [multiple * self.unit() for multiple in self._budgets_left()]
        return sum(seconds)

    def unit(self) -> float:
        """Seconds of 1 spp + OIDN with Blender's defaults: predicted, then measured."""
        try:
            return self.times.cost(DEFAULT).total
        except KeyError:
            return self.costs.seconds(
                RenderSettings(Mode.CYCLES_ONLY, 1, DEFAULT_DENOISING)
            )

    @property
    def megapixels(self) -> float:
        """Megapixels of the whole frame."""
        return self.shot.window.frame_width * self.shot.window.frame_height / 1e6

    def _task_seconds(self, name: str) -> float:
        request = self._stopwatch.renders.get(name)
        if request is not None:
            return workload.render_seconds(request, self.costs)
        if name == PLAIN_FRAME:
            return self.unit()
        whole = next((c for c in self._configs if c.label == name), None)
        if whole is not None:  # timed as a frame of its own
            return workload.config_seconds(whole, self.costs)
        return self.costs.beauty + 2.0  # a network, a baseline or a small frame

    # --- measuring --------------------------------------------------------------------

    @cached_property
    def _stopwatch(self) -> Stopwatch:
        chosen = self.settings
        # guides are timed even where there are no networks to need them
        guides = [anchor("guides", more=more) for more in (False, True)]
        requests = list(dict.fromkeys(anchors(self._configs) + guides))
        timed = tasks.tasks(self.shot, self._configs, chosen.networks)
        return Stopwatch(self.shot, self.times, requests, timed, chosen.journal)

    def measure(self, meter: Meter) -> None:
        """Time, render and compare whatever is missing."""
        if self.settings.timing:
            rounds = self.settings.rounds
            # All foreseen first: the costs' own tries must not render inside a render.
            seconds = {n: self._task_seconds(n) for n in self._stopwatch.left(rounds)}
            self._stopwatch.measure(
                rounds, lambda n: meter.done(seconds[n], f"{self.name}: {n}")
            )
            del self._stopwatch  # the denoisers that it timed hold gigabytes
        self._render(self._unknown(), meter)
        self._compare(meter)
        if self.settings.timing:
            for multiple in self._budgets_left():
                with self.settings.journal.attempt(f"{self.name}: budget {multiple:g}"):
                    self._pick(multiple, meter)
                meter.done(multiple * self.unit(), f"{self.name}: budget {multiple:g}")

    def _render(self, configs: list[Config], meter: Meter) -> None:
        part = workload.share(self.shot.window)
        seconds = {  # before anything is rendered, as in `measure`
            request: workload.render_seconds(request, self.costs, part)
            for request in self.pictures.missing(configs)
        }

        def done(request: Request) -> None:
            what = f"{self.name}: {request.kind}, {request.samples} spp"
            meter.done(seconds[request], what)

        # with rising samples one session of Cycles serves them all
        requests = sorted(seconds, key=lambda request: request.samples)
        self.pictures.render(requests, self.settings.journal, done)

    def _compare(self, meter: Meter) -> None:
        saved = time.perf_counter()
        for config in self._unknown():
            what = f"{self.name}: {config.label}"
            with self.settings.journal.attempt(what):
                self.pictures.errors(config)
            window = self.shot.window
            meter.done(workload.picture_seconds(config, self.costs, window), what)
            if time.perf_counter() - saved > 10:
                self.pictures.save()
                saved = time.perf_counter()
        self.pictures.save()

    # --- the picker -------------------------------------------------------------------

    @property
    def picks(self) -> dict[str, Any]:
        """What the picker did at each budget, by the budget's multiple."""
        if not self._picks_file.is_file():
            return {}
        return dict(read_json(self._picks_file))

    def _budgets_left(self) -> list[float]:
        done = self.picks if self.settings.picker else {}
        wanted = self.settings.budgets if self.settings.picker else ()
        return [multiple for multiple in wanted if f"{multiple:g}" not in done]

    def _pick(self, multiple: float, meter: Meter) -> None:
        """Render a whole frame within a budget; measure its error on the window."""
        seconds = multiple * self.unit()
        networks = self.settings.networks
        job = render_request(
            time_budget=seconds, device=networks.device, weights=networks.weights
        )
        picture, run = tasks.frame(self.shot, job)
        assert picture.settings is not None
        chosen = picture.settings
        config = Config("full_size", chosen.samples or 0, chosen.denoising)
        record = {
            "budget": seconds,
            "seconds": picture.seconds | {"total": run["seconds"]},
            "peak_memory": run["peak"],
            "settings": asdict(config),
            "label": config.label,
            "reason": picture.plan[0].reason,
        }
        del picture
        self._render([config], meter)
        record |= self.pictures.errors(config)
        write_json(self._picks_file, self.picks | {f"{multiple:g}": record})

    # --- results ----------------------------------------------------------------------

    def points(self) -> list[Point]:
        """Every configuration whose seconds and error are known."""
        points = []
        for config in self.configs:
            if not self.pictures.knows(config):
                continue
            point: Point = {
                "scene": self.name,
                "method": config.method,
                "settings": describe(config),
                "label": config.label,
            }
            if self.settings.timing:
                try:
                    cost = self.times.cost(config)
                except KeyError:  # a stage failed; it is among the failures
                    continue
                point |= {
                    "seconds": cost.seconds,
                    "cpu_seconds": cost.cpu_seconds,
                    "peak_memory": cost.peak_memory,
                }
            points.append(point | self.pictures.errors(config))
        return points

    def summary(self) -> dict[str, Any]:
        """The scene's entry under `scenes`."""
        window = self.shot.window
        entry: dict[str, Any] = {
            "scene": self.name,
            "frame": [window.frame_width, window.frame_height],
            "window": [window.x, window.y, window.width, window.height],
            "reference": _named(self.shot, self.settings.reference_samples),
            "reference_psnr_floor": self.pictures.floor(),
        }
        return entry | self._timed() if self.settings.timing else entry

    def _timed(self) -> dict[str, Any]:
        """The timed part of the entry; empty where a stage that it needs failed."""
        try:
            beauty, guide = (self.times.line(k)[1] for k in ("plain", "guides"))
            modes = {mode: self.times.denoising(mode) for mode in DENOISERS}
            check = {
                "composed": self.times.cost(DEFAULT).total,
                "whole": self.times.median(PLAIN_FRAME),
            }
        except KeyError:
            return {}
        return {
            "default_seconds": self.unit(),
            "seconds_per_sample": beauty,
            "seconds_per_guide_sample": guide,
            "rho": guide / beauty,
            "denoise_seconds": modes,
            "check": check,
            "network_load_seconds": self._loads(),
            "stages": self.times.runs,
        }

    def _loads(self) -> dict[str, float]:
        """Seconds that loading each network's weights takes the first time."""
        return {
            name: max(run.get("load") or 0.0 for run in runs)
            for name, runs in self.times.runs.items()
            if name.startswith("XRDS")
        }


def _named(shot: Shot, samples: int) -> str:
    if shot.reference is not None:
        return shot.reference.name
    return f"mean of two renders of {samples} samples, OIDN"
