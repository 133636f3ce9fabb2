"""The training loop: crops in, averaged weights, statistics and checkpoints out.

Every random choice of a step follows from (seed, step) alone and a checkpoint holds all
the rest, so a resumed run gives the same losses as one that was never interrupted.
"""

from __future__ import annotations

import json
import math
import time
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from tqdm import tqdm

from .. import weights
from ..atomic import replacing
from ..network import XRDS, preset_config
from .config import TrainingConfig
from .data import Batch, draw
from .losses import weighted
from .validation import Scores, validate
from .windows import WindowSet, array_names, find_windows, paths_of

CHECKPOINT = "checkpoint.pt"
WINDOWS = "windows.json"
SPLITS = ("train", "validation")


class Trainer:
    """One run in its folder; `run` goes on from the last checkpoint there."""

    def __init__(self, config: TrainingConfig, folder: Path) -> None:
        self.config, self.folder = config, folder
        folder.mkdir(parents=True, exist_ok=True)
        self.device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
        torch.manual_seed(config.seed)
        shape = preset_config(config.preset, config.scale, config.guides)
        self.network = XRDS(replace(shape, **config.network)).to(self.device)
        if config.start:
            start_from(self.network, Path(config.start))
        self.average = {k: v.clone() for k, v in self.network.state_dict().items()}
        self.optimizer = torch.optim.Adam(
            self.network.parameters(), config.learning_rate, config.betas
        )
        self.step = 0
        self.best = -math.inf
        self.windows = self.find_windows()

    # --- data -------------------------------------------------------------------------

    def find_windows(self) -> dict[str, WindowSet]:
        """The windows of this run: those that lay there when it began."""
        c = self.config
        kept, folders = self.folder / WINDOWS, [Path(folder) for folder in c.data]
        noisy = c.variation.noisy > 0
        if not kept.exists():
            low, high = array_names(c.scale, c.guides, noisy)
            found = {s: find_windows(folders, s, low + high) for s in SPLITS}
            with replacing(kept) as part:
                part.write_text(json.dumps(found))
        files = json.loads(kept.read_text())
        memory = c.cache_gigabytes * 1e9
        return {
            split: WindowSet(
                paths_of(folders, split, files[split]), c.scale, c.guides, noisy, memory
            )
            for split in SPLITS
        }

    def training_batch(self) -> Batch:
        """The crops of this step; each follows from (seed, step, place) alone."""
        c = self.config
        return Batch.stack([self.training_crop(place) for place in range(c.batch)])

    def training_crop(self, place: int) -> Batch:
        c, windows = self.config, self.windows["train"]
        random = np.random.default_rng((c.seed, self.step, place))
        window = windows[int(random.integers(len(windows)))]
        return draw(window, c.scale, c.guides, c.variation, random, c.crop)

    # --- steps ------------------------------------------------------------------------

    def learning_rate(self) -> float:
        c = self.config
        if self.step < c.warmup:
            return c.learning_rate * (self.step + 1) / c.warmup
        done = (self.step - c.warmup) / max(1, c.steps - c.warmup)
        span = c.learning_rate - c.final_learning_rate
        return c.final_learning_rate + span * (1 + math.cos(math.pi * done)) / 2

    def forward(self, batch: Batch) -> Tensor:
        bf16 = self.config.precision == "bf16"
        with torch.autocast(self.device.type, torch.bfloat16, enabled=bf16):
            inputs = batch.radiance.to(self.device), batch.guides.to(self.device)
            return self.network(*inputs).float()

    def train_step(self) -> float:
        """One step of Adam; returns the loss."""
        for group in self.optimizer.param_groups:
            group["lr"] = self.learning_rate()
        batch = self.training_batch()
        output = self.forward(batch)
        loss = weighted(self.config.loss, output, batch.reference.to(self.device))
        self.optimizer.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(
            self.network.parameters(), self.config.clip_gradient
        )
        self.optimizer.step()
        self.step += 1
        decay = min(self.config.average, self.step / (self.step + 10))
        for name, value in self.network.state_dict().items():
            self.average[name].lerp_(value, 1 - decay)
        return loss.item()

    def validate(self) -> Scores:
        """Score the averaged weights."""
        trained = {k: v.clone() for k, v in self.network.state_dict().items()}
        self.network.load_state_dict(self.average)
        c, windows = self.config, self.windows["validation"]
        scores = validate(
            self.forward, windows, c.validation_windows, c.scale, c.guides
        )
        self.network.load_state_dict(trained)
        return scores

    # --- the run ----------------------------------------------------------------------

    def run(self) -> dict[str, Any]:
        """Train to the last step and return the last validation."""
        self.resume()
        progress = tqdm(total=self.config.steps, initial=self.step, unit="step")
        losses: list[float] = []
        began = time.perf_counter()
        told: dict[str, Any] = {}
        try:
            while self.step < self.config.steps:
                losses.append(self.train_step())
                progress.update()
                last = self.step == self.config.steps
                if self.step % self.config.validate_every == 0 or last:
                    scores = self.validate()
                    seconds = (time.perf_counter() - began) / len(losses)
                    self.record(float(np.mean(losses)), seconds, scores)
                    told = {"gain": scores.gain(), "psnr": scores.means()}
                    progress.set_postfix(gain=told["gain"], **told["psnr"]["rendered"])
                    losses, began = [], time.perf_counter()
        except KeyboardInterrupt:
            self.save_checkpoint()
            raise
        finally:
            progress.close()
        return {"step": self.step, **told}

    def record(self, loss: float, seconds: float, scores: Scores) -> None:
        """Write the statistics line, the checkpoint and, where it is best, weights."""
        line = {
            "step": self.step,
            "loss": loss,
            "learning_rate": self.learning_rate(),
            "seconds_per_step": seconds,
            "gain": scores.gain(),
            "psnr": scores.means(),
        }
        with (self.folder / "stats.jsonl").open("a") as stats:
            stats.write(json.dumps(line) + "\n")
        if scores.gain() > self.best:
            self.best = scores.gain()
            self.save_weights(scores)
        self.save_checkpoint()

    def save_weights(self, scores: Scores) -> None:
        """Write the averaged weights with what they were trained on."""
        network = XRDS(self.network.config)
        network.load_state_dict({k: v.cpu() for k, v in self.average.items()})
        series = self.windows["train"][0].meta["blender_series"]
        record = {
            "preset": self.config.preset,
            "blender_series": series,
            "training": json.dumps(
                {
                    "step": self.step,
                    "windows": len(self.windows["train"]),
                    "validation_gain": scores.gain(),
                    "validation_psnr": scores.means(),
                    "config": asdict(replace(self.config, data=(), start="")),
                }
            ),
        }
        weights.save(network, self.folder / "weights.safetensors", record)

    def save_checkpoint(self) -> None:
        state = {
            "step": self.step,
            "best": self.best,
            "network": self.network.state_dict(),
            "average": self.average,
            "optimizer": self.optimizer.state_dict(),
        }
        with replacing(self.folder / CHECKPOINT) as part:
            torch.save(state, part)

    def resume(self) -> None:
        """Go back to the checkpoint in the folder, if there is one."""
        path = self.folder / CHECKPOINT
        if not path.exists():
            return
        state = torch.load(path, map_location=self.device, weights_only=True)
        self.step, self.best = state["step"], state["best"]
        self.network.load_state_dict(state["network"])
        self.average = state["average"]
        self.optimizer.load_state_dict(state["optimizer"])


def start_from(network: XRDS, path: Path) -> None:
    """Copy every tensor whose name and shape agree from a weights file."""
    source = weights.load(path)[0].state_dict()
    own = network.state_dict()
    own |= {k: v for k, v in source.items() if k in own and v.shape == own[k].shape}
    network.load_state_dict(own)


def train(config: TrainingConfig, folder: Path) -> dict[str, Any]:
    """Run or resume the training of `config` in `folder`."""
    return Trainer(config, folder).run()
