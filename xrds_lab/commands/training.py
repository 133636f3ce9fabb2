"""The commands that make training sets and train."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from xrds_blender.command import arguments
from xrds_blender.command.console import lines_of, need_blender


def _dataset(options: argparse.Namespace) -> dict[str, Any]:
    need_blender("dataset")
    from ..studio import datasheet
    from ..studio.dataset import generate

    written = generate(
        options.out,
        seed=options.seed,
        count=options.count,
        assets=options.assets,
        scales=options.scales,
    )
    windows = datasheet.files(options.out)
    if options.contact is not None:
        datasheet.contact_sheet(windows, options.contact)
    result = {"out": str(options.out), "written": written}
    return result | datasheet.datasheet(windows)


def _train(options: argparse.Namespace) -> dict[str, Any] | None:
    from ..training.config import read_config
    from ..training.train import train

    folder = options.out or Path("runs") / options.config.stem
    return train(read_config(options.config, options.changes), folder)


def _train_lines(result: dict[str, Any]) -> list[str]:
    best = result["best"]
    return [
        f"{result['out']}: {result['step']} steps, weights of step {best['step']} are "
        f"{best['gain']:+.2f} dB on the better of bicubic and demodulated"
    ]


def add_dataset(commands: Any) -> argparse.ArgumentParser:
    """Add `xrds dataset`."""
    command = commands.add_parser("dataset", help="render a training set")
    add = command.add_argument
    add("-o", "--out", type=arguments.folder, required=True)
    add("--seed", type=arguments.whole, default=0, help="first scene's seed")
    add("--count", type=arguments.positive, default=1, help="number of scenes")
    add("--assets", type=Path, help="folder of models, textures and skies")
    add("--scales", type=arguments.integers, default=(2, 4, 8), help="as 2,4,8")
    add("--contact", type=Path, metavar="FILE.jpg", help="a look at the windows")
    command.set_defaults(work=_dataset, lines=lines_of("xrds_lab.studio.datasheet"))
    return command


def add_train(commands: Any) -> argparse.ArgumentParser:
    """Add `xrds train`."""
    command = commands.add_parser("train", help="train or resume a network")
    command.add_argument("config", type=Path, metavar="CONFIG.toml")
    command.add_argument(
        "-o", "--out", type=arguments.folder, metavar="RUN", help="runs/CONFIG"
    )
    _add_changes(command)
    command.set_defaults(work=_train, lines=_train_lines)
    return command


def _add_changes(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--set",
        action="append",
        default=[],
        dest="changes",
        metavar="KEY=VALUE",
        help="in the place of the file's, as scale=8 or 'start=\"a.safetensors\"'",
    )
