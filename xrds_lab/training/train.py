"""A training run: crops in, statistics, checkpoints and weights out.

Every random choice follows from (seed, step, place in the batch) alone and a checkpoint
holds all the rest, so a resumed run gives the same losses as one that was never
interrupted, and several processes give those of one.
"""

from __future__ import annotations

import json
import math
import time
from dataclasses import asdict, dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from xrds_core.errors import Cancelled, WeightsError

from .checkpoint import taking_over
from .config import TrainingConfig
from .crop import Batch
from .data import draw
from .figures import write_curve, write_samples
from .interruption import Interruption
from .learner import Learner
from .loader import CropLoader
from .processes import Processes
from .run_folder import RunFolder
from .validation import Validation, in_order, summary
from .windows import WindowSet

MOST_PADDED = 0.25  # of a crop's side


@dataclass(frozen=True)
class Crops:
    """Draws the crops of a run: each follows from the seed, the step and its place."""

    config: TrainingConfig
    windows: WindowSet

    def __call__(self, step: int, place: int) -> Batch:
        """One crop of a batch."""
        c = self.config
        random = np.random.default_rng((c.seed, step, place))
        window = self.windows[int(random.integers(len(self.windows)))]
        size = crop_size(c, step)
        return draw(window, c.scale, c.variation, random, size)


class Run:
    """One run in its folder; `go` goes on from the last checkpoint there."""

    def __init__(self, config: TrainingConfig, folder: Path) -> None:
        self.config, self.folder = config, RunFolder(folder)
        self.processes = Processes.join()
        places = self.processes.places(config.batch)
        self.learner = Learner(config, self.processes)
        state = self.folder.load(self.learner.device)
        if config.start and not state:
            self.learner.start_from(Path(config.start))
        if self.processes.lead:
            self.folder.begin(config)
        self.processes.gather(None)  # the others wait for the files
        self.windows = self.folder.open_windows(config)
        crops = Crops(config, self.windows["train"])
        self.loader = CropLoader(crops, places, config.workers)
        shown = config.validation_windows, config.scale
        self.validation = Validation(self.windows["validation"], *shown)
        self.step, self.validated = 0, -1
        self.best, self.best_step = -math.inf, 0
        self.losses: list[float] = []  # since the last validation
        self.seconds = 0.0  # of these steps
        self.records: list[dict[str, Any]] = []
        if state:
            with taking_over(self.folder.checkpoint):
                self.resume(state)

    # --- steps ------------------------------------------------------------------------

    def train_step(self, stop: Interruption | None = None) -> bool:
        """Learn from one batch; returns whether any process wishes to stop."""
        began = time.perf_counter()
        loss = self.learner.learn(self.loader.batch(self.step), self.step)
        wish = stop is not None and stop.wished
        loss, wished = self.processes.mean([loss, float(wish)])
        if not math.isfinite(loss):
            raise WeightsError(
                f"the loss of step {self.step} is {loss}: training has diverged; "
                "start anew with a lower learning_rate"
            )
        self.step += 1
        self.losses.append(loss)
        self.seconds += time.perf_counter() - began
        return wished > 0

    # --- validation -------------------------------------------------------------------

    def due(self) -> bool:
        """Whether validation is: at the start, from time to time, at the end."""
        c = self.config
        now = self.step % c.validate_every == 0 or self.step == c.steps
        return now and self.validated != self.step

    def validate(self, stop: Interruption) -> None:
        """Score the averaged weights; write the statistics, and weights if best.

        Raises:
            Cancelled: the user wishes to stop; the checkpoint is of before.
        """
        self.save()
        validation, processes = self.validation, self.processes
        forward, scores = self.learner.forward, []
        with self.learner.averaged():
            mine = validation.places[processes.rank :: processes.count]
            for place in self.bar(mine, desc="validation", leave=False):
                if stop.wished:
                    raise self.cancelled()
                scores.append(validation.score(forward, *place))
            shown = validation.samples(forward) if processes.lead else []
        everyones = chain.from_iterable(processes.gather(scores))
        self.record(summary(in_order(everyones)))
        if processes.lead:
            write_curve(self.records, self.folder.curve)
            write_samples(shown, self.folder.samples)
        self.save()

    def record(self, figures: dict[str, Any]) -> None:
        """Add a line to the statistics; keep the weights if they are the best."""
        steps = len(self.losses)
        line = {
            "step": self.step,
            "loss": float(np.mean(self.losses)) if steps else None,
            "learning_rate": self.config.learning_rate_at(self.step),
            "seconds_per_step": self.seconds / steps if steps else None,
            **figures,
        }
        self.records.append(line)
        self.losses, self.seconds, self.validated = [], 0.0, self.step
        better = line["gain"] > self.best
        if better:
            self.best, self.best_step = line["gain"], self.step
        if self.processes.lead:
            self.folder.write_records(self.records)
            if better:
                self.save_weights(figures)

    def save_weights(self, figures: dict[str, Any]) -> None:
        """Write the averaged weights with what they were trained on."""
        training = {
            "step": self.step,
            "windows": {split: len(some) for split, some in self.windows.items()},
            "validation": figures,
            "config": asdict(replace(self.config, data=(), start="")),
        }
        record = {
            "preset": self.config.preset,
            "blender_series": self.windows["train"][0].meta["blender_series"],
            "training": json.dumps(training),
        }
        self.learner.save_average(self.folder.weights, record)

    # --- the run ----------------------------------------------------------------------

    def go(self) -> dict[str, Any] | None:
        """Train to the last step; the lead returns the last statistics and the best.

        Raises:
            Cancelled: Ctrl-C; the same call goes on from there.
            WeightsError: the loss is no longer finite.
        """
        bar = self.bar(total=self.config.steps, initial=self.step, unit="step")
        try:
            with bar, Interruption() as stop:
                self.go_on(bar, stop)
        finally:
            self.loader.close()
            self.processes.leave()
        if not self.processes.lead:
            return None
        best = {"step": self.best_step, "gain": self.best}
        return {"out": str(self.folder.path), **self.records[-1], "best": best}

    def go_on(self, bar: tqdm, stop: Interruption) -> None:
        """Train, validate and save until the last step."""
        if self.due():
            self.validate(stop)
        while self.step < self.config.steps:
            wished = self.train_step(stop)
            bar.update()
            if self.due() and not wished:
                self.validate(stop)
                bar.set_postfix(gain=f"{self.records[-1]['gain']:.2f} dB")
            if wished:
                self.save()
                raise self.cancelled()

    def bar(self, *things: Any, **settings: Any) -> tqdm:
        """A progress bar, of the lead alone."""
        return tqdm(*things, **settings, disable=not self.processes.lead)

    def cancelled(self) -> Cancelled:
        return Cancelled(f"interrupted at step {self.step}; the same command goes on")

    def save(self) -> None:
        """Write the checkpoint."""
        state = {name: getattr(self, name) for name in KEPT}
        if self.processes.lead:
            self.folder.save({**state, **self.learner.state()})

    def resume(self, state: dict[str, Any]) -> None:
        """Go back to a checkpoint."""
        self.learner.restore(state)
        for name in KEPT:
            setattr(self, name, state[name])
        lines = self.folder.records()
        self.records = [line for line in lines if line["step"] <= self.validated]


KEPT = ("step", "validated", "best", "best_step", "losses", "seconds")
"""What a checkpoint holds beside the learner's state."""


def crop_size(config: TrainingConfig, step: int) -> int:
    """Side of the crops of a step, in output pixels: the same for the whole batch."""
    random = np.random.default_rng((config.seed, step))
    if random.random() >= config.variation.padded:
        return config.crop
    most = int(MOST_PADDED * config.crop) // config.scale
    return config.crop - config.scale * int(random.integers(1, most, endpoint=True))


def train(config: TrainingConfig, folder: Path) -> dict[str, Any] | None:
    """Run or resume the training of `config` in `folder`."""
    return Run(config, folder).go()
