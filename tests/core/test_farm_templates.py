"""The farm examples of docs/farms.md, read by what reads them on a farm."""

from __future__ import annotations

import importlib
import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import pytest
from flamenco import compile_job

from xrds_blender.command import main
from xrds_core.frames import RADIUS

EXAMPLES = Path(__file__).resolve().parents[2] / "docs" / "pipeline"
TEMPLATE = EXAMPLES / "xrds_render.template.yaml"
SHOT = EXAMPLES / "xrds_shot.template.yaml"
OPENJD = str(Path(sys.executable).with_name("openjd"))


@pytest.mark.parametrize("path", sorted(EXAMPLES.iterdir()), ids=lambda p: p.name)
def test_the_frames_of_a_chunk_lend_each_other_samples(path: Path) -> None:
    """Nine of ten neighbours are in the same chunk; of 8 frames 72 % are."""
    given = r"chunk.{0,60}?default(?:=|: *)(\d+)"
    (text,) = re.findall(given, path.read_text("utf-8"), re.IGNORECASE | re.DOTALL)
    size = int(text)
    there = sum(
        min(frame, RADIUS) + 1 + min(size - 1 - frame, RADIUS) for frame in range(size)
    )
    assert there / (size * (2 * RADIUS + 1)) > 0.9


@pytest.mark.parametrize("template", [TEMPLATE, SHOT], ids=lambda path: path.stem)
def test_open_job_description_accepts_the_template(template: Path) -> None:
    pytest.importorskip("openjd.cli")
    command = [OPENJD, "check", str(template)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "passes validation" in done.stdout


def test_the_check_asks_xrds_for_what_there_is() -> None:
    """Its progress comes from a module of ours, which may move and be renamed."""
    text = TEMPLATE.read_text("utf-8")
    ((package, name),) = re.findall(r"from (xrds_blender[\w.]*) import (\w+)", text)
    module = importlib.import_module(f"{package}.{name}")
    asked = re.findall(rf"\b{name}\.(\w+)", text)
    assert asked
    for each in asked:
        assert callable(getattr(module, each))


def test_progress_is_that_of_all_frames(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two animations, of 4 frames and of 1; it never falls, and ends at 100."""
    yaml = pytest.importorskip("yaml")
    bpy = MagicMock()
    scene, handlers = bpy.context.scene, bpy.app.handlers
    scene.render.engine, handlers.render_stats = "XRDS", []
    now: dict[str, Any] = {"text": None, "part": None}
    stages = SimpleNamespace(current=lambda: now["text"], progress=lambda: now["part"])
    package = SimpleNamespace(stages=stages)
    monkeypatch.setitem(sys.modules, "bpy", bpy)
    monkeypatch.setitem(sys.modules, "xrds_blender.rendering", package)
    files = yaml.safe_load(TEMPLATE.read_text("utf-8"))["steps"][0]["script"]
    code = files["embeddedFiles"][0]["data"].replace("{{Task.Param.Frame}}", "11-14,9")

    def render(animation: bool) -> set[str]:
        (note,) = handlers.render_stats
        for part in (0.0, 0.5, 0.4, 0.75):
            now.update(text="XRDS: frame 12 of 14, samples", part=part)
            note("Sample 1/2")
        now.update(text=None, part=None)
        note("")
        return {"FINISHED"}

    bpy.ops.render.render = render
    exec(code, {})  # noqa: S102  # the template is ours
    out = capsys.readouterr().out
    told = [float(x) for x in re.findall(r"openjd_progress: ([\d.]+)", out)]
    assert told == [40.0, 60.0, 80.0, 90.0, 95.0, 100.0]
    assert out.count("openjd_status: XRDS: frame 12 of 14, samples") == 8


RENDER_JOB = {
    "frames": "1-3, 7-10",
    "chunk_size": 3,
    "blendfile": "/shots/a.blend",
    "render_output_path": "/out/######",
    "format": "OPEN_EXR",
}


@pytest.fixture(scope="module")
def tasks() -> list[dict[str, Any]]:
    """The tasks that the Flamenco job type makes of seven frames in chunks of three."""
    return compile_job(RENDER_JOB)


def test_flamenco_renders_every_chunk(tasks: list[dict[str, Any]]) -> None:
    assert [task["name"] for task in tasks] == ["render-1-3", "render-7-9", "render-10"]
    (command,) = tasks[1]["commands"]
    args = command["parameters"]["args"]
    assert command["name"] == "blender-render"
    told = "--frame-start 7 --frame-end 9 --frame-jump 1 --render-anim"
    assert args[-7:] == told.split()  # of single frames none would lend to another
    assert args[args.index("--render-output") + 1] == "/out/######"


@pytest.mark.parametrize(
    ("frames", "animations"),
    [
        ("10", [(10, 10, 1)]),
        ("1,3,5,7", [(1, 7, 2)]),
        ("1-3, 8, 10, 12", [(1, 3, 1), (8, 12, 2)]),
        ("3, 8-10", [(3, 3, 1), (8, 10, 1)]),
        ("1-2, 20", [(1, 2, 1), (20, 20, 1)]),
    ],
)
def test_flamenco_renders_frames_with_steps_as_animations(
    frames: str, animations: list[tuple[int, int, int]]
) -> None:
    """Frames of -f lend each other nothing."""
    (task,) = compile_job(RENDER_JOB | {"frames": frames, "chunk_size": 24})
    words = task["commands"][0]["parameters"]["args"]
    told = " ".join(words[words.index("--frame-start") :]).split("--render-anim")
    wanted = [
        f"--frame-start {a} --frame-end {b} --frame-jump {c}" for a, b, c in animations
    ]
    assert [x.strip() for x in told[:-1]] == wanted


def test_flamenco_asks_for_the_engine_before_it_renders(
    tasks: list[dict[str, Any]],
) -> None:
    """The check is Python that ends with status 3 without XRDS, and goes on with it."""
    args = tasks[0]["commands"][0]["parameters"]["args"]
    check = args[args.index("--python-expr") + 1]
    assert args.index("--python-exit-code") < args.index("--python-expr")
    assert args.index("--python-expr") < args.index("--render-anim")
    for engine, there, status in (
        ("XRDS", True, 0),
        ("BLENDER_EEVEE", True, 3),
        ("XRDS", False, 3),
    ):
        assert status_of(check, engine, there) == status


def status_of(check: str, engine: str, there: bool) -> int:
    code = f"""
import sys
from types import SimpleNamespace as N
types = N(RenderEngine=N(bl_rna_get_subclass_py=lambda name: {there}))
scene = N(render=N(engine={engine!r}))
sys.modules["bpy"] = N(types=types, context=N(scene=scene))
exec({check!r})
"""
    done = subprocess.run(
        [sys.executable, "-c", code], check=False, capture_output=True
    )
    return done.returncode


# --- shots ----------------------------------------------------------------------------


def parsed(args: list[str]) -> Any:
    """What our own command understands of Blender's words; fails for wrong ones."""
    at = args.index("--command")
    assert args[at + 1] == "xrds"
    return main._parser(args[at + 2 :]).parse_args(args[at + 2 :])


def test_a_flamenco_shot_renders_apart_and_is_denoised_as_one() -> None:
    settings = {
        "frames": "1-20",
        "chunk_size": 4,
        "temporal_radius": 3,
        "blendfile": "/shots/a.blend",
        "render_output_path": "/out/######.exr",
        "samples_path": "/out/samples",
    }
    tasks = compile_job(settings, "xrds_shot")
    asked = [parsed(each["commands"][0]["parameters"]["args"]) for each in tasks]
    renders, denoised = asked[:5], asked[5:]
    for each in renders:
        assert (each.command, each.scale, each.out) == ("render", 1, None)
        assert each.sample_cache == Path("/out/samples")
    assert [each.frames[0] for each in renders] == [1, 5, 9, 13, 17]
    for each in denoised:
        assert each.source == f"{renders[0].sample_cache}/####.exr"
        assert each.out == "/out/######.exr"
        assert each.picture_only
        assert each.temporal_radius == renders[0].temporal_radius == 3
    assert [each.frames for each in denoised] == [each.frames for each in renders]
    # each waits for all frames that lend to its own
    for task, frames in zip(tasks[5:], [each.frames for each in denoised], strict=True):
        waits = [
            renders[int(tasks.index(t))]
            for t in tasks
            if t["name"] in task["dependencies"]
        ]
        rendered = {n for each in waits for n in each.frames}
        needed = {n for f in frames for n in range(f - 3, f + 4) if 1 <= n <= 20}
        assert needed <= rendered


def test_an_open_job_shot_runs_in_chunks(tmp_path: Path) -> None:
    """Run as a farm runs it, with a stand-in for Blender that notes what it is told."""
    pytest.importorskip("openjd.cli")
    notes, worker = tmp_path / "notes", tmp_path / "blender.sh"
    worker.write_text(f'#!/bin/bash\necho "$@" >> {notes}\n')
    worker.chmod(0o755)
    told = {
        "BlendFile": tmp_path / "a.blend",
        "Frames": "1-20",
        "ChunkSize": 10,
        "SamplesFolder": tmp_path / "samples",
        "OutputFolder": tmp_path / "out",
        "Blender": worker,
    }
    words = [word for k, v in told.items() for word in ("-p", f"{k}={v}")]
    command = [OPENJD, "run", str(SHOT), "--step", "Denoise", "--run-dependencies"]
    done = subprocess.run(
        [*command, *words], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    asked = [parsed(line.split()) for line in notes.read_text().splitlines()]
    assert [each.command for each in asked] == ["render"] * 2 + ["denoise"] * 2
    for each in (asked[:2], asked[2:]):
        assert [x.frames[0] for x in each] == [1, 11]
        assert [n for x in each for n in x.frames] == list(range(1, 21))
    assert asked[0].sample_cache == tmp_path / "samples"
    assert asked[2].source == f"{tmp_path}/samples/####.exr"


@pytest.mark.parametrize(
    ("frames", "chunk", "animations"),
    [
        ("8-12", 3, ["8 10 1", "11 12 1"]),
        ("1-10:2", 24, ["1 9 2"]),
        ("1-10:2", 3, ["1 5 2", "7 9 2"]),
        ("1-3,7-9", 24, ["1 3 1", "7 9 1"]),
        ("-2-1", 24, ["-2 1 1"]),
    ],
)
def test_an_open_job_renders_chunks_as_animations(
    frames: str, chunk: int, animations: list[str], tmp_path: Path
) -> None:
    """Its script, run with a stand-in for bpy that notes each animation."""
    pytest.importorskip("openjd.cli")
    worker = tmp_path / "blender.sh"
    worker.write_text(
        "#!/bin/bash\n"
        f'while [ "$1" != --python ]; do shift; done\n'
        f"{sys.executable} {tmp_path}/stand_in.py $2 >> {tmp_path}/animations\n"
    )
    worker.chmod(0o755)
    (tmp_path / "stand_in.py").write_text(
        "import runpy, sys\n"
        "from unittest.mock import MagicMock\n"
        "bpy = sys.modules['bpy'] = MagicMock()\n"
        "scene = bpy.context.scene\n"
        "scene.render.engine = 'XRDS'\n"
        "def render(animation):\n"
        "    print(scene.frame_start, scene.frame_end, scene.frame_step)\n"
        "    return {'FINISHED'}\n"
        "bpy.ops.render.render = render\n"
        "runpy.run_path(sys.argv[1])\n"
    )
    told = {
        "BlendFile": tmp_path / "a.blend",
        "Frames": frames,
        "ChunkSize": chunk,
        "OutputFolder": tmp_path / "out",
        "Blender": worker,
    }
    words = [word for k, v in told.items() for word in ("-p", f"{k}={v}")]
    done = subprocess.run(
        [OPENJD, "run", str(TEMPLATE), "--step", "Render", *words],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    lines = (tmp_path / "animations").read_text().splitlines()
    assert [x for x in lines if not x.startswith("openjd_")] == animations
    assert lines[-1] == "openjd_progress: 100.0"


# --- Deadline -------------------------------------------------------------------------

DEADLINE = EXAMPLES / "xrds_shot.deadline.py"
# Stands in for Deadline's own command: notes the files it is given, and names the job.
DEADLINE_COMMAND = """#!/bin/bash
n=$(ls {notes} | wc -l)
mkdir {notes}/$n
cp "$1" {notes}/$n/job
cp "$2" {notes}/$n/plugin
echo Deadline Command 10; echo "JobID=id-$n"
"""


def submitted(tmp_path: Path, *words: str) -> list[dict[str, str]]:
    """What Deadline gets for a shot, job and plugin of each as one table."""
    notes, command = tmp_path / "notes", tmp_path / "bin" / "deadlinecommand"
    notes.mkdir()
    command.parent.mkdir()
    command.write_text(DEADLINE_COMMAND.format(notes=notes))
    command.chmod(0o755)
    shot = ["/shots/a.blend", "--frames", "1-20", "--samples", "/out/my samples"]
    subprocess.run(
        [sys.executable, str(DEADLINE), *shot, "--out", "/out/####.exr", *words],
        env={"PATH": f"{command.parent}:/usr/bin:/bin"},
        check=True,
    )
    found = []
    for number in sorted(notes.iterdir()):
        text = "".join((number / kind).read_text() for kind in ("job", "plugin"))
        found.append(dict(line.split("=", 1) for line in text.splitlines()))
    return found


def of_task(job: dict[str, str], first: int, last: int) -> Any:
    """What our command understands of one task, its words filled in by Deadline."""
    words = job["Arguments"].replace("<STARTFRAME>", str(first))
    words = words.replace("<ENDFRAME>", str(last)).replace("<QUOTE>", '"')
    return parsed(shlex.split(words))


@pytest.mark.skipif(os.name == "nt", reason="the stand-in is a shell script")
def test_a_deadline_frame_waits_for_all_that_lend_to_it(tmp_path: Path) -> None:
    samples, frames = submitted(tmp_path, "--temporal-radius", "3", "--chunk", "4")
    assert samples["ChunkSize"] == frames["ChunkSize"] == "4"
    assert samples["Frames"] == frames["Frames"] == "1-20"
    assert frames["JobDependencies"] == "id-0"
    assert frames["IsFrameDependent"] == "true"
    reach = [int(frames[f"FrameDependencyOffset{x}"]) for x in ("Start", "End")]
    chunks = [(n, n + 3) for n in range(1, 20, 4)]
    rendered = {chunk: of_task(samples, *chunk) for chunk in chunks}
    for chunk in chunks:
        asked = of_task(frames, *chunk)
        assert asked.source == "/out/my samples/####.exr"
        assert asked.temporal_radius == rendered[chunk].temporal_radius == 3
        # Deadline: frames first + start to last + end of the other job must be done
        waits = {
            n
            for each in rendered.values()
            for n in each.frames
            if chunk[0] + reach[0] <= n <= chunk[1] + reach[1]
        }
        needed = {n for f in asked.frames for n in range(f - 3, f + 4) if 1 <= n <= 20}
        assert needed == waits
    assert of_task(samples, 1, 4).sample_cache == Path("/out/my samples")


# --- hostile names --------------------------------------------------------------------

HOSTILE = {
    "line break": "shot\nPostJobScript=evil.py\nBatchName=x",
    "carriage return": "shot\rPostJobScript=evil.py",
    "line separator": "shot\u2028PostJobScript=evil.py",
    "next line": "shot\x85PostJobScript=evil.py",
    "quote": 'a" --python evil.py "',
    "Deadline's quote": "a<QUOTE> --python evil.py <QUOTE>",
    "Deadline's frame": "a<STARTFRAME>",
}
HARMLESS = {
    "spaces": "my shot",
    "single quote": "it's",
    "key": "PostJobScript=evil.py",
    "shell": "a;b $(c) `d` & e | f",
    "accents": "é ü 日本",
    "percent": "%PATH% {{Param.Blender}} ${HOME}",
}


def deadline_files(folder: Path, **changed: str) -> tuple[int, str, list[str]]:
    """Status, what is said, and the lines of all files of a dry run."""
    told = {"frames": "1-4", "samples": "/out/s", "out": "/out/####.exr"} | changed
    blend = told.pop("blend", "a.blend")
    words = [w for k, v in told.items() for w in (f"--{k}", v)]
    command = [sys.executable, str(DEADLINE), blend, *words]
    done = subprocess.run(
        [*command, "--dry-run", "--folder", str(folder)],
        capture_output=True,
        text=True,
        check=False,
    )
    written = "".join(x.read_text("utf-8") for x in sorted(folder.iterdir()))
    return done.returncode, done.stderr, written.splitlines()


@pytest.mark.parametrize("option", ["blend", "samples", "out", "blender", "frames"])
@pytest.mark.parametrize("name", HOSTILE.values(), ids=HOSTILE)
def test_a_hostile_name_adds_nothing_to_deadlines_files(
    name: str, option: str, tmp_path: Path
) -> None:
    status, said, lines = deadline_files(tmp_path, **{option: f"/x/{name}.blend"})
    assert (status, lines) == (1, [])
    assert len(said.splitlines()) == 1


@pytest.mark.parametrize("name", HARMLESS.values(), ids=HARMLESS)
def test_an_odd_name_is_one_word_for_deadline(name: str, tmp_path: Path) -> None:
    plain = deadline_files(tmp_path)[2]
    blend = f"/x/{name}.blend"
    status, said, lines = deadline_files(
        tmp_path, blend=blend, samples=f"/out/{name}/", out=f"/out/{name}/####.exr"
    )
    assert (status, said) == (0, "")
    keys = [line.partition("=")[0] for line in plain]
    assert [line.partition("=")[0] for line in lines] == keys
    words = [x.partition("=")[2] for x in lines if x.startswith("Arguments=")]
    denoise, render = (shlex.split(x.replace("<QUOTE>", '"')) for x in words)
    assert blend in render
    assert render[-1] == f"/out/{name}"
    assert f"/out/{name}/####.exr" in denoise


@pytest.mark.parametrize("frames", ["junk", "1-10x2", "1-10:2", "", "1-"])
def test_frames_that_deadline_would_take_one_by_one_are_refused(
    frames: str, tmp_path: Path
) -> None:
    status, said, lines = deadline_files(tmp_path, frames=frames)
    assert (status, lines) == (1, [])
    assert "give consecutive frames" in said


@pytest.mark.parametrize("name", [*HOSTILE.values(), *HARMLESS.values()])
def test_any_name_is_one_word_for_flamenco(name: str) -> None:
    blend, out = f"/x/{name}.blend", f"/out/{name}/######"
    told = {"blendfile": blend, "render_output_path": out}
    for task in compile_job(RENDER_JOB | told):
        parameters = task["commands"][0]["parameters"]
        assert parameters["blendfile"] == blend
        args = parameters["args"]
        assert args[args.index("--render-output") + 1] == out
        assert not any(name in x for x in args if x != out)
    settings = {"frames": "1-4", "chunk_size": 4, "temporal_radius": 2}
    settings |= {**told, "samples_path": f"/out/{name}/samples"}
    render, denoise = (
        parsed(task["commands"][0]["parameters"]["args"])
        for task in compile_job(settings, "xrds_shot")
    )
    assert str(render.scene) == blend
    assert (denoise.source, denoise.out) == (f"/out/{name}/samples/####.exr", out)


@pytest.mark.parametrize("name", [*HOSTILE.values(), *HARMLESS.values()])
def test_any_name_is_one_word_for_open_job_description(
    name: str, tmp_path: Path
) -> None:
    """Run with a stand-in for Blender that notes each word; or refused as a whole."""
    pytest.importorskip("openjd.cli")
    notes, worker = tmp_path / "notes", tmp_path / "blender.py"
    worker.write_text(
        f"#!{sys.executable}\nimport json, sys\n"
        f"with open({str(notes)!r}, 'a') as file:\n"
        "    print(json.dumps(sys.argv[1:]), file=file)\n"
    )
    worker.chmod(0o755)
    blend = str(tmp_path / f"{name}.blend")
    told = {"BlendFile": blend, "Frames": "1-4", "Blender": str(worker)}
    told |= {"SamplesFolder": str(tmp_path / name), "OutputFolder": str(tmp_path / "o")}
    words = [word for k, v in told.items() for word in ("-p", f"{k}={v}")]
    command = [OPENJD, "run", str(SHOT), "--step", "Samples", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:  # control characters in a job's name
        assert not name.isprintable()
        assert not notes.exists()
        return
    (line,) = notes.read_text().splitlines()
    args = json.loads(line)
    assert args[:4] == ["--command", "xrds", "render", blend]
    assert args[-1] == str(tmp_path / name)
    assert len(args) == 10


@pytest.mark.skipif(os.name == "nt", reason="the stand-in is a shell script")
def test_a_deadline_that_takes_no_job_is_one_line(tmp_path: Path) -> None:
    command = tmp_path / "deadlinecommand"
    command.write_text("#!/bin/bash\necho Error: no repository >&2; exit 1\n")
    command.chmod(0o755)
    words = ["a.blend", "--frames", "1", "--samples", "s", "--out", "####.exr"]
    done = subprocess.run(
        [sys.executable, str(DEADLINE), *words],
        env={"PATH": f"{tmp_path}:/usr/bin:/bin"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert done.stderr.strip() == "Deadline took no job: Error: no repository"
