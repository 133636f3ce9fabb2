"""What a command owes the shell: an error in one line, an exit status, a quick end."""

from __future__ import annotations

import json
import os
import shutil
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

from xrds_core import atomic
from xrds_core.errors import Cancelled, UsageError, XRDSError, printable
from xrds_core.notices import finished as finished_frames
from xrds_core.notices import warn

from . import streams

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
    with streams.stdout_to_stderr():
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
    streams.prepare()
    if hasattr(signal, "SIGPIPE"):  # as in Python, but not in a Blender program
        signal.signal(signal.SIGPIPE, signal.SIG_IGN)
    end_at_once_by_signals()
    atomic.sweep()


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
        atomic.abandon()
        _remove_blenders_folder()
        line, status = heeded[number], 128 + number
        result = json.dumps(_error(line, status), indent=1) + "\n"
        streams.write_at_once(f"xrds: {line}\n", result)
        os._exit(status)

    threading.Thread(target=wait, daemon=True).start()


def finished(status: int) -> int:
    """The exit status at last: what could not be printed is a failure, too."""
    fault = streams.fault()
    if fault is None or status != DONE:
        return status
    if not isinstance(fault, BrokenPipeError):  # not as `head` leaves
        warn(f"cannot write to stdout ({fault.strerror})")
    return FAILED


def leave(status: int) -> NoReturn:
    """End the process; the bpy module can hang when the interpreter ends."""
    status = finished(status)
    _remove_blenders_folder()
    streams.flush_all()
    os._exit(status)


def _remove_blenders_folder() -> None:
    """Remove the temporary folder of the bpy module, which it would at its own end."""
    bpy = sys.modules.get("bpy")
    folder = getattr(getattr(bpy, "app", None), "tempdir", "")
    if folder and Path(folder).name.startswith("blender_"):  # not the user's own
        shutil.rmtree(folder, ignore_errors=True)
