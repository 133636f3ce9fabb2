"""Cuts that a scene declares: timeline markers that bind cameras."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any


def cuts(scene: Any, frames: Sequence[int]) -> frozenset[int]:
    """Frames, of those given in order, that begin the take of another camera."""
    bound = sorted(
        (m.frame, m.camera.name_full) for m in scene.timeline_markers if m.camera
    )
    if not bound:
        return frozenset()
    pairs = pairwise((number, _camera(bound, number)) for number in frames)
    return frozenset(number for (_, old), (number, new) in pairs if old != new)


def _camera(bound: list[tuple[int, str]], number: int) -> str:
    """The name of a frame's camera: before the first marker it is the first one's."""
    before = [name for frame, name in bound if frame <= number]
    return before[-1] if before else bound[0][1]
