"""The training loop: crops in, averaged weights, statistics and checkpoints out.

Every random choice of a step follows from (seed, step) alone and a checkpoint holds all
the rest, so a resumed run gives the same losses as one that was never interrupted.
"""

from __future__ import annotations

import json
import math
import time
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from tqdm import tqdm

from .. import weights
from ..atomic import replacing
from ..errors import UsageError
from ..front_end import ALBEDO_EPSILON, area_mean, inverse_transfer, upsample_bilinear
from ..metrics import psnr, to_srgb
from ..network import XRDS, preset_config
from .config import TrainingConfig
from .data import Batch, Variation, Window, draw, read_window
from .losses import weighted

CHECKPOINT = "checkpoint.pt"
WINDOWS = "windows.json"


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
        self.files = self.choose_files()
        self.windows: OrderedDict[str, Window] = OrderedDict()

    # --- data -------------------------------------------------------------------------

    def choose_files(self) -> dict[str, list[str]]:
        """The windows of this run: those that lay there when it began."""
        kept = self.folder / WINDOWS
        if kept.exists():
            return json.loads(kept.read_text())
        data = Path(self.config.data)
        files = {
            split: sorted(p.name for p in (data / split).glob("*.npz"))
            for split in ("train", "validation")
        }
        for split, names in files.items():
            if not names:
                raise UsageError(f"no windows in {data / split}; run `xrds dataset`")
        with replacing(kept) as part:
            part.write_text(json.dumps(files))
        return files

    def window(self, split: str, name: str) -> Window:
        if name not in self.windows:
            path = Path(self.config.data) / split / name
            self.windows[name] = read_window(
                path, self.config.scale, self.config.guides
            )
        return self.windows[name]

    def training_batch(self) -> Batch:
        config = self.config
        random = np.random.default_rng((config.seed, self.step))
        names = random.choice(self.files["train"], config.batch)
        crops = [
            draw(
                self.window("train", name),
                config.scale,
                config.guides,
                config.variation,
                random,
                config.crop,
            )
            for name in names
        ]
        return Batch.stack(crops)

    def validation_batches(self) -> Iterator[Batch]:
        """Whole windows as they are, spread over the split, the same ones each time."""
        names = self.files["validation"]
        count = min(self.config.validation_windows, len(names))
        for i in range(count):
            window = self.window("validation", names[i * len(names) // count])
            random = np.random.default_rng(i)
            yield draw(
                window, self.config.scale, self.config.guides, Variation(), random
            )

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

    def validate(self) -> dict[str, float]:
        """Mean PSNR in dB of the averaged weights and of plain enlargements."""
        trained = {k: v.clone() for k, v in self.network.state_dict().items()}
        self.network.load_state_dict(self.average)
        methods = {"xrds": self.forward, "bicubic": bicubic, "demodulated": demodulated}
        scores: dict[str, list[float]] = {name: [] for name in methods}
        with torch.inference_mode():
            for batch in self.validation_batches():
                reference = displayed(batch.reference)
                for name, method in methods.items():
                    picture = displayed(method(batch).cpu())
                    scores[name].append(psnr(picture, reference))
        self.network.load_state_dict(trained)
        return {name: float(np.mean(values)) for name, values in scores.items()}

    # --- the run ----------------------------------------------------------------------

    def run(self) -> dict[str, Any]:
        """Train to the last step and return the last validation."""
        self.resume()
        progress = tqdm(total=self.config.steps, initial=self.step, unit="step")
        losses: list[float] = []
        began = time.perf_counter()
        scores: dict[str, Any] = {}
        try:
            while self.step < self.config.steps:
                losses.append(self.train_step())
                progress.update()
                last = self.step == self.config.steps
                if self.step % self.config.validate_every == 0 or last:
                    scores = self.validate()
                    seconds = (time.perf_counter() - began) / len(losses)
                    self.record(float(np.mean(losses)), seconds, scores)
                    progress.set_postfix(scores)
                    losses, began = [], time.perf_counter()
        except KeyboardInterrupt:
            self.save_checkpoint()
            raise
        finally:
            progress.close()
        return {"step": self.step, **scores}

    def record(self, loss: float, seconds: float, scores: dict[str, float]) -> None:
        """Write the statistics line, the checkpoint and, where it is best, weights."""
        line = {
            "step": self.step,
            "loss": loss,
            "learning_rate": self.learning_rate(),
            "seconds_per_step": seconds,
            "psnr": scores,
        }
        with (self.folder / "stats.jsonl").open("a") as stats:
            stats.write(json.dumps(line) + "\n")
        if scores["xrds"] > self.best:
            self.best = scores["xrds"]
            self.save_weights(scores)
        self.save_checkpoint()

    def save_weights(self, scores: dict[str, float]) -> None:
        """Write the averaged weights with what they were trained on."""
        network = XRDS(self.network.config)
        network.load_state_dict({k: v.cpu() for k, v in self.average.items()})
        series = self.window("train", self.files["train"][0]).meta["blender_series"]
        record = {
            "preset": self.config.preset,
            "blender_series": series,
            "training": json.dumps(
                {
                    "step": self.step,
                    "windows": len(self.files["train"]),
                    "validation_psnr": scores,
                    "config": asdict(replace(self.config, data="", start="")),
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


def bicubic(batch: Batch) -> Tensor:
    """Plain interpolation of the radiance, in the transfer domain."""
    size = batch.reference.shape[-2:]
    return torch.nn.functional.interpolate(batch.radiance, size=size, mode="bicubic")


def demodulated(batch: Batch) -> Tensor:
    """Bilinear interpolation of the radiance over the albedo, then times the albedo."""
    scale = batch.reference.shape[-1] // batch.radiance.shape[-1]
    albedo = batch.guides[:, :3] + ALBEDO_EPSILON
    lighting = torch.expm1(batch.radiance) / area_mean(albedo, scale)
    return torch.log1p(upsample_bilinear(lighting, scale) * albedo)


def displayed(t: Tensor) -> np.ndarray:
    """(1, 3, H, W) in the transfer domain to sRGB at the picture's own exposure."""
    return to_srgb(inverse_transfer(t.float(), 1.0)[0].permute(1, 2, 0).numpy())


def train(config: TrainingConfig, folder: Path) -> dict[str, Any]:
    """Run or resume the training of `config` in `folder`."""
    return Trainer(config, folder).run()
