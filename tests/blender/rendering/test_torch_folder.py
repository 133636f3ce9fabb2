"""Which PyTorch is taken: a folder is judged by its files, before any is loaded."""

from __future__ import annotations

import subprocess
import sys
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

import pytest

from xrds_blender.rendering import torch_folder
from xrds_core.errors import UsageError, XRDSError

VERSION = "from typing import Optional\n__version__ = '2.9.1+cu128'\n"
CUDA = VERSION + "cuda: Optional[str] = '12.8'\nhip: Optional[str] = None\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """What `pip install --target` leaves, as far as it is looked at."""
    for name in torch_folder.NEEDED:
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").touch()
    (tmp_path / "torch" / "version.py").write_text(CUDA)
    (tmp_path / "torch" / f"_C{EXTENSION_SUFFIXES[0]}").touch()
    return tmp_path


def test_a_folder_tells_version_and_build(folder: Path) -> None:
    torch = torch_folder.inspect(folder)
    assert torch == torch_folder.Torch("2.9.1+cu128", "CUDA 12.8", folder)
    (folder / "torch" / "version.py").write_text("__version__ = '2.13.0'\ncuda = None")
    assert torch_folder.inspect(folder).build == "CPU"


def test_another_python_or_platform_is_refused(folder: Path) -> None:
    binary = folder / "torch" / f"_C{EXTENSION_SUFFIXES[0]}"
    binary.rename(folder / "torch" / "_C.cp39-win_amd64.pyd")
    before = list(sys.path)
    with pytest.raises(UsageError, match=r"_C.cp39-win_amd64.pyd.*this Blender needs"):
        torch_folder.use(folder)
    assert sys.path == before


def test_an_empty_folder_tells_how_to_fill_it(tmp_path: Path) -> None:
    with pytest.raises(
        UsageError, match=r"holds no PyTorch; install it with .* -m pip install"
    ):
        torch_folder.inspect(tmp_path)


def test_a_folder_goes_first_and_is_forgotten_again(folder: Path) -> None:
    """In a process of its own: here torch may be loaded already."""
    code = f"""
import sys
from pathlib import Path
from xrds_blender.rendering import torch_folder
before = list(sys.path)
torch_folder.use(Path({str(folder)!r}))
assert torch_folder.available().version == '2.9.1+cu128'
assert torch_folder.is_there() and torch_folder.loaded() is None
import numpy
assert {str(folder)!r} not in numpy.__file__
torch_folder.use(None)
assert sys.path == before
assert torch_folder.available().version != '2.9.1+cu128'
"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_missing_torch_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch_folder, "loaded", lambda: None)
    monkeypatch.setattr(torch_folder, "_where", lambda name: None)
    assert not torch_folder.is_there()
    with pytest.raises(UsageError, match="torch is not installed"):
        torch_folder.available()


def test_preferences_show_what_is_used(folder: Path) -> None:
    from xrds_blender.interface import preferences

    (icon, line) = preferences.torch_status()[0]
    assert icon == "INFO"
    assert line.startswith("PyTorch 2.")
    wrong = preferences.torch_status(folder / "nowhere")
    assert wrong[0][0] == "ERROR"
    assert "holds no PyTorch" in wrong[0][1]


@pytest.mark.parametrize(
    ("build", "cards"), [("CPU", []), ("CUDA 12.8", ["cuda:0"]), ("ROCm 6", ["cuda:0"])]
)
def test_only_devices_that_are_there_are_offered(
    monkeypatch: pytest.MonkeyPatch, build: str, cards: list[str]
) -> None:
    from xrds_blender.interface import preferences

    torch = torch_folder.Torch("2.13", build, Path())
    monkeypatch.setattr(torch_folder, "available", lambda: torch)
    monkeypatch.setitem(sys.modules, "torch", None)
    monkeypatch.setattr(sys, "platform", "linux")
    names = [name for name, *_ in preferences._devices(None, None)]
    assert names == ["auto", "cpu", *cards]
    monkeypatch.setattr(sys, "platform", "darwin")
    names = [name for name, *_ in preferences._devices(None, None)]
    assert names == ["auto", "cpu", "metal", *cards]


def test_a_folder_is_found_again_after_the_add_on_was_off(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from xrds_blender.interface import get_torch

    monkeypatch.setattr(get_torch, "_home", lambda: tmp_path / "home")
    assert get_torch.remembered() == ""
    get_torch.remember(str(folder))
    assert get_torch.remembered() == str(folder)
    (folder / "torch" / "version.py").unlink()
    assert get_torch.remembered() == ""  # it is not there any more
    get_torch.remember("")
    assert not list((tmp_path / "home").iterdir())


def test_the_command_is_whole_and_for_the_processor() -> None:
    from xrds_blender.interface import get_torch

    command = get_torch.command()
    assert f'--target "{get_torch.folder()}"' in command
    assert "FOLDER" not in command
    assert command.endswith("torch safetensors OpenEXR")
    if sys.platform == "linux":
        assert "/whl/cpu" in command


def test_what_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    usual = torch_folder._where
    monkeypatch.setattr(
        torch_folder, "_where", lambda n: None if n == "safetensors" else usual(n)
    )
    with pytest.raises(XRDSError, match=r"needs safetensors, which .*xrds\[network\]"):
        torch_folder.load("no_such_module")
