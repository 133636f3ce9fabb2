"""The command line without Blender: options, streams and exit status."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path
from typing import Any

import pytest

from xrds_blender.command import console, main
from xrds_core.errors import (
    Cancelled,
    PictureError,
    SceneError,
    UsageError,
    WeightsError,
    XRDSError,
)
from xrds_core.network import XRDS, preset_config
from xrds_core.weights import file_name, save

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
        ["render", "a.blend", "-o", "b.exr", "--preset", "best"],
        ["render", "a.blend", "-o", "b.exr", "--exposure", "0"],
        ["render", "a.blend", "-o", "b.exr", "--memory-limit", "much"],
        ["evaluate", "a.blend", "--windows", "w", "--references", "r", "--scale", "x"],
        ["evaluate", "a.blend", "--windows", "w", "--references", "r", "--guides", "x"],
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
        "--scale 4 --samples 9 --memory-limit 2G --exposure 0.5 --seed 7 --resume"
    )
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
    assert (options.guides, options.preset, options.plain, options.json) == (
        "fast",
        "fast",
        False,
        False,
    )


def test_evaluate_lists() -> None:
    options = parse(
        "evaluate a b --windows w --references r "
        "--scale 2,4 --preset fast,balanced --guides fast,full"
    )
    assert options.scenes == [Path("a"), Path("b")]
    assert options.scale == (2, 4)
    assert options.preset == ("fast", "balanced")
    assert options.guides == ("fast", "full")


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


def test_a_reader_that_leaves_early_is_no_fault() -> None:
    code = """
    import sys
    from xrds_blender.command import console
    def work():
        for _ in range(100_000):
            print("a line")
    sys.exit(console.status_of(work))
    """
    with started(code) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == "a line\n"
        child.stdout.close()
        assert child.stderr is not None
        assert not child.stderr.read()
    assert child.returncode == 1


def test_json_has_stdout_to_itself() -> None:
    done = run(
        """
        import ctypes, os
        from xrds_blender.command import console
        with console.stdout_for_json() as write:
            print("Fra:1 from Python")
            ctypes.CDLL(None).puts(b"Fra:1 from C")
            os.write(1, b"Fra:1 from the kernel\\n")
            write({"answer": 42})
        """
    )
    assert json.loads(done.stdout) == {"answer": 42}
    assert done.stderr.count("Fra:1") == 3


def test_no_json_when_the_work_fails(tmp_path: Path) -> None:
    beauty, out = str(tmp_path / "missing.exr"), str(tmp_path / "out.exr")
    weights = tmp_path / file_name("fast", 2)
    save(XRDS(preset_config("fast", 2)), weights, {})
    words = ["upscale", beauty, beauty, "-o", out, "--weights", str(weights)]
    done = run(MAIN, *words, "--json")
    assert done.returncode == 1
    assert not done.stdout
    assert done.stderr.startswith("xrds: ")
    assert "missing.exr" in done.stderr


@pytest.mark.timeout(300)
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
    from xrds_core.atomic import replacing
    console.end_at_once_by_signals()
    libc = ctypes.CDLL(None)
    with replacing(Path({str(tmp_path)!r}) / "frame.exr") as part:
        part.write_text("half")
        print("ready", flush=True)
        for _ in range(100):
            libc.usleep(900_000)
    """
    with started(code) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == "ready\n"
        start = time.perf_counter()
        number = signal.Signals[name]
        child.send_signal(number)
        _, err = child.communicate(timeout=20)
    assert child.returncode == 128 + number
    assert err == f"xrds: {told}\n"
    assert time.perf_counter() - start < 10
    assert not list(tmp_path.iterdir())
