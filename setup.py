"""The version and the C core of each build; all else is in pyproject.toml.

The version stands in blender_manifest.toml alone.

XRDS_PLATFORMS names the platforms that a wheel holds libraries for, as
`linux-x64,windows-x64` or `all`; without it, it is the one that this runs on.
XRDS_LIBRARIES names a folder where they lie already, and nothing is compiled.
"""

from __future__ import annotations

import os
import shutil
import sys
import tomllib
from pathlib import Path
from typing import ClassVar

from setuptools import Command, Distribution, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build import build

ROOT = Path(__file__).resolve().parent
sys.path.insert(0, str(ROOT))

from xrds_core.native.compile import (  # noqa: E402
    LIBRARIES,
    PLATFORMS,
    CompileError,
    chosen,
    compile_libraries,
    library_name,
    sources,
)


class Compiled(Distribution):
    """Told to be for a platform: its wheel would hold its files apart otherwise."""

    def has_ext_modules(self) -> bool:
        return True


class Native(Command):
    """Compile the libraries into what is built; into the source tree if editable."""

    description = "compile the C core"
    user_options: ClassVar = []

    def initialize_options(self) -> None:
        self.build_lib: str | None = None
        self.editable_mode = False

    def finalize_options(self) -> None:
        self.set_undefined_options("build", ("build_lib", "build_lib"))

    def run(self) -> None:
        folder = LIBRARIES
        if not self.editable_mode:
            folder = Path(self.build_lib or "") / LIBRARIES.relative_to(ROOT)
            # the folder of an earlier build, maybe for other platforms
            shutil.rmtree(folder, ignore_errors=True)
        if made := os.environ.get("XRDS_LIBRARIES"):
            self.mkpath(str(folder))
            for name in map(library_name, wanted()):
                shutil.copy(Path(made) / name, folder)
        else:
            compile_libraries(wanted(), folder)

    def get_source_files(self) -> list[str]:
        return [str(path.relative_to(ROOT)) for path in sources()]

    def get_outputs(self) -> list[str]:
        return []

    def get_output_mapping(self) -> dict[str, str]:
        return {}


class Build(build):
    """Compile beside all else."""

    sub_commands: ClassVar = [*build.sub_commands, ("native", None)]


class Wheel(bdist_wheel):
    """A wheel for any Python 3: the core is loaded as a library, not as a module."""

    def get_tag(self) -> tuple[str, str, str]:
        tags = [PLATFORMS[name].tag for name in wanted()]
        everywhere = len(tags) == len(PLATFORMS)
        return "py3", "none", "any" if everywhere else ".".join(sorted(tags))


def wanted() -> list[str]:
    """The platforms to compile for."""
    return chosen(os.environ.get("XRDS_PLATFORMS"))


try:
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text("utf-8"))
    setup(
        version=manifest["version"],
        distclass=Compiled,
        cmdclass={"build": Build, "native": Native, "bdist_wheel": Wheel},
    )
except CompileError as error:
    sys.exit(f"error: {error}")
