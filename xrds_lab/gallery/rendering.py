"""Renders frames of one shot in a process of its own.

What one shot leaves in Blender, or a crash, then reaches no other one. The process
tells of each frame that it has written by a line, and ends when nobody listens.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from xrds_core.errors import SceneError

from .frames import NOISY, REACH, Request, Store
from .table import SHOTS

LOG = "blender.log"
_MODULE = __name__


def render_apart(
    requests: Sequence[Request], store: Store, done: Callable[[Request], object]
) -> None:
    """Render requests of one shot in another process; raises SceneError if it fails."""
    asked = json.dumps([request.as_dict() for request in requests])
    command = [sys.executable, "-P", "-m", _MODULE, str(store.directory), asked]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as child:
        assert child.stdout is not None
        last = ""
        for line in child.stdout:
            last = line.strip()
            if last.isdigit():
                done(requests[int(last)])
    if child.returncode:
        why = "" if last.isdigit() else f": {last}"
        raise SceneError(f"its process ended with status {child.returncode}{why}")


def render(
    requests: Sequence[Request], store: Store, done: Callable[[int], object]
) -> None:
    """Build the shot and render requests of it here; `done` takes their places."""
    from xrds_blender.interface.registration import ensure_registered

    first = requests[0]
    scene = SHOTS[first.shot].build(store.directory / "images", first.size)
    ensure_registered()
    for place, request in enumerate(requests):
        if not store.has(request):
            scene.frame_set(request.number)
            _render(scene, request, store)
        done(place)


def _render(scene: Any, request: Request, store: Store) -> None:
    """One frame's samples, exactly as `xrds render` takes them for a shot."""
    from xrds_blender.planning.request import render_request
    from xrds_blender.rendering.blender_job import call_engine
    from xrds_blender.rendering.sampling import noisy_frame, sample_frame

    if request.kind != NOISY:
        job = render_request(scale=1, samples=request.samples, seed=request.seed)
        alone = call_engine(scene, lambda *given: sample_frame(*given, job))
        store.keep_reference(request, next(iter(alone.views.values())).picture)
        return
    shot = SHOTS[request.shot]
    samples = None if shot.adaptive else request.samples
    job = render_request(scale=1, samples=samples, temporal_radius=REACH)
    place = shot.frames.index(request.number)
    scene.cycles.samples = request.samples
    frames, _ = call_engine(scene, lambda *given: noisy_frame(*given, job, place))
    store.keep_frames(request, frames)


def _end_with_parent() -> None:
    """End at once when the other end of stdin is closed: nobody waits any more."""

    def wait() -> None:
        sys.stdin.buffer.read()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


def _main() -> int:
    from xrds_blender.command import console

    directory, asked = Path(sys.argv[1]), json.loads(sys.argv[2])
    requests, store = [Request.of(values) for values in asked], Store(directory)
    _end_with_parent()
    with os.fdopen(os.dup(1), "w") as told, console.stdout_to(directory / LOG):
        try:
            render(requests, store, lambda n: print(n, file=told, flush=True))
        except Exception as error:  # told to the one who waits, then over
            print(f"{type(error).__name__}: {error}", file=told, flush=True)
            return 1
    return 0


if __name__ == "__main__":
    status = _main()
    sys.stderr.flush()
    os._exit(status)  # a Blender that rendered can hang when its Python ends
