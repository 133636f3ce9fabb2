"""Whether files can be read and written, asked before the work."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable
from pathlib import Path

from .atomic import sweep, try_folder
from .errors import PictureError, XRDSError


def check_input(path: Path, error: type[XRDSError] = PictureError) -> int:
    """Return the bytes of a file; raise `error`, saying why, if it cannot be read."""
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise error(f"cannot read {path}: it is no regular file")
        with path.open("rb") as file:
            return os.fstat(file.fileno()).st_size
    except FileNotFoundError as reason:
        raise error(f"no file {path}") from reason
    except OSError as reason:
        raise error(f"cannot read {path} ({reason.strerror})") from reason


def check_output(path: Path, inputs: Iterable[str | Path] = ()) -> None:
    """Refuse a file that cannot be written, and an input of the work as its output.

    Makes the folder, and sweeps up what killed processes left in it. Raises
    PictureError.
    """
    check_place(path, inputs)
    check_folder(Path(os.path.realpath(path)).parent)


def check_place(path: Path, inputs: Iterable[str | Path] = ()) -> None:
    """Raise PictureError for a path that names no file, or one not to be replaced.

    Those are devices, pipes and sockets, also behind a link, read-only files, and the
    work's own inputs.
    """
    reason = ""
    try:
        os.fspath(path).encode()
        kind = path.stat().st_mode
        if stat.S_ISDIR(kind):
            reason = "it is a folder"
        elif not stat.S_ISREG(kind):
            reason = "it is no regular file"
        elif not os.access(path, os.W_OK):
            reason = "it is read-only"
    except FileNotFoundError:  # as it is to be
        reason = "it is a link that leads nowhere" if path.is_symlink() else ""
    except UnicodeEncodeError:
        reason = "its name is not UTF-8"
    except OSError as error:
        reason = str(error.strerror)
    if reason:
        raise PictureError(f"cannot write {path} ({reason}); choose another output")
    for each in inputs:
        if path.exists() and os.path.realpath(path) == os.path.realpath(each):
            raise PictureError(
                f"cannot write {path}: it is an input; choose another output"
            )


def check_folder(folder: Path) -> None:
    """Make a folder; raise PictureError where it takes no file.

    What killed processes left in it is swept up.
    """
    try:
        try_folder(folder)
    except OSError as error:
        raise PictureError(
            f"cannot write into {folder} ({error.strerror}); choose another output"
        ) from error
    sweep(folder)
