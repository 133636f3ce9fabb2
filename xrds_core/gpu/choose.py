"""Which card accumulates: asked for by name, or the fastest that computes rightly."""

from __future__ import annotations

import numpy as np

from ..errors import UsageError
from ..notices import warn
from ..temporal.accumulate import accumulate
from ..temporal.frame import Camera, Frame, Stored, store
from ..temporal.motion import FEW_SAMPLES
from .accumulate import CardAccumulator
from .card import Card, CardLost, card_names, find_adapters

_SIZE = 48, 64  # of the pictures by which a card is checked
_ALIKE = 1e-3  # relative difference that a card may have from the processor


def choose(name: str) -> CardAccumulator | None:
    """Return the card whose name contains `name`, the fastest for `auto` and `gpu`.

    None for `auto` where no card is here, or where none does what it should, which is
    said. Raises UsageError for another name without such a card, CardLost where that
    card fails.
    """
    adapters = find_adapters()
    if name not in ("auto", "gpu"):
        adapters = [x for x in adapters if name.lower() in x.info["device"].lower()]
    for adapter in adapters:
        try:
            found = CardAccumulator(Card(adapter))
            check(found)
        except CardLost as error:
            if name != "auto":
                raise
            warn(f"{error}; it is not used")
        else:
            return found
    if name == "auto":
        return None
    here = ", ".join(card_names()) or "none"
    raise UsageError(
        f"no graphics card {name!r} can accumulate here; use auto or cpu, or one of: "
        f"{here} (a card needs the package wgpu, and a driver of Vulkan, Metal or "
        "Direct3D 12)"
    )


def check(card: CardAccumulator) -> None:
    """Accumulate a small shot on a card and on the processor.

    Raises CardLost where they differ: drivers that compute wrongly give no error.
    """
    frames = [_frame(number) for number in range(3)]
    expected = accumulate(frames[1], frames[::2])
    found = accumulate(frames[1], frames[::2], card=card)
    if card.is_lost:
        raise CardLost(f"graphics card {card.card.name} failed in its check")
    assert expected.radiance is not None
    assert found.radiance is not None
    apart = np.abs(found.radiance - expected.radiance).mean()
    if not apart <= _ALIKE * expected.radiance.mean():
        raise CardLost(
            f"graphics card {card.card.name} computes something else than the "
            "processor: update its driver"
        )


def _frame(number: int) -> Stored:
    """A frame of a noisy wavy floor, seen by a camera that moves to the right."""
    height, width = _SIZE
    view = np.eye(4)
    view[0, 3] = -0.037 * number
    project = np.diag([2.0, 2.0 * width / height, -1.0, 0.0])
    project[2, 3], project[3, 2] = -0.2, -1.0
    rng = np.random.default_rng(number)
    row, column = np.mgrid[:height, :width].astype(np.float32)
    depth = 3.0 + 0.02 * row
    albedo = np.stack([0.5 + 0.3 * np.sin(column * k / 9) for k in (1, 2, 3)], axis=-1)
    noise = rng.exponential(1.0, (height, width, 1))
    normal = np.zeros((height, width, 3), np.float32)
    normal[..., 2] = -1.0
    return store(
        Frame(
            number,
            Camera(view, project, (width, height)),
            (albedo * noise).astype(np.float32),
            albedo.astype(np.float32),
            normal,
            depth,
            samples=FEW_SAMPLES,  # of more a card accumulates none that move
        )
    )
