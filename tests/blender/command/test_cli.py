"""The command line without Blender: options, streams and exit status."""

from __future__ import annotations

import json
import os
import shlex
import signal
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import pytest

from xrds_blender.command import console, main
from xrds_blender.command.options import choice_of, encoding_of, request_of
from xrds_core.errors import (
    Cancelled,
    PictureError,
    SceneError,
    UsageError,
    WeightsError,
    XRDSError,
)
from xrds_core.exr.openexr_io import Encoding
from xrds_core.superres.network import XRDS, preset_config
from xrds_core.superres.weights import file_name
from xrds_core.version import package_version
from xrds_lab.weights import save_network

HUGE = "99999999999999999999999"  # more than 64 bits
MAIN = "import sys, xrds_blender.command.main as m; sys.exit(m.main(sys.argv[1:]))"


def parse(line: str) -> Any:
    return main._parser(line.split()).parse_args(line.split())


def run(code: str, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code), *words],
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize(
    "words",
    [
        [],
        ["renders", "a.blend"],
        ["render", "a.blend"],
        ["render", "a.blend", "-o", "b.exr", "--scale", "3"],
        ["render", "a.blend", "-o", "b.exr", "--scale", "4", "--plain"],
        ["render", "a.blend", "-o", "b.exr", "--frames", "9-3"],
        ["render", "a.blend", "-o", "b.exr", "--frames", "1-2", "--frame", "1"],
        ["render", "a.blend", "-o", "b.exr", "--samples", "0"],
        ["render", "a.blend", "-o", "b.exr", "--resolution", "0x5"],
        ["render", "a.blend", "-o", "b.exr", "--resolution", "70000x4"],
        ["render", "a.blend", "-o", "b.exr", "--frame", HUGE],
        ["render", "a.blend", "-o", "#.exr", "--frames", "1-99999999999"],
        ["render", "a.blend", "-o", "#.exr", "--frames", "1-2x0"],
        ["render", "a.blend", "-o", "#.exr", "--frames", "1-9,12-"],
        ["render", "a.blend", "-o", "b.exr", "--samples", HUGE],
        ["render", "a.blend", "-o", "b.exr", "--seed", HUGE],
        ["render", "a.blend", "-o", "b.exr", "--seed=-1"],
        ["render", "a.blend", "-o", "b.exr", "--guide-samples", HUGE],
        ["render", "a.blend", "-o", "b.exr", "--guide-limit", HUGE],
        ["render", "a.blend", "-o", "b.exr", "--scale", "1", "--temporal-radius", HUGE],
        ["render", "a.blend", "-o", "b.exr", "--memory-limit", HUGE + "G"],
        ["render", "a.blend", "-o", "b.exr", "--exposure", "1e300"],
        ["denoise", "#.exr", "-o", "o/#.exr", "--samples", HUGE],
        ["denoise", "#.exr", "-o", "o/#.exr", "--temporal-radius", HUGE],
        ["denoise", "#.exr", "-o", "o/#.exr", "--frames", f"1-{HUGE}"],
        ["denoise", "#.exr", "-o", "o/#.exr", "--memory-limit", f"{HUGE}G"],
        ["denoise", "#.exr", "-o", "o/#.exr", "--motion-scale", "nan,1"],
        ["dataset", "--out", "o", "--seed", HUGE],
        ["stability", "--out", __file__],
        ["train", "a.toml", "--out", __file__],
        ["render", "a.blend", "-o", "b.exr", "--preset", "best"],
        ["render", "a.blend", "-o", "b.exr", "--exposure", "0"],
        ["render", "a.blend", "-o", "b.exr", "--memory-limit", "much"],
        ["evaluate", "a.blend", "--windows", "w", "--references", "r", "--scale", "x"],
        ["evaluate", "a.blend", "--windows", "w", "--references", "r", "--preset", "x"],
        ["stability"],
        ["stability", "--out", "o", "--parts", "everything"],
    ],
    ids=" ".join,
)
def test_wrong_usage_is_2(words: list[str], capfd: pytest.CaptureFixture[str]) -> None:
    assert main.main(words) == 2
    out, err = capfd.readouterr()
    assert not out
    assert err.startswith("xrds: ")
    assert err.count("\n") == 1


def test_help_is_0(capfd: pytest.CaptureFixture[str]) -> None:
    assert main.main(["render", "--help"]) == 0
    assert "--guide-samples" in capfd.readouterr().out


@pytest.mark.parametrize("command", main.EXAMPLES)
def test_help_has_examples_and_statuses(
    command: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert main.main([command, "--help"]) == 0
    out = capfd.readouterr().out
    assert "exit status: 0 done, 1 failed, 2 wrong usage, 130 interrupted" in out
    assert "docs/farms.md" in out
    first, second = main.EXAMPLES[command]
    for line in (first, second):
        assert line in out
        words = shlex.split(line)[1:]
        assert main._parser(words).parse_args(words).command == command


def test_a_failed_command_lists_what_is_finished(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(console, "finished_frames", [{"frame": 1, "output": "1.exr"}])

    def stop() -> None:
        raise KeyboardInterrupt

    assert console.status_with_json(stop) == console.INTERRUPTED
    told = json.loads(capfd.readouterr().out)
    frames = [{"frame": 1, "output": "1.exr"}]
    assert told == {"error": "interrupted", "status": 130, "frames": frames}


def test_the_version_is_told(capfd: pytest.CaptureFixture[str]) -> None:
    assert main.main(["--version"]) == 0
    assert capfd.readouterr().out == f"XRDS {package_version()}\n"


def test_without_the_laboratory_its_commands_are_not_listed(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(main, "entry_points", lambda **_: [])
    assert main.main(["--help"]) == 0
    listed = capfd.readouterr().out
    assert "render" in listed
    assert not [name for name in main.LABORATORY if name in listed]
    assert main.main(["bench", "a.blend"]) == 2
    err = capfd.readouterr().err
    assert err.startswith("xrds: bench belongs to the laboratory")
    assert err.count("\n") == 1


def test_with_it_they_are(capfd: pytest.CaptureFixture[str]) -> None:
    assert main.main(["--help"]) == 0
    listed, _, apart = capfd.readouterr().out.partition("laboratory")
    lines = apart.splitlines()
    for name in main.LABORATORY:
        assert any(line.startswith(f"  {name} ") for line in lines)
        assert f" {name} " not in listed
    assert listed.index("render ") < listed.index("upscale ") < listed.index("info ")


def test_render_options() -> None:
    options = parse(
        "render a.blend -o f_####.png --frames=-2-3 --resolution 640x360 "
        "--scale 4 --samples 9 --memory-limit 2G --exposure 0.5 --seed 7 --resume "
        "--threads 3 --exr-depth half --exr-codec dwaa -y"
    )
    machine = request_of(options).machine
    assert machine.threads == choice_of(options).threads == 3
    assert encoding_of(options) == Encoding(half=True, codec="dwaa")
    assert choice_of(options).trusted
    assert options.scene == Path("a.blend")
    assert options.frames == [-2, -1, 0, 1, 2, 3]
    assert options.resolution == (640, 360)
    assert options.memory_limit == 2 << 30
    assert options.resume
    assert (options.scale, options.samples, options.exposure, options.seed) == (
        4,
        9,
        0.5,
        7,
    )
    assert (options.preset, options.plain, options.json) == ("fast", False, False)


@pytest.mark.parametrize(
    ("text", "frames"),
    [
        ("5", [5]),
        ("-2-1", [-2, -1, 0, 1]),
        ("1-10x4", [1, 5, 9]),
        ("1-9x4,120,3", [1, 5, 9, 120, 3]),
        ("1-3,2-4", [1, 2, 3, 4]),
        ("-5--3", [-5, -4, -3]),
    ],
)
def test_frames_are_ranges_steps_and_lists(text: str, frames: list[int]) -> None:
    assert parse(f"render a.blend -o #.exr --frames={text}").frames == frames


LONG = "x" * 300


@pytest.mark.parametrize("command", ["render", "denoise"])
@pytest.mark.parametrize(
    ("text", "frames"),
    [("-1-1", [-1, 0, 1]), ("-3--1", [-3, -2, -1]), ("-2", [-2]), ("-3,-1", [-3, -1])],
)
@pytest.mark.parametrize("joined", [True, False])
def test_frames_below_zero_are_a_value(
    command: str, text: str, frames: list[int], joined: bool
) -> None:
    words = [command, "in", "-o", "out"]
    words += [f"--frames={text}"] if joined else ["--frames", text]
    assert main._parser(words).parse_args(words).frames == frames


@pytest.mark.parametrize(
    "words",
    [
        ["upscale", f"{LONG}.exr", "a.exr", "-o", "b.exr"],
        ["upscale", "a.exr", "a.exr", "-o", f"{LONG}.exr"],
        ["upscale", "a.exr", "a.exr", "-o", "b.exr", "--weights", LONG],
        ["upscale", "a.exr", "a.exr", "-o", "b.exr", "--device", "meta"],
        ["info", "--weights", LONG],
        ["info", "--weights", "none"],
        ["evaluate", "a", "--windows", LONG, "--references", "r"],
        ["train", f"{LONG}.toml", "--out", "o"],
    ],
    ids=lambda words: " ".join(words).replace(LONG, "LONG"),
)
def test_what_cannot_be_is_one_line(
    words: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main.main(words) in {1, 2}
    out, err = capfd.readouterr()
    assert not out
    assert err.startswith("xrds: ")
    assert err.count("\n") == 1
    assert "bug" not in err
    assert not list(tmp_path.iterdir())


def test_evaluate_lists() -> None:
    options = parse(
        "evaluate a b --windows w --references r --scale 2,4 --preset fast,balanced"
    )
    assert options.scenes == [Path("a"), Path("b")]
    assert options.scale == (2, 4)
    assert options.preset == ("fast", "balanced")


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (UsageError("no such scale"), 2),
        (XRDSError("broken"), 1),
        (SceneError("no camera"), 1),
        (WeightsError("no weights"), 1),
        (PictureError("no pass"), 1),
        (Cancelled("stopped"), 130),
        (KeyboardInterrupt(), 130),
        (MemoryError(), 1),
    ],
)
def test_errors_are_one_line(
    error: BaseException, status: int, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail() -> None:
        raise error

    assert console.status_of(fail) == status
    out, err = capsys.readouterr()
    assert not out
    assert err.startswith("xrds: ")
    assert err.count("\n") == 1


def started(code: str) -> subprocess.Popen[str]:
    """Python running `code`, to be heard while it runs."""
    return subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(code)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_a_reader_that_leaves_early_is_no_fault(tmp_path: Path) -> None:
    code = f"""
    from pathlib import Path
    from xrds_blender.command import console
    console.prepare()
    def work():
        for _ in range(100_000):
            print("a line")
        Path({str(tmp_path)!r}, "picture").touch()
    console.leave(console.status_of(work))
    """
    with started(code) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == "a line\n"
        child.stdout.close()
        assert child.stderr is not None
        assert not child.stderr.read()
    assert child.returncode == 1
    assert (tmp_path / "picture").exists()


def test_json_has_stdout_to_itself() -> None:
    done = run(
        """
        import ctypes, os
        from xrds_blender.command import console
        def work():
            print("Fra:1 from Python")
            ctypes.CDLL(None).puts(b"Fra:1 from C")
            os.write(1, b"Fra:1 from the kernel\\n")
            return {"answer": 42}
        console.status_with_json(work)
        """
    )
    assert json.loads(done.stdout) == {"answer": 42}
    assert done.stderr.count("Fra:1") == 3


@pytest.mark.parametrize("words", [["upscale"], ["renders"], ["render", "a"]])
def test_wrong_usage_is_json_too(
    words: list[str], capfd: pytest.CaptureFixture[str]
) -> None:
    assert main.main([*words, "--json"]) == 2
    out, err = capfd.readouterr()
    told = json.loads(out)
    assert set(told) == {"error", "status"}
    assert told["status"] == 2
    assert err == f"xrds: {told['error']}\n"


def test_a_failure_is_one_json_object(tmp_path: Path) -> None:
    beauty, out = str(tmp_path / "missing.exr"), str(tmp_path / "out.exr")
    weights = tmp_path / file_name("fast", 2)
    save_network(XRDS(preset_config("fast", 2)), weights, {})
    words = ["upscale", beauty, beauty, "-o", out, "--weights", str(weights)]
    done = run(MAIN, *words, "--json")
    assert done.returncode == 1
    told = json.loads(done.stdout)
    assert told["status"] == 1
    assert "missing.exr" in told["error"]
    assert done.stderr == f"xrds: {told['error']}\n"


def test_info_json_fields() -> None:
    done = run(MAIN, "info", "--json")
    result = json.loads(done.stdout)
    assert done.returncode == 0, done.stderr
    assert set(result) >= {
        "version",
        "torch",
        "blender",
        "devices",
        "paper_table",
        "presets",
        "weights",
    }
    assert result["devices"][0] == "cpu"
    assert result["paper_table"][0]["parameters"] == 9357857
    assert set(result["presets"]["fast"]["2"]) == {
        "parameters",
        "macs_per_output_pixel",
    }


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals to send")
@pytest.mark.parametrize(
    ("name", "told"),
    [("SIGINT", "interrupted"), ("SIGTERM", "terminated"), ("SIGHUP", "hung up")],
)
def test_a_signal_does_not_wait_for_c(tmp_path: Path, name: str, told: str) -> None:
    # The C call holds the main thread as a render does, its lock released.
    code = f"""
    import ctypes
    from pathlib import Path
    from xrds_blender.command import console
    from xrds_core.files import replacing
    console.end_at_once_by_signals()
    libc = ctypes.CDLL(None)
    with replacing(Path({str(tmp_path)!r}) / "frame.exr") as part:
        part.write_text("half")
        print("ready", flush=True)
        while True:
            libc.usleep(900_000)
    """
    with started(code) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == "ready\n"
        number = signal.Signals[name]
        child.send_signal(number)
        _, err = child.communicate()
    assert child.returncode == 128 + number
    assert err == f"xrds: {told}\n"
    assert not list(tmp_path.iterdir())


# --- streams that the shell closed, or that take no more ------------------------------

STREAMS = """
import os, signal, sys
from pathlib import Path
from xrds_blender.command import console
signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # as in a Blender program
console.prepare()
with open(sys.argv[1], "w") as picture:  # as any file that is opened afterwards
    assert picture.fileno() > 2
    def work():
        for number in (1, 2):
            try:
                os.write(number, b"as Cycles prints from C")
            except OSError:
                pass
        print("progress", file=sys.stderr)
        picture.write("whole")
        return {"answer": 42}
    how = console.status_with_json if "--json" in sys.argv else console.status_of
    status = how(work)
    print("out.exr: 1.0 s")
console.leave(status)
"""


@pytest.mark.skipif(os.name == "nt", reason="of a POSIX shell")
@pytest.mark.parametrize(
    ("shell", "status"),
    [
        (">&-", 1),
        ("2>&-", 0),
        (">&- 2>&-", 1),
        ("<&- >&- 2>&-", 1),
        ("> /dev/full", 1),
        ("2> /dev/full", 0),
        ("> /dev/full 2> /dev/full", 1),
        ("2>&1 | true; exit ${PIPESTATUS[0]}", 1),
        (">&- --json", 1),
        ("> /dev/full --json", 1),
        ("2>&- --json", 0),
    ],
)
def test_closed_and_full_streams_cost_no_picture(
    tmp_path: Path, shell: str, status: int
) -> None:
    picture = tmp_path / "picture"
    line = f'"$0" -c "$1" "$2" {shell}'
    done = subprocess.run(
        ["bash", "-c", line, sys.executable, STREAMS, str(picture)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == status
    assert picture.read_text() == "whole"
    assert "Traceback" not in done.stderr
    assert ("cannot write to stdout" in done.stderr) == (
        status == 1 and "2>" not in shell
    )


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals to send")
def test_an_interrupted_command_is_json_too() -> None:
    code = """
    import sys, time
    from xrds_blender.command import console
    console.prepare()
    def work():
        print("ready", file=sys.stderr)
        time.sleep(10_000)
    console.leave(console.status_with_json(work))
    """
    with started(code) as child:
        assert child.stderr is not None
        assert child.stderr.readline() == "ready\n"
        child.send_signal(signal.SIGTERM)
        out, err = child.communicate()
    assert child.returncode == 143
    assert json.loads(out) == {"error": "terminated", "status": 143}
    assert err == "xrds: terminated\n"


# --- text from outside ----------------------------------------------------------------

STEERING = "a\x1b[2J\nxrds: all well\r\u202e"


def test_nothing_printed_can_steer_a_terminal(
    capfd: pytest.CaptureFixture[str],
) -> None:
    assert main.main(["upscale", STEERING, STEERING, "-o", "o.exr"]) == 1
    assert main.main(["render", "a.blend", "-o", "b.exr", "--preset", STEERING]) == 2
    assert main.main([STEERING]) == 2
    assert console.status_of(lambda: 1, lambda _: [f"{STEERING}: 1 s"]) == 0
    out, err = capfd.readouterr()
    assert err.count("\n") == 3
    assert out.count("\n") == 1
    assert (out + err).replace("\n", "").isprintable()


# --- after a kill ---------------------------------------------------------------------


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGKILL")
def test_any_command_sweeps_up_what_a_killed_one_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    frames, temporary = tmp_path / "frames", tmp_path / "temporary"
    frames.mkdir()
    temporary.mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    code = f"""
    import os, signal
    from pathlib import Path
    from xrds_core.files import replacing
    with replacing(Path({str(frames)!r}, "1.exr")) as part:
        part.write_text("half")
        os.kill(os.getpid(), signal.SIGKILL)
    """
    assert run(code).returncode == -signal.SIGKILL
    assert list(frames.iterdir())
    words = [sys.executable, "-m", "xrds_blender.command.main", "--version"]
    subprocess.run(words, check=True, capture_output=True)
    assert not [*frames.iterdir(), *temporary.iterdir()]
