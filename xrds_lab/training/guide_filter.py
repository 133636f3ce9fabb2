"""Training the filter of guides of few samples, on pairs of noisy renders.

A window was rendered twice with different seeds. One render is filtered, the other is
what it is held against: the mean over many pairs is the same as if that one had no
noise (Lehtinen et al., "Noise2Noise", 2018). So no clean guides are needed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from tqdm import tqdm

from xrds_core.errors import Cancelled, UsageError, WeightsError
from xrds_core.superres.devices import choose_device
from xrds_core.superres.front_end import clean_albedo, clean_normal
from xrds_core.superres.guide_filter import FEW_SAMPLES, GuideFilter

from ..weights import save_guide_filter
from .checkpoint import read_checkpoint, taking_over, write_checkpoint
from .config import cosine
from .interruption import Interruption
from .windows import find_windows, paths_of, read_arrays

RENDERS = ("guides_a", "guides_b")
STEPS = 10_000
BATCH, CROP = 8, 64
LEARNING_RATE, FINAL_LEARNING_RATE = 2e-3, 1e-5
ALBEDO_FLOOR = 0.1  # squared errors of albedo are relative to it, above this
LARGEST_GRADIENT = 1.0
KEEP_EVERY = 500  # steps


@dataclass(frozen=True)
class Pair:
    """Two renders of one window, (2, 6, H, W), and the samples of each."""

    guides: Tensor
    samples: tuple[int, int]
    blender_series: str


def train_guide_filter(
    data: Sequence[Path], out: Path, *, steps: int = STEPS, seed: int = 0
) -> dict[str, Any]:
    """Train on folders of `xrds dataset` and write the filter to the file `out`.

    Beside it lies a checkpoint until it is done, from which the same call goes on.
    Returns what is left of the noise of validation windows: see `error_left`.

    Raises:
        UsageError: there are no windows, or `out` is no place for a file.
        PictureError: a window is damaged.
        Cancelled: the user wishes to stop.
        WeightsError: the training has diverged.
    """
    if not out.parent.is_dir() or out.is_dir():
        raise UsageError(f"cannot write {out}: give a file in a folder that exists")
    pairs = {split: read_pairs(data, split) for split in ("train", "validation")}
    learner = Learner(steps, seed, out.with_suffix(".checkpoint.pt"))
    learner.learn(pairs["train"])
    left = error_left(learner.network.cpu(), pairs["validation"])
    record = {"blender_series": pairs["train"][0].blender_series}
    save_guide_filter(learner.network, out, record)
    learner.checkpoint.unlink(missing_ok=True)
    counts = {split: len(some) for split, some in pairs.items()}
    return {"out": str(out), "steps": steps, "windows": counts, "error_left": left}


def read_pairs(folders: Sequence[Path], split: str) -> list[Pair]:
    """All windows of a split."""
    files = find_windows(folders, split, RENDERS)
    return [read_pair(path) for path in paths_of(folders, split, files)]


def read_pair(path: Path) -> Pair:
    """One window; its values as the product cleans them."""
    arrays, meta = read_arrays(path, RENDERS, "pairs of guides")
    renders = []
    for name in RENDERS:
        albedo, normal = np.split(arrays[name].astype(np.float32), 2, axis=-1)
        clean = clean_albedo(albedo)[0], clean_normal(normal)[0]
        renders.append(np.concatenate(clean, axis=-1).transpose(2, 0, 1))
    first, second = meta["guide_spp"]
    series = str(meta["blender_series"])
    return Pair(torch.from_numpy(np.stack(renders)), (first, second), series)


class Learner:
    """The filter as it learns; goes on from its checkpoint if there is one."""

    def __init__(self, steps: int, seed: int, checkpoint: Path) -> None:
        self.steps, self.seed, self.checkpoint = steps, seed, checkpoint
        self.device = choose_device("auto")
        torch.manual_seed(seed)
        self.network = GuideFilter().to(self.device)
        self.optimizer = torch.optim.Adam(self.network.parameters(), LEARNING_RATE)
        self.step = 0
        if checkpoint.exists():
            self.resume()

    def learn(self, pairs: Sequence[Pair]) -> None:
        """Train for the steps that are left."""
        bar = tqdm(total=self.steps, initial=self.step, unit="step")
        with bar, Interruption() as stop:
            while self.step < self.steps:
                loss = self.learn_from(self.batch(pairs))
                if not math.isfinite(loss):
                    raise WeightsError(
                        f"the loss of step {self.step} is {loss}: training has "
                        f"diverged; remove {self.checkpoint} and begin anew"
                    )
                self.step += 1
                bar.update()
                if stop.wished or self.step % KEEP_EVERY == 0:
                    self.keep()
                if stop.wished and self.step < self.steps:
                    raise Cancelled(
                        f"interrupted at step {self.step}; the same command goes on"
                    )

    def batch(self, pairs: Sequence[Pair]) -> tuple[Tensor, Tensor, Tensor]:
        """What is filtered, what it is held against (B, 6, h, w), and its samples."""
        crops = [self.crop(pairs, place) for place in range(BATCH)]
        guides = torch.stack([crop for crop, _ in crops]).to(self.device)
        samples = torch.tensor([float(n) for _, n in crops], device=self.device)
        return guides[:, 0], guides[:, 1], samples

    def crop(self, pairs: Sequence[Pair], place: int) -> tuple[Tensor, int]:
        """One varied crop (2, 6, h, w), and the samples of the second render."""
        random = np.random.default_rng((self.seed, self.step, place))
        pair = pairs[int(random.integers(len(pairs)))]
        guides, samples = pair.guides, pair.samples[1]
        if random.random() < 0.5:
            guides, samples = guides.flip(0), pair.samples[0]
        top, left = (int(random.integers(n - CROP + 1)) for n in guides.shape[-2:])
        guides = guides[..., top : top + CROP, left : left + CROP]
        for axis in (2, 3):
            guides = guides.flip(axis) if random.random() < 0.5 else guides
        guides = guides.transpose(2, 3) if random.random() < 0.5 else guides
        # colours and axes have no order, and normals may be of any space
        colours, axes = random.permutation(3), random.permutation(3) + 3
        guides = guides[:, [*colours, *axes]]
        signs = np.ones((6, 1, 1), np.float32)
        signs[3:, 0, 0] = random.choice([-1.0, 1.0], 3)
        return guides * torch.from_numpy(signs), samples

    def learn_from(self, batch: tuple[Tensor, Tensor, Tensor]) -> float:
        """Take one step; returns the loss before it."""
        guides, other, samples = batch
        for group in self.optimizer.param_groups:
            group["lr"] = self.learning_rate()
        # the fewer samples, the noisier the other render
        loss = (sum(errors(self.network(guides), other)) * samples).mean()
        self.optimizer.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), LARGEST_GRADIENT)
        self.optimizer.step()
        return float(loss.item())

    def learning_rate(self) -> float:
        """Learning rate of the next step: falls along a cosine."""
        return cosine(LEARNING_RATE, FINAL_LEARNING_RATE, self.step / self.steps)

    def keep(self) -> None:
        """Write the checkpoint."""
        state = {name: getattr(self, name).state_dict() for name in KEPT}
        state |= {"step": self.step, "seed": self.seed}
        write_checkpoint(self.checkpoint, state)

    def resume(self) -> None:
        """Go back to the checkpoint."""
        state = read_checkpoint(self.checkpoint, self.device)
        with taking_over(self.checkpoint):
            if state["seed"] != self.seed:
                raise UsageError(
                    f"{self.checkpoint} is of seed {state['seed']}: remove it, or give "
                    "that seed"
                )
            self.step = state["step"]
            for name in KEPT:
                getattr(self, name).load_state_dict(state[name])


KEPT = ("network", "optimizer")


def errors(filtered: Tensor, other: Tensor) -> tuple[Tensor, Tensor]:
    """Mean squared errors of albedo, relative to itself, and of normal: (B,) each."""
    squared = (filtered - other).square()
    albedo = squared[:, :3] / (filtered[:, :3].detach() + ALBEDO_FLOOR).square()
    return albedo.mean((1, 2, 3)), squared[:, 3:].mean((1, 2, 3))


def error_left(network: GuideFilter, pairs: Sequence[Pair]) -> dict[str, float]:
    """What filtering leaves of the squared error of renders of few samples.

    By guide, over all such renders of `pairs`; 1 where nothing is gained, or there are
    none. The other render's own noise, which follows from the samples of both, is left
    out. At full strength: the product keeps a part of the noise, and of the texture.
    """
    sums = np.zeros((2, 2))  # with and without the filter; albedo and normal
    for pair in pairs:
        for guides, other, noise in noisy_first(pair):
            with torch.inference_mode():
                errors = [(x - other).square() for x in (network(guides), guides)]
            values = [[float(y.mean()) for y in x.split(3, dim=1)] for x in errors]
            sums += np.array(values) - noise * np.array(values[1])
    parts = [float(s[0] / s[1]) if s[1] else 1.0 for s in sums.T]
    return dict(zip(("albedo", "normal"), parts, strict=True))


def noisy_first(pair: Pair) -> Iterator[tuple[Tensor, Tensor, float]]:
    """Each render of few samples, the other one, and its share of their difference."""
    total = sum(pair.samples)
    for i, own in enumerate(pair.samples):
        if own < FEW_SAMPLES:
            yield pair.guides[None, i], pair.guides[None, 1 - i], own / total


def lines(result: dict[str, Any]) -> list[str]:
    """The result as lines of text."""
    left = ", ".join(
        f"{part:.0%} of {name}" for name, part in result["error_left"].items()
    )
    return [f"{result['out']}: {result['steps']} steps; squared error left: {left}"]
