"""The Flamenco job types of docs/pipeline, compiled as Flamenco's Manager does."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

JOB_TYPES = Path(__file__).resolve().parents[2] / "docs" / "pipeline"
# What the Manager gives a job type: chunks of frames, tasks, commands.
MANAGER = """
const author = {
    Task: (name, type) => ({ name, type, commands: [], dependencies: [],
        addCommand(command) { this.commands.push(command); },
        addDependency(task) { this.dependencies.push(task.name); } }),
    Command: (name, parameters) => ({ name, parameters }),
};
function frameChunker(frames, size) {
    const all = [];
    for (const part of frames.split(",")) {
        const [first, last = first] = part.trim().split("-").map(Number);
        for (let frame = first; frame <= last; frame++) all.push(frame);
    }
    const chunks = [];
    for (let i = 0; i < all.length; i += size) {
        const chunk = all.slice(i, i + size);
        const range = chunk.length > 1 && chunk.at(-1) - chunk[0] === chunk.length - 1;
        chunks.push(range ? `${chunk[0]}-${chunk.at(-1)}` : chunk.join(","));
    }
    return chunks;
}
"""


def compile_job(
    settings: dict[str, Any], job_type: str = "xrds_render"
) -> list[dict[str, Any]]:
    """The tasks of a job with these settings; skips the test where there is no node."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("no node to run the job type with")
    asks = f"""
const tasks = [];
compileJob({{ settings: {json.dumps(settings)}, addTask: (task) => tasks.push(task) }});
console.log(JSON.stringify({{ tasks, type: JOB_TYPE }}));
"""
    script = MANAGER + (JOB_TYPES / f"{job_type}.flamenco.js").read_text() + asks
    done = subprocess.run(
        [node, "-e", script], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    keys = {setting["key"] for setting in told["type"]["settings"]}
    assert settings.keys() <= keys
    return told["tasks"]  # type: ignore[no-any-return]
