"""What a command owes the shell: an error in one line, an exit status, a quick end."""

from __future__ import annotations

import ctypes
import io
import json
import os
import shutil
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn

from xrds_core import files
from xrds_core.errors import Cancelled, UsageError, XRDSError, printable, warn
from xrds_core.errors import finished as finished_frames

Check = Callable[[Any], None]

DONE, FAILED, WRONG_USAGE, INTERRUPTED = 0, 1, 2, 130
_SIGNALS = {"SIGINT": "interrupted", "SIGTERM": "terminated", "SIGHUP": "hung up"}


@dataclass(frozen=True)
class _End:
    """How work ended: what it gave, or the line that says why it did not."""

    status: int = DONE
    line: str = ""
    value: Any = None


def status_of(
    work: Callable[[], Any],
    lines: Callable[[Any], Iterable[str]] = lambda _: (),
    check: Check | None = None,
) -> int:
    """Run `work` and print its result's `lines`; return the exit status.

    An error is shown as one line on stderr. `check` may find the result wanting: it
    raises the error, and the result is printed all the same.
    """
    end = _ended(work)
    if end.status != DONE:
        return end.status
    for line in lines(end.value) if end.value else ():
        print(printable(line))
    return _checked(end, check)


def status_with_json(work: Callable[[], Any], check: Check | None = None) -> int:
    """The same with one JSON value on stdout, of the result or of the error.

    All else that is printed goes to stderr.
    """
    with stdout_to_stderr():
        end = _ended(work)
    result = end.value if end.status == DONE else _error(end.line, end.status)
    print(json.dumps(result, indent=1), flush=True)
    return _checked(end, check)


def _checked(end: _End, check: Check | None) -> int:
    if end.status != DONE or check is None:
        return end.status
    return _ended(lambda: check(end.value)).status


def _error(line: str, status: int) -> dict[str, Any]:
    """What `--json` prints of a failure, with the frames that are finished."""
    frames = {"frames": list(finished_frames)} if finished_frames else {}
    return {"error": line, "status": status, **frames}


def _ended(work: Callable[[], Any]) -> _End:
    """Run `work`; an error is reported on stderr."""
    try:
        return _End(value=work())
    except (KeyboardInterrupt, Cancelled):
        end = _End(INTERRUPTED, "interrupted")
    except UsageError as error:
        end = _End(WRONG_USAGE, str(error))
    except XRDSError as error:
        end = _End(FAILED, str(error))
    except ModuleNotFoundError as error:
        # the extension leaves out torch and what only makes XRDS
        end = _End(FAILED, f"the Python module {error.name} is not installed")
    except OSError as error:  # of files, mostly ones that the user named
        end = _End(FAILED, _reason(error))
    except MemoryError:
        line = "out of memory; set --memory-limit or render a smaller picture"
        end = _End(FAILED, line)
    except Exception as error:  # a fault of ours: show where, end as a command ends
        traceback.print_exc()
        name = type(error).__name__
        end = _End(FAILED, f"unexpected {name}: a bug in XRDS, please report it")
    warn(end.line)
    return end


def _reason(error: OSError) -> str:
    if error.filename is None:
        return printable(error.strerror or str(error) or type(error).__name__)
    return printable(f"{error.strerror}: {os.fsdecode(error.filename)}")


def prepare() -> None:
    """Make streams and signals safe; once, at the start of a process."""
    prepare_streams()
    if hasattr(signal, "SIGPIPE"):  # as in Python, but not in a Blender program
        signal.signal(signal.SIGPIPE, signal.SIG_IGN)
    end_at_once_by_signals()
    files.sweep()


def end_at_once_by_signals() -> None:
    """End on Ctrl-C and the like even while Cycles or torch compute in C.

    Python runs its own signal handlers only between bytecodes of the main thread,
    which a render keeps waiting for minutes; a thread that reads the wake-up pipe
    does not wait. Files that are being written are removed. The exit status is 128
    and the signal's number, as a shell's: 130 on Ctrl-C.
    """
    woken, wake = os.pipe()
    os.set_blocking(wake, False)
    heeded = {}
    for name, text in _SIGNALS.items():
        number = getattr(signal, name, None)  # Windows has not all
        if number and signal.getsignal(number) != signal.SIG_IGN:  # as nohup asks
            signal.signal(number, lambda *_: None)
            heeded[int(number)] = text
    signal.set_wakeup_fd(wake, warn_on_full_buffer=False)

    def wait() -> None:
        while (number := os.read(woken, 1)[0]) not in heeded:
            pass
        files.abandon()
        _remove_blenders_folder()
        line, status = heeded[number], 128 + number
        result = json.dumps(_error(line, status), indent=1) + "\n"
        write_at_once(f"xrds: {line}\n", result)
        os._exit(status)

    threading.Thread(target=wait, daemon=True).start()


def finished(status: int) -> int:
    """The exit status at last: what could not be printed is a failure, too."""
    fault = stdout_fault()
    if fault is None or status != DONE:
        return status
    if not isinstance(fault, BrokenPipeError):  # not as `head` leaves
        warn(f"cannot write to stdout ({fault.strerror})")
    return FAILED


def leave(status: int) -> NoReturn:
    """End the process; the bpy module can hang when the interpreter ends."""
    status = finished(status)
    _remove_blenders_folder()
    flush_all()
    os._exit(status)


def _remove_blenders_folder() -> None:
    """Remove the temporary folder of the bpy module, which it would at its own end."""
    bpy = sys.modules.get("bpy")
    folder = getattr(getattr(bpy, "app", None), "tempdir", "")
    if folder and Path(folder).name.startswith("blender_"):  # not the user's own
        shutil.rmtree(folder, ignore_errors=True)


_aside: int | None = None  # where stdout really leads, while it is moved


class _Stream(io.FileIO):
    """A stream whose faults stop no work; `fault` is the first one."""

    fault: OSError | None = None

    def write(self, data: Any) -> int:
        if self.fault is None:
            try:
                return super().write(data)
            except OSError as error:  # full, closed, or nobody reads it any more
                self.fault = error
        return len(data)


def prepare_streams() -> None:
    """Make the streams safe to print on, whatever the shell has made of them.

    A closed one would give its number to the next file that is opened, and Cycles would
    print into that. As in GNU's tools the null device comes in its place, opened the
    other way round so that writing still fails and is reported.
    """
    for number, mode in ((0, os.O_WRONLY), (1, os.O_RDONLY), (2, os.O_RDONLY)):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, mode)  # takes the lowest number that is free
    sys.stdout, sys.stderr = (
        io.TextIOWrapper(
            io.BufferedWriter(_Stream(number, "w", closefd=False)),
            encoding=getattr(before, "encoding", None) or "utf-8",
            errors="backslashreplace",
            line_buffering=number == 2 or os.isatty(number),
        )
        for number, before in ((1, sys.stdout), (2, sys.stderr))
    )


def stdout_fault() -> OSError | None:
    """Why stdout did not take all that was printed, None if it did."""
    flush_all()
    raw = getattr(getattr(sys.stdout, "buffer", None), "raw", None)
    return raw.fault if isinstance(raw, _Stream) else None


def flush_all() -> None:
    """Flush what Python and the C library still hold of stdout and stderr."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError, AttributeError):  # full, closed, None
            stream.flush()
    if os.name != "nt":  # Windows' C libraries keep one buffer each
        ctypes.CDLL(None).fflush(None)


@contextmanager
def stdout_to_stderr() -> Iterator[None]:
    """Let all that is printed on stdout go to stderr, so that a result has it alone."""
    global _aside
    with _moved() as _aside:
        os.dup2(2, 1)
        yield
    _aside = None


@contextmanager
def stdout_to(path: Path) -> Iterator[None]:
    """Append what is printed on stdout to a file."""
    with _moved(), path.open("ab") as file:
        os.dup2(file.fileno(), 1)
        yield


def write_at_once(text: str, result: str) -> None:
    """Write to stderr, and `result` to stdout where it waits for one, without buffers.

    For a process that is about to end on the spot.
    """
    for number, content in ((2, text), (_aside, result)):
        if number is not None:
            with suppress(OSError):  # the terminal may have gone
                os.write(number, content.encode())


@contextmanager
def _moved() -> Iterator[int]:
    """Yield a copy of stdout's descriptor, which is put back at the end."""
    flush_all()
    saved = os.dup(1)
    try:
        yield saved
    finally:
        flush_all()
        os.dup2(saved, 1)
        os.close(saved)


Lines = Callable[[dict[str, Any]], Iterable[str]]


def lines_of(module: str) -> Lines:
    """The `lines` of a module, which make a result readable."""
    return lambda result: import_module(module).lines(result)


def no_lines(_: dict[str, Any]) -> Iterable[str]:
    """For commands whose work has printed all there is to say."""
    return ()


def need_blender(command: str) -> None:
    """Register the engine; raises UsageError where Blender is not there."""
    try:
        import bpy  # noqa: F401  # only asked whether it is there
    except ImportError as error:
        raise UsageError(
            f"{command} needs Blender: install the bpy module "
            "(pip install bpy) or run blender --command xrds"
        ) from error
    from ..interface.registration import ensure_registered

    ensure_registered()
