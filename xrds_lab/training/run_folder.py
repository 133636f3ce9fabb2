"""The folder of one run: its configuration, its figures and its weights.

`config.toml` begins the run anew; `checkpoint.pt` lets it go on; `stats.jsonl` has a
line for each validation, drawn in `curve.png`; `samples.png` shows some windows;
`weights.safetensors` are the best so far.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import torch

from xrds_core.errors import UsageError, XRDSError
from xrds_core.files import read_json, replacing

from .checkpoint import read_checkpoint, write_checkpoint
from .config import TrainingConfig, read_config, to_toml
from .windows import Files, WindowSet, array_names, find_windows, paths_of

SPLITS = ("train", "validation")
# What may change while a run goes on: its losses stay what they would have been, but
# for `steps`, by which a user makes it longer.
FREE = {
    "data",
    "start",
    "steps",
    "validate_every",
    "validation_windows",
    "workers",
    "cache_gigabytes",
}


def find_files(config: TrainingConfig) -> dict[str, Files]:
    """The window files that a run can use, by split and folder."""
    low, high = array_names(config.scale)
    folders = [Path(folder) for folder in config.data]
    return {split: find_windows(folders, split, low + high) for split in SPLITS}


class RunFolder:
    """The files of a run, each written whole or not at all."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.config = path / "config.toml"
        self.files = path / "windows.json"
        self.stats = path / "stats.jsonl"
        self.curve = path / "curve.png"
        self.samples = path / "samples.png"
        self.weights = path / "weights.safetensors"
        self.checkpoint = path / "checkpoint.pt"

    def begin(self, config: TrainingConfig) -> None:
        """Make the folder; write the configuration and which windows there are.

        Raises:
            UsageError: it holds a run of another configuration, or there are no
                windows; nothing is written then.
        """
        if self.config.exists():
            self._compare(read_config(self.config), config)
        files = None if self.files.exists() else find_files(config)
        self.path.mkdir(parents=True, exist_ok=True)
        with replacing(self.config) as part:
            part.write_text(to_toml(config))
        if files:
            with replacing(self.files) as part:
                part.write_text(json.dumps(files))

    def _compare(self, kept: TrainingConfig, wanted: TrainingConfig) -> None:
        for name, value in vars(kept).items():
            if name not in FREE and value != getattr(wanted, name):
                raise UsageError(
                    f"{self.path} holds a run with {name} = {value!r}, not "
                    f"{getattr(wanted, name)!r}: give another folder with --out, and "
                    f"start = {str(self.weights)!r} to go on from its weights"
                )

    def open_windows(self, config: TrainingConfig) -> dict[str, WindowSet]:
        """The run's windows, by split."""
        files = read_json(self.files)
        folders = [Path(folder) for folder in config.data]
        memory = config.cache_gigabytes * 1e9 / (config.workers + 1)
        return {
            split: WindowSet(
                paths_of(folders, split, files[split]), config.scale, memory
            )
            for split in SPLITS
        }

    def records(self) -> list[dict[str, Any]]:
        """The lines of the statistics."""
        if not self.stats.exists():
            return []
        lines = self.stats.read_text("utf-8").splitlines()
        try:
            return [json.loads(line) for line in lines]
        except ValueError as error:
            raise XRDSError(
                f"{self.stats} is damaged ({error}); remove {self.path} to begin anew"
            ) from error

    def write_records(self, records: list[dict[str, Any]]) -> None:
        """Replace the statistics."""
        with replacing(self.stats) as part:
            part.write_text("".join(json.dumps(line) + "\n" for line in records))

    def save(self, state: dict[str, Any]) -> None:
        """Write the checkpoint."""
        write_checkpoint(self.checkpoint, state)

    def load(self, device: torch.device) -> dict[str, Any] | None:
        """Read the checkpoint, if there is one; WeightsError if it is damaged."""
        if not self.checkpoint.exists():
            return None
        return read_checkpoint(self.checkpoint, device)
