"""Which PyTorch renders: the bundled one, Python's own, or that of a folder.

The folder is one that `pip install --target FOLDER torch safetensors` filled. It is
judged by its files, before anything of it is loaded; only `load` imports torch.
"""

from __future__ import annotations

import ast
import importlib
import sys
from dataclasses import dataclass
from importlib.machinery import EXTENSION_SUFFIXES, PathFinder
from importlib.util import find_spec
from pathlib import Path
from typing import Any, cast

from xrds_core.errors import GET_NETWORK, UsageError, XRDSError

from ..internals.lifetimes import PROCESS

NEEDED = {"torch": "PyTorch", "safetensors": "safetensors"}
CPU_INDEX = (
    "--index-url https://download.pytorch.org/whl/cpu "
    "--extra-index-url https://pypi.org/simple"
)


@dataclass(frozen=True)
class Torch:
    """A PyTorch on disk: its version, what it was built for, and where it lies."""

    version: str
    build: str
    folder: Path


@dataclass
class _Chosen:
    """The folder that is looked into first, if any."""

    folder: Path | None = None


def inspect(folder: Path) -> Torch:
    """Describe the PyTorch in `folder`.

    Raises UsageError where there is none, or none for this Python and platform.
    """
    package = folder / "torch"
    if not (package / "version.py").is_file():
        raise UsageError(
            f"{folder} holds no PyTorch; install it with {install(folder)}"
        )
    fitting = f"_C{EXTENSION_SUFFIXES[0]}"
    builds = sorted(path.name for path in package.glob("_C.*") if _is_binary(path))
    if fitting not in builds:
        raise UsageError(
            f"PyTorch in {folder} is built for {', '.join(builds) or 'nothing'}, but "
            f"this Blender needs {fitting}; install one with {install(folder)}"
        )
    constants = _constants(package / "version.py")
    build = "CPU"
    for key, name in (("cuda", "CUDA"), ("hip", "ROCm"), ("xpu", "XPU")):
        if constants.get(key):
            build = f"{name} {constants[key]}"
    return Torch(str(constants.get("__version__", "of unknown version")), build, folder)


def _is_binary(path: Path) -> bool:
    return path.suffix in {".so", ".pyd"}


def _constants(path: Path) -> dict[str, object]:
    """The constants that a module of plain assignments sets, without running it."""
    constants: dict[str, object] = {}
    for node in ast.parse(path.read_text("utf-8")).body:
        if isinstance(node, ast.AnnAssign):
            targets, value = [cast("ast.expr", node.target)], node.value
        elif isinstance(node, ast.Assign):
            targets, value = node.targets, node.value
        else:
            continue
        if isinstance(value, ast.Constant):
            constants |= {t.id: value.value for t in targets if isinstance(t, ast.Name)}
    return constants


def install(folder: Path) -> str:
    """The command that fills a folder with what this Blender's Python needs.

    It is for the CPU: on Linux the package index itself has PyTorch with all of CUDA.
    """
    pip = f'"{sys.executable}" -m pip install'
    if find_spec("pip") is None:  # any other Python's pip does as well
        python = f"{sys.version_info.major}.{sys.version_info.minor}"
        pip = f"pip install --python-version {python}"
    index = f" {CPU_INDEX}" if sys.platform == "linux" else ""
    packages = "torch safetensors OpenEXR"
    return f'{pip} --only-binary :all: --target "{folder}"{index} {packages}'


def use(folder: Path | None) -> None:
    """Look for torch in `folder` first from now on; None forgets the one before.

    numpy stays Blender's own: it is loaded before the folder is in sight. Raises
    UsageError, with nothing changed, where the folder's torch does not fit.
    """
    chosen = PROCESS.of(_Chosen)
    if folder is not None:
        inspect(folder)
        importlib.import_module("numpy")
    if chosen.folder is not None and str(chosen.folder) in sys.path:
        sys.path.remove(str(chosen.folder))
    if folder is not None:
        sys.path.insert(0, str(folder))
    importlib.invalidate_caches()
    chosen.folder = folder


def loaded() -> Path | None:
    """Where the torch lies that is loaded already, None before the first use."""
    file = getattr(sys.modules.get("torch"), "__file__", None)
    return Path(file).parents[1] if file else None  # a folder without code has no file


def available() -> Torch:
    """The PyTorch that is loaded, or that the first render will load.

    Raises UsageError, saying what to do, where there is none.
    """
    folder = loaded() or _where("torch")
    for name in NEEDED:
        if _where(name) is None:
            raise UsageError(
                f"{name} is not installed, so XRDS renders at full size only: install "
                "the extension that includes PyTorch, or choose a folder that holds it"
            )
    assert folder is not None
    return inspect(folder)


def is_there() -> bool:
    """Whether a render would find all it needs; cheap enough for a panel."""
    return all(_where(name) is not None for name in NEEDED)


def _where(name: str) -> Path | None:
    """The folder that a package would be imported from; nothing is imported."""
    spec = PathFinder.find_spec(name)
    if spec is None or not spec.origin:
        return None
    return Path(spec.origin).parents[1]


def load(module: str) -> Any:
    """Import a module of xrds_core that needs torch.

    Raises XRDSError, in one line, whatever a missing or broken torch raises.
    """
    try:
        return importlib.import_module(f"xrds_core.{module}")
    except Exception as error:  # OSError, AttributeError: a broken one raises all
        reason = " ".join(str(error).split()) or type(error).__name__
        missing = [title for name, title in NEEDED.items() if _where(name) is None]
        what = " and ".join(missing or ["PyTorch"])
        raise XRDSError(
            f"super-resolution needs {what}, which cannot be loaded ({reason}): run "
            f"{GET_NETWORK}, or choose a PyTorch folder in the add-on's preferences; "
            "full size needs none"
        ) from error
