"""Submit a shot of a .blend file to Deadline 10: samples in chunks, then the frames.

    python3 xrds_shot.deadline.py /shots/a.blend --frames 1-48 \
        --samples /out/samples --out '/out/####.exr'

Two jobs of the plugin CommandLine. A task of the second one, frames, waits for those
tasks of the first one that render its frames and their neighbours: Deadline shifts the
frames that it depends on by the temporal radius. So a frame is finished as soon as its
neighbours are there. Paths must be those that all workers see. Needs `deadlinecommand`
in the PATH; `--dry-run` writes the files and submits nothing.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
from pathlib import Path

# A word that every parser of command lines takes as it is.
PLAIN = re.compile(r"[\w@%+=:,./\\<>~-]+")


def checked(words: argparse.Namespace) -> None:
    """End the program for what Deadline's files cannot hold.

    They have one key=value a line, and Deadline fills in what stands in <>.
    """
    for name, value in vars(words).items():
        text = str(value)
        if not text.isprintable() or re.search(r'["<>]', text):
            what = f"--{name.replace('_', '-')} {text!r}"
            sys.exit(f'{what} holds a line break, ", < or >: rename it')
    if not re.fullmatch(r"-?\d+(--?\d+)?(,-?\d+(--?\d+)?)*", words.frames):
        # Deadline makes a task of each frame of a range with steps: none has neighbours
        sys.exit(f"--frames {words.frames}: give consecutive frames, as 1-48 or 1-9,20")
    if words.folder and not words.folder.is_dir():
        sys.exit(f"--folder {words.folder}: there is no such folder")


def job(
    name: str, frames: str, chunk: int, arguments: list[str], blender: str
) -> tuple[dict[str, str], dict[str, str]]:
    """Return the job info and plugin info of one job."""
    words = ["--background", "--command", "xrds", *arguments]
    about = {
        "Plugin": "CommandLine",
        "Name": name,
        "Frames": frames,
        "ChunkSize": str(chunk),
    }
    quoted = (x if PLAIN.fullmatch(x) else f"<QUOTE>{x}<QUOTE>" for x in words)
    return about, {
        "Executable": blender,
        "Arguments": " ".join(quoted),
        "Shell": "none",
    }


def submit(
    folder: Path, info: dict[str, str], plugin: dict[str, str], is_dry: bool
) -> str:
    """Write both files of a job and submit them; returns Deadline's number of it."""
    paths = []
    for kind, lines in (("job", info), ("plugin", plugin)):
        path = folder / f"{info['Name'].rsplit(' ', 1)[-1]}.{kind}"
        path.write_text("".join(f"{k}={v}\n" for k, v in lines.items()), "utf-8")
        paths.append(str(path))
    if is_dry:
        print("\n".join(paths))
        return "ID-OF-SAMPLES"
    done = subprocess.run(
        ["deadlinecommand", *paths], capture_output=True, text=True, check=False
    )
    found = re.search(r"^JobID=(\S+)", done.stdout, re.MULTILINE)
    if done.returncode or not found:
        sys.exit(f"Deadline took no job: {(done.stdout + done.stderr).strip()}")
    return found[1]


def main() -> None:
    """Submit both jobs of the shot on the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    add = parser.add_argument
    add("blend")
    add("--frames", required=True, metavar="1-48")
    add("--samples", required=True, help="folder of the frames' samples")
    add("--out", required=True, help="pattern of the frames, as /out/####.exr")
    add("--temporal-radius", type=int, default=4)
    add("--chunk", type=int, default=24, help="frames of one task")
    add("--blender", default="blender")
    add("--folder", type=Path, help="where the jobs' files are written")
    add("--dry-run", action="store_true")
    options = parser.parse_args()
    checked(options)
    # before a closing quote a backslash would quote that
    options.samples = options.samples.rstrip("/\\") or options.samples
    folder = options.folder or Path(tempfile.mkdtemp())
    name, radius = Path(options.blend).stem, options.temporal_radius
    both = ["--frames", "<STARTFRAME>-<ENDFRAME>", "--temporal-radius", str(radius)]
    render = ["render", options.blend, *both]
    render += ["--sample-cache", options.samples]
    finish = ["denoise", f"{options.samples}/####.exr", "--out", options.out, *both]
    finish += ["--picture-only", "--resume"]
    info, plugin = job(
        f"{name} samples", options.frames, options.chunk, render, options.blender
    )
    first = submit(folder, info, plugin, options.dry_run)
    info, plugin = job(
        f"{name} frames", options.frames, options.chunk, finish, options.blender
    )
    info |= {
        "JobDependencies": first,
        "IsFrameDependent": "true",
        "FrameDependencyOffsetStart": str(-radius),
        "FrameDependencyOffsetEnd": str(radius),
        # a frame whose neighbours failed is finished from those that are there
        "ResumeOnFailedDependencies": "true",
    }
    print(first, submit(folder, info, plugin, options.dry_run))


if __name__ == "__main__":
    main()
