"""Equal results of several runs, threads and precisions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch

from .measured import Measured, smape
from .pictures import lit_surface

if TYPE_CHECKING:
    from collections.abc import Iterator

    from xrds_core.arrays import Array

    from .pictures import Inputs
    from .subject import Subject


def runs(subject: Subject) -> Iterator[Measured]:
    """Two runs give the same bytes; one thread gives the same as several."""
    inputs, _ = lit_surface(subject.side, subject.scale)
    first, second = (subject(inputs) for _ in range(2))
    yield Measured("same.runs", float((first != second).sum()))
    small, _ = lit_surface(subject.side // 2, subject.scale)
    one, several = (_with_threads(n, subject, small) for n in (1, 2))
    yield Measured("same.threads", float(np.abs(several - one).max() / one.max()))


def _with_threads(count: int, subject: Subject, inputs: Inputs) -> Array:
    threads = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        return subject(inputs)
    finally:
        torch.set_num_threads(threads)


def precisions(subject: Subject) -> Iterator[Measured]:
    """Fewer digits in the layers against fp32."""
    if subject.precision == "fp32":
        return
    inputs, _ = lit_surface(subject.side, subject.scale)
    expected, picture = subject.at("fp32")(inputs), subject(inputs)
    off = np.abs(picture - expected)
    yield Measured("precision.smape", smape(picture, expected))
    yield Measured(
        "precision.outliers", float(((off > 0.02) & (off > 0.05 * expected)).sum())
    )


CHECKS = (runs, precisions)
