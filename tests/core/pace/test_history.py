"""Frames that have left the window of a shot whose camera stands still."""

from __future__ import annotations

import numpy as np
from shots import World, camera, view

from xrds_core.accumulation.frame import Stored, store
from xrds_core.pace.history import LONGEST, History

NOISE, RADIUS = 0.3, 2
STILL = World(card=(0.0, 0.0))


def frame(number: int, world: World = STILL) -> Stored:
    return store(view(number, camera(), world, noise=NOISE, samples=4.0).frame)


def run(worlds: list[World]) -> History:
    """The history beside the last of some frames, with a radius."""
    history = History()
    frames = [frame(n, world) for n, world in enumerate(worlds)]
    for middle in range(len(frames)):
        around = frames[max(0, middle - RADIUS) : middle + RADIUS + 1]
        history.advance({each.number: {"": each} for each in around})
    return history


def error(history: History, world: World = STILL) -> float:
    truth = view(0, camera(), world).colour
    light = history.views[""].picture[:, :3].reshape(truth.shape)
    return float(np.sqrt(np.mean(np.square(light - truth))))


def test_frames_of_the_window_are_no_history() -> None:
    assert not run([STILL] * (RADIUS + 1)).views


def test_what_stands_still_adds_up() -> None:
    short, long = run([STILL] * 6), run([STILL] * 26)
    assert (short.number, long.number) == (2, 22)
    counted = long.views[""].samples / frame(0).samples
    assert 10.0 < counted <= 23.0
    assert error(long) < 0.6 * error(short)


def test_old_frames_fade() -> None:
    history = run([STILL] * (LONGEST + 20))
    counts = history.views[""].counts
    assert counts is not None
    assert counts.max() <= LONGEST * frame(0).samples


def test_other_light_begins_anew() -> None:
    dark = World(card=(0.0, 0.0), light=0.5)
    history = run([STILL] * 20 + [dark] * 6)
    assert history.views[""].samples < 8 * frame(0).samples
    assert error(history, dark) < 0.2


def test_what_moves_away_leaves_no_trace() -> None:
    away = World(card=(1.5, 0.0))
    history = run([STILL] * 20 + [away] * 8)
    truth = view(0, camera(), away).colour
    changed = np.abs(truth - view(0, camera(), STILL).colour).max(-1) > 0.1
    assert changed.any()

    def off(stored: Stored) -> float:
        light = stored.picture[:, :3].reshape(truth.shape)
        return float(np.abs(light - truth)[changed].mean())

    # there the history is the few frames since then
    assert off(history.views[""]) < off(frame(27, away))
