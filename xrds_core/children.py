"""Python processes of our own: they run nothing of the working folder, and end with us.

`python -m` and `python -c` look for modules in the working folder first, where anything
may lie. `-P` forbids it.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterable

_running: set[subprocess.Popen[str]] = set()


def run_python(
    *arguments: str, path: Iterable[str] = ()
) -> subprocess.CompletedProcess[str]:
    """Run `python ARGUMENTS`.

    It is killed where this process is interrupted, also by `kill_all`.

    Parameters
    ----------
    *arguments : str
        Arguments of the command line.
    path : iterable of str
        Folders in which it looks for modules first. Not all of `sys.path` unasked:
        Blender puts another module `bpy` in it.

    Returns
    -------
    process : subprocess.CompletedProcess
        Its status and what it printed.
    """
    environment = dict(os.environ)
    if folders := [folder for folder in path if folder]:  # "" is the working folder
        environment["PYTHONPATH"] = os.pathsep.join(folders)
    command = [sys.executable, "-P", *arguments]
    with subprocess.Popen(
        command,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        errors="backslashreplace",
    ) as child:
        _running.add(child)
        try:
            output, errors = child.communicate()
        except BaseException:
            child.kill()
            raise
        finally:
            _running.discard(child)
    return subprocess.CompletedProcess(command, child.returncode, output, errors)


def kill_all() -> None:
    """Kill those that run: this process is about to end on the spot."""
    for child in list(_running):
        child.kill()
