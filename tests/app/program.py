"""A real Blender program, and its window with mouse and keyboard.

A program is either the folder that fetch_blender.sh filled, a small root file system,
or an executable of this machine. Everything that touches the window runs beside the
program: the X server, the window manager, xdotool.
"""

from __future__ import annotations

import itertools
import json
import os
import shutil
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
WIDTH, HEIGHT = 1280, 800
TITLE_BAR = 19  # pixels of the window manager's
# In a mount name space of its own: /proc, /dev and one shared folder of the host.
_ENTER = """
root=$1; share=$2; shift 2
mkdir -p "$root/share"
mount --bind /proc "$root/proc"; mount --rbind /dev "$root/dev"
mount --bind "$share" "$root/share"
exec chroot "$root" "$@"
"""


@dataclass(frozen=True)
class Program:
    """Where a Blender is and how commands run beside it."""

    path: Path
    """A root file system with blender in it, or blender itself."""
    share: Path
    """A folder of this machine that the program sees as `seen(share)`."""

    @property
    def is_root(self) -> bool:
        return self.path.is_dir()

    def seen(self, path: Path) -> str:
        """A path under `share` as the program sees it."""
        base = Path("/share") if self.is_root else self.share
        return str(base / path.relative_to(self.share))

    def command(self, *words: str, **environment: str) -> list[str]:
        """The command line that runs `words` beside the program."""
        told = {
            "PATH": "/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin",
            "HOME": self.seen(self.share / "home"),
            "LC_ALL": "C.UTF-8",
            "LIBGL_ALWAYS_SOFTWARE": "1",
            **environment,
        }
        env = ["env", "-i", *[f"{name}={value}" for name, value in told.items()]]
        if not self.is_root:
            words = tuple(str(self.path) if w == "blender" else w for w in words)
            return [*env, *words]
        enter = ["unshare", "--mount", "sh", "-c", _ENTER, "-"]
        return [*enter, str(self.path), str(self.share), *env, *words]

    def run(
        self, *words: str, timeout: float = 300.0, **environment: str
    ) -> subprocess.CompletedProcess[str]:
        """Run to the end and return what was printed, stderr with stdout."""
        return subprocess.run(
            self.command(*words, **environment),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
            timeout=timeout,
        )

    def start(
        self, *words: str, log: Path, **environment: str
    ) -> subprocess.Popen[bytes]:
        """Start in the background, what it prints goes into `log`."""
        with log.open("wb") as out:
            return subprocess.Popen(
                self.command(*words, **environment), stdout=out, stderr=out
            )


class Window:
    """A Blender window on an X server of its own; a context manager."""

    def __init__(self, program: Program, *options: str) -> None:
        self.program, self._options = program, options
        # Another run of the tests has another: X servers see each other's numbers.
        self._display = f":{100 + os.getpid() % 900}"
        self._asked = itertools.count()
        self._running: list[subprocess.Popen[bytes]] = []
        self.folder = program.share / "ask"
        self.shots: list[Path] = []

    def __enter__(self) -> Window:
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir(parents=True)
        shutil.copy(HERE / "inside.py", self.program.share)
        self._start("Xvfb", self._display, "-screen", "0", f"{WIDTH}x{HEIGHT}x24")
        self._wait_for(lambda: self._do("xdpyinfo"))
        self._start("openbox")
        place = ("--window-geometry", "0", "0", str(WIDTH), str(HEIGHT))
        script = self.program.seen(self.program.share / "inside.py")
        asks = self.program.seen(self.folder)
        self._start("blender", *place, *self._options, "--python", script, "--", asks)
        self.ask("1")
        self.settle()
        return self

    def __exit__(self, *_: object) -> None:
        for process in reversed(self._running):
            process.terminate()
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()

    def _start(self, *words: str) -> None:
        log = self.program.share / f"{Path(words[0]).name}.log"
        self._running.append(self.program.start(*words, log=log, DISPLAY=self._display))

    def _wait_for(self, look: Callable[[], subprocess.CompletedProcess[str]]) -> None:
        for _ in range(120):
            if look().returncode == 0:
                return
            time.sleep(0.5)
        raise TimeoutError(f"in vain: {look().args}\n{look().stdout}")

    def _do(self, *words: str) -> subprocess.CompletedProcess[str]:
        return self.program.run(*words, DISPLAY=self._display)

    @property
    def log(self) -> str:
        """All that Blender printed so far."""
        return (self.program.share / "blender.log").read_text(errors="replace")

    def ask(self, text: str, patience: float = 900.0) -> Any:
        """Run Python in Blender and return the value of its last expression."""
        number = next(self._asked)
        written = self.folder / f"{number:05}.part"
        written.write_text(text)
        written.rename(written.with_suffix(".ask"))
        answer = self.folder / f"{number:05}.json"
        end = time.monotonic() + patience
        while not answer.exists():
            if time.monotonic() > end:
                self.shot("no_answer")
                raise TimeoutError(f"Blender did not answer: {text}\n{self.log}")
            if self._running[-1].poll() is not None:
                raise RuntimeError(f"Blender has ended\n{self.log}")
            time.sleep(0.05)
        told = json.loads(answer.read_text())
        if "error" in told:
            raise RuntimeError(told["error"])
        return told["value"]

    def settle(self) -> None:
        """Wait until Blender has drawn its window, which takes long in software."""
        self.ask("bpy.ops.wm.redraw_timer(type='DRAW_WIN_SWAP', iterations=1)")
        time.sleep(1.0)

    def wait(self, text: str, patience: float = 600.0) -> None:
        """Wait until an expression in Blender is true."""
        end = time.monotonic() + patience
        while not self.ask(text):
            if time.monotonic() > end:
                self.shot("waited_in_vain")
                raise TimeoutError(f"never true: {text}\n{self.log}")
            time.sleep(0.3)

    def region(self, area: str, region: str) -> tuple[int, int, int, int]:
        """Left, top, width and height on the screen of an area's region."""
        x, y, width, height, whole = self.ask(
            f"next((r.x, r.y, r.width, r.height, window.height) "
            f"for a in window.screen.areas if a.type == {area!r} "
            f"for r in a.regions if r.type == {region!r})"
        )
        return x, TITLE_BAR + whole - y - height, width, height

    def move(self, x: int, y: int) -> None:
        """Move the pointer, as a hand does: over a point beside it."""
        self._do("xdotool", "mousemove", str(x - 4), str(y - 3))
        self._do("xdotool", "mousemove", str(x), str(y))
        time.sleep(0.5)

    def click(self, x: int, y: int) -> None:
        """Press the left button at a point of the screen."""
        self.move(x, y)
        self._do("xdotool", "click", "1")
        time.sleep(1.0)

    def key(self, *keys: str) -> None:
        """Press keys, by their X names."""
        self._do("xdotool", "key", "--clearmodifiers", *keys)
        time.sleep(1.0)

    def drag(self, start: tuple[int, int], end: tuple[int, int]) -> None:
        """Press at one point and let go at another, slowly: both sides must answer."""
        self.move(*start)
        self._do("xdotool", "mousedown", "1")
        time.sleep(0.5)
        (x, y), (u, v) = start, end
        parts = (0.04, 0.15, 0.4, 0.7, 0.95, 0.98, 1.0)
        for part in parts:
            at = round(x + (u - x) * part), round(y + (v - y) * part)
            self._do("xdotool", "mousemove", *map(str, at))
            time.sleep(0.6)
        self._do("xdotool", "mouseup", "1")
        time.sleep(2.0)

    def open_drag_source(self, path: Path) -> None:
        """Open a window that `path` can be dragged from, at the lower left."""
        shutil.copy(HERE / "drag_source.py", self.program.share)
        script = self.program.seen(self.program.share / "drag_source.py")
        self._running.insert(
            0,
            self.program.start(
                "python3",
                script,
                self.program.seen(path),
                log=self.program.share / "drag_source.log",
                DISPLAY=self._display,
            ),
        )
        self._wait_for(lambda: self._do("xdotool", "search", "--name", "Downloads"))
        time.sleep(3.0)

    def shot(self, name: str) -> Path:
        """Save what the screen shows under `shots`."""
        path = self.program.share / "shots" / f"{name}.png"
        path.parent.mkdir(exist_ok=True)
        self._do("import", "-window", "root", self.program.seen(path))
        self.shots.append(path)
        return path


def programs() -> list[Path]:
    """The Blenders to test: $XRDS_BLENDERS, or what make test-app fetched."""
    told = os.environ.get("XRDS_BLENDERS")
    if told:
        return [Path(part).resolve() for part in told.split(os.pathsep)]
    fetched = HERE.parents[1] / "build" / "blender"
    return sorted(path.parent for path in fetched.glob("*/.complete"))
