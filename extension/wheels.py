"""The wheels that a platform's Blender needs, asked of the package index.

Wheels are taken as the index has them, with what they depend on; numpy is Blender's.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

BLENDERS_OWN = {"numpy"}
# For Linux PyPI has PyTorch with all of CUDA; PyTorch's own index has its CPU build.
CPU_INDEX = ("--extra-index-url", "https://download.pytorch.org/whl/cpu")
# What only a build for graphics cards depends on: a CPU build needs none of it.
GPU_PARTS = ("nvidia", "cuda", "triton", "pytorch-triton", "rocm")


class NoCpuBuild(Exception):
    """The index holds torch for a target, but no build for processors alone."""


@dataclass(frozen=True)
class Target:
    """A platform of Blender and the Python inside it."""

    platform: str
    """Blender's name of it."""
    python: str
    """As 3.11."""
    tags: tuple[str, ...]
    """Pip's names of the platform, the newest first."""
    system: tuple[str, str, str]
    """What markers call platform_system, sys_platform and platform_machine."""

    @property
    def name(self) -> str:
        """As linux_x64-cp311, for file names."""
        abi = f"cp{self.python.replace('.', '')}"
        return f"{self.platform.replace('-', '_')}-{abi}"

    def needs(self, requirement: Requirement) -> bool:
        """Whether a dependency applies to this target."""
        system, sys_platform, machine = self.system
        environment = {
            "python_version": self.python,
            "python_full_version": f"{self.python}.0",
            "implementation_name": "cpython",
            "platform_python_implementation": "CPython",
            "platform_system": system,
            "sys_platform": sys_platform,
            "platform_machine": machine,
            "os_name": "nt" if system == "Windows" else "posix",
            "extra": "",
        }
        return requirement.marker is None or requirement.marker.evaluate(environment)

    def options(self) -> list[str]:
        """Pip's options that ask for this target's wheels and nothing else."""
        platforms = [word for tag in self.tags for word in ("--platform", tag)]
        own = ["--python-version", self.python, "--only-binary", ":all:", "--no-deps"]
        return [*own, *platforms]

    def index(self, names: Iterable[str]) -> list[str]:
        """Pip's options for where packages of these names are."""
        of_cpu = self.system[0] == "Linux" and "torch" in names
        return list(CPU_INDEX) if of_cpu else []


_LINUX = tuple(f"manylinux_2_{minor}_x86_64" for minor in (28, 27, 24, 17, 12, 5))
_MACOS = tuple(f"macosx_{major}_0_arm64" for major in (14, 13, 12, 11))
PLATFORMS = {
    "linux-x64": (
        (*_LINUX, "manylinux2014_x86_64"),
        ("Linux", "linux", "x86_64"),
    ),
    "windows-x64": (("win_amd64",), ("Windows", "win32", "AMD64")),
    "macos-arm64": (
        (*_MACOS, "macosx_11_0_universal2", "macosx_10_9_universal2"),
        ("Darwin", "darwin", "arm64"),
    ),
}


def targets(platforms: list[str], pythons: list[str]) -> list[Target]:
    """Every pair of the named platforms and Pythons."""
    return [
        Target(name, python, *PLATFORMS[name])
        for name in platforms
        for python in pythons
    ]


def resolve(target: Target, wanted: list[str]) -> list[str]:
    """Pinned requirements of all that `wanted` needs on the target, numpy left out.

    Raises NoCpuBuild where the index has torch with parts for graphics cards only,
    LookupError where it has no wheel at all.
    """
    pins: dict[str, str] = {}
    waiting = [Requirement(text) for text in wanted]
    while waiting:
        requirement = waiting.pop()
        name = canonicalize_name(requirement.name)
        if name in pins or name in BLENDERS_OWN or not target.needs(requirement):
            continue
        if name.startswith(GPU_PARTS):
            raise NoCpuBuild(f"torch for {target.name} needs {name}")
        metadata = _look_up(target, requirement)
        pins[name] = f"{name}=={metadata['version']}"
        waiting += [Requirement(text) for text in metadata.get("requires_dist", ())]
    return sorted(pins.values())


def download(target: Target, pins: list[str], folder: Path) -> list[Path]:
    """Fetch the wheels of `pins` into `folder` and return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    where = target.index(pin.partition("==")[0] for pin in pins)
    _pip("download", *target.options(), *where, "--dest", str(folder), *pins)
    return sorted(folder.glob("*.whl"))


def _look_up(target: Target, requirement: Requirement) -> dict[str, Any]:
    """The metadata of the wheel that pip would take; nothing is fetched."""
    options = ["--dry-run", "--ignore-installed", "--target", "none", "--report", "-"]
    text = f"{requirement.name}{requirement.specifier}"
    words = [*options, *target.options(), *target.index([requirement.name]), text]
    report = json.loads(_pip("install", *words))
    metadata: dict[str, Any] = report["install"][0]["metadata"]
    return metadata


def _pip(*words: str) -> str:
    command = [sys.executable, "-P", "-m", "pip", *words, "--quiet"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        errors = [ln for ln in done.stderr.splitlines() if ln.startswith("ERROR")]
        raise LookupError((errors or [done.stderr.strip()])[-1])
    return done.stdout
