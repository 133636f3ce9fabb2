"""What a command owes the shell: clean streams, an exit status, a quick Ctrl-C."""

from __future__ import annotations

import ctypes
import json
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NoReturn

from xrds_core import atomic
from xrds_core.errors import Cancelled, UsageError, XRDSError

DONE, FAILED, WRONG_USAGE, INTERRUPTED = 0, 1, 2, 130
_SIGNALS = {"SIGINT": "interrupted", "SIGTERM": "terminated", "SIGHUP": "hung up"}


def flush_all() -> None:
    """Flush what Python and the C library still hold of stdout and stderr."""
    sys.stdout.flush()
    sys.stderr.flush()
    if os.name != "nt":  # Windows' C libraries keep one buffer each
        ctypes.CDLL(None).fflush(None)


@contextmanager
def stdout_for_json() -> Iterator[Callable[[Any], None]]:
    """Keep stdout for one JSON value; all else that is printed goes to stderr.

    Cycles prints its progress from C, so the file descriptor itself is moved. Yields
    the function that writes the value; nothing is written if it is not called.
    """
    flush_all()
    kept = os.dup(1)
    os.dup2(2, 1)
    values: list[Any] = []
    try:
        yield values.append
    finally:
        flush_all()
        os.dup2(kept, 1)
        os.close(kept)
    for value in values:
        print(json.dumps(value, indent=1), flush=True)


@contextmanager
def stdout_to(path: Path) -> Iterator[None]:
    """Append what is printed to stdout, by Cycles' C code too, to a file."""
    flush_all()
    kept = os.dup(1)
    try:
        with path.open("ab") as file:
            os.dup2(file.fileno(), 1)
        yield
    finally:
        flush_all()
        os.dup2(kept, 1)
        os.close(kept)


def status_of(work: Callable[[], None]) -> int:
    """Run `work`; show its error as one line on stderr and return the exit status."""
    try:
        work()
    except (KeyboardInterrupt, Cancelled):
        line, status = "interrupted", INTERRUPTED
    except UsageError as error:
        line, status = str(error), WRONG_USAGE
    except XRDSError as error:
        line, status = str(error), FAILED
    except ModuleNotFoundError as error:
        # the extension leaves out torch and what only makes XRDS
        line, status = f"the Python module {error.name} is not installed", FAILED
    except BrokenPipeError:  # the reader of stdout has left, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        return FAILED
    except MemoryError:
        line = "out of memory; set --memory-limit or render a smaller picture"
        status = FAILED
    except Exception as error:  # a fault of ours: show where, end as a command ends
        traceback.print_exc()
        line, status = (
            f"unexpected {type(error).__name__}: a bug in XRDS, please report it",
            FAILED,
        )
    else:
        return DONE
    print(f"xrds: {line}", file=sys.stderr, flush=True)
    return status


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
    for name, told in _SIGNALS.items():
        number = getattr(signal, name, None)  # Windows has not all
        if number and signal.getsignal(number) != signal.SIG_IGN:  # as nohup asks
            signal.signal(number, lambda *_: None)
            heeded[int(number)] = told
    signal.set_wakeup_fd(wake, warn_on_full_buffer=False)

    def wait() -> None:
        while (number := os.read(woken, 1)[0]) not in heeded:
            pass
        atomic.abandon()
        with suppress(OSError):  # stderr may be gone, as the terminal is
            os.write(2, f"xrds: {heeded[number]}\n".encode())
        os._exit(128 + number)

    threading.Thread(target=wait, daemon=True).start()


def leave(status: int) -> NoReturn:
    """End the process; the bpy module can hang when the interpreter ends."""
    flush_all()
    os._exit(status)
