"""Losses between pictures in the transfer domain."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

ROBUST_BETA = 0.1  # of the paper
CHARBONNIER_EPSILON = 0.03


def robust(output: Tensor, reference: Tensor) -> Tensor:
    """The paper's robust loss, mean of d / (beta + d) with d the absolute error."""
    error = (output - reference).abs()
    return (error / (ROBUST_BETA + error)).mean()


def l1(output: Tensor, reference: Tensor) -> Tensor:
    """Mean absolute error."""
    return (output - reference).abs().mean()


def charbonnier(output: Tensor, reference: Tensor) -> Tensor:
    """Mean of sqrt(d^2 + epsilon^2) - epsilon: squares small errors alone."""
    error = (output - reference).square() + CHARBONNIER_EPSILON**2
    return (error.sqrt() - CHARBONNIER_EPSILON).mean()


def smape(output: Tensor, reference: Tensor) -> Tensor:
    """Symmetric mean absolute percentage error."""
    error = (output - reference).abs()
    return (error / (output.abs() + reference.abs() + 1e-2)).mean()


def gradient(output: Tensor, reference: Tensor) -> Tensor:
    """Mean absolute error of the differences between neighbouring pixels."""
    error = output - reference
    return (error.diff(dim=-1).abs().mean() + error.diff(dim=-2).abs().mean()) / 2


LOSSES: dict[str, Callable[[Tensor, Tensor], Tensor]] = {
    "robust": robust,
    "l1": l1,
    "charbonnier": charbonnier,
    "smape": smape,
    "gradient": gradient,
}


def weighted(weights: dict[str, float], output: Tensor, reference: Tensor) -> Tensor:
    """The sum of the named losses, each by its weight."""
    terms = [w * LOSSES[name](output, reference) for name, w in weights.items()]
    return torch.stack(terms).sum()
