"""The compiled core: a library for each platform, and nothing that it cannot have."""

from __future__ import annotations

import ctypes
import os
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "extension"))

import build  # lies beside the add-on's root module

from xrds_core.native import compile as native

pytest.importorskip("ziglang")
ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "xrds_core" / "native" / "compile.py"
# Where the headers of ELF, PE and Mach-O name a machine, and the machine.
MACHINES = {
    "linux-x64": (b"\x7fELF\x02", 18, 62),
    "linux-arm64": (b"\x7fELF\x02", 18, 183),
    "windows-x64": (b"MZ", None, 0x8664),
    "macos-arm64": (b"\xcf\xfa\xed\xfe", 4, 0x0100000C),
    "macos-x64": (b"\xcf\xfa\xed\xfe", 4, 0x01000007),
}
every_platform = pytest.mark.parametrize("platform", native.PLATFORMS)


@pytest.fixture(scope="module")
def libraries(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Compiled for all platforms; seconds where zig remembers the sources."""
    folder = tmp_path_factory.mktemp("libraries")
    made = native.compile_libraries(native.PLATFORMS, folder)
    assert sorted(folder.iterdir()) == sorted(made)  # and nothing beside them
    return dict(zip(native.PLATFORMS, made, strict=True))


def run(*words: str, **variables: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, str(SCRIPT), *words],
        env=os.environ | variables,
        capture_output=True,
        text=True,
        check=False,
    )


def number(data: bytes, at: int, size: int) -> int:
    return int.from_bytes(data[at : at + size], "little")


@every_platform
def test_a_library_is_of_its_machine(platform: str, libraries: dict[str, Path]) -> None:
    data = libraries[platform].read_bytes()
    magic, at, machine = MACHINES[platform]
    assert data.startswith(magic)
    size = 4 if "macos" in platform else 2
    if at is None:  # PE: its header lies where the DOS header tells
        header = number(data, 0x3C, 4)
        assert data[header : header + 4] == b"PE\0\0"
        at = header + 4
    assert number(data, at, size) == machine


@every_platform
def test_it_exports_what_is_marked(platform: str, libraries: dict[str, Path]) -> None:
    data = libraries[platform].read_bytes()
    names = exported_by_macos(data) if "macos" in platform else words(data)
    assert b"level" in names
    assert not [name for name in names if name.endswith((b"_v1", b"_v3"))]


def words(data: bytes) -> set[bytes]:
    """All that may be names in a library; only those that it exports are left in it."""
    return set(re.findall(rb"[A-Za-z]\w+", data))


def exported_by_macos(data: bytes) -> set[bytes]:
    """The names in a Mach-O library's table that others may use."""
    table = commands(data)[0x2]
    at, count, names = (number(table, place, 4) for place in (8, 12, 16))
    found = set()
    for entry in range(at, at + 16 * count, 16):
        kind = data[entry + 4]
        if kind & 0x0E and kind & 0x11 == 0x01:  # defined, external, not private
            start = names + number(data, entry, 4)
            found.add(data[start : data.index(b"\0", start)].removeprefix(b"_"))
    return found


@pytest.mark.parametrize("platform", ["linux-x64", "linux-arm64"])
def test_it_loads_on_linux_of_2018(platform: str, libraries: dict[str, Path]) -> None:
    """Not above glibc 2.28, as its wheel's tag says; of no library but glibc."""
    data = libraries[platform].read_bytes()
    versions = re.findall(rb"GLIBC_(\d+)\.(\d+)", data)
    assert versions
    assert max((int(major), int(minor)) for major, minor in versions) <= (2, 28)
    needed = set(re.findall(rb"\0(lib[\w.+-]+\.so[\w.]*)", data))
    assert needed <= {b"libc.so.6", b"libm.so.6"}


def test_windows_needs_its_own_c_library_alone(libraries: dict[str, Path]) -> None:
    data = libraries["windows-x64"].read_bytes()
    names = {name.lower() for name in re.findall(rb"[\w-]+\.dll", data)}
    assert names == {b"ucrtbase.dll", b"windows-x64.dll"}


def commands(data: bytes) -> dict[int, bytes]:
    """What a Mach-O library tells the loader, by kind."""
    found, at = {}, 32
    for _ in range(number(data, 16, 4)):
        size = number(data, at + 4, 4)
        found[number(data, at, 4)] = data[at : at + size]
        at += size
    return found


@pytest.mark.parametrize("platform", ["macos-arm64", "macos-x64"])
def test_it_loads_on_macos_11(platform: str, libraries: dict[str, Path]) -> None:
    found = commands(libraries[platform].read_bytes())
    version, signature = found[0x32], 0x1D
    assert number(version, 12, 4) >> 16 == 11
    # Apple's chips load nothing that is not signed, be it by nobody.
    assert signature in found or platform != "macos-arm64"


def test_this_platforms_library_can_be_called(libraries: dict[str, Path]) -> None:
    library = ctypes.CDLL(str(libraries[native.this_platform()]))
    assert library.level() in {1, 3}


def test_the_same_sources_give_the_same_library(
    libraries: dict[str, Path], tmp_path: Path
) -> None:
    """No path of a temporary folder, no time."""
    for again in native.compile_libraries(["linux-x64", "macos-arm64"], tmp_path):
        assert again.read_bytes() == libraries[again.stem].read_bytes()


def test_platforms_are_chosen_by_name() -> None:
    assert native.chosen("") == native.chosen(None) == [native.this_platform()]
    assert native.chosen("all") == list(native.PLATFORMS)
    assert native.chosen("macos-x64, linux-x64") == ["macos-x64", "linux-x64"]
    with pytest.raises(native.CompileError, match="'amiga' is unknown; use all, linux"):
        native.chosen("amiga")


def test_a_machine_without_a_library_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "freebsd14")
    with pytest.raises(native.CompileError, match="no library for"):
        native.this_platform()


def test_without_zig_the_first_line_says_how_to_get_it(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-I", "-S", str(SCRIPT), "--out", str(tmp_path)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    told = f"compile.py: zig is missing: run pip install '{native.ZIG}'\n"
    assert done.stderr == told
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    assert native.ZIG in project["build-system"]["requires"]
    assert native.ZIG in project["project"]["optional-dependencies"]["dev"]


def test_what_the_compiler_says_is_passed_on(tmp_path: Path) -> None:
    done = run("--flags=-DNAME", "--out", str(tmp_path))
    assert done.returncode == 1
    assert done.stderr.startswith("compile.py: the C core does not compile\n")
    assert "error:" in done.stderr
    assert not list(tmp_path.iterdir())


def test_the_cache_may_be_anywhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("ZIG_GLOBAL_CACHE_DIR", raising=False)
    (tmp_path / "file").touch()  # where no folder can be, whoever asks
    for name in ("HOME", "LOCALAPPDATA", "XDG_CACHE_HOME"):
        monkeypatch.setenv(name, str(tmp_path / "file"))
    assert native._find_cache(tmp_path / "work") == tmp_path / "work" / "zig"
    for name in ("HOME", "LOCALAPPDATA", "XDG_CACHE_HOME"):
        monkeypatch.setenv(name, str(tmp_path))
    assert native._find_cache(tmp_path / "work") == tmp_path / "zig"


def test_options_of_zig_are_put_in_other_compilers_words() -> None:
    words = ["-target", "x86_64-linux-gnu.2.28", "-mcpu=x86_64_v3", "-c", "a_b.c"]
    assert native._translate_flags(words) == ["-march=x86-64-v3", "-c", "a_b.c"]


def held(wheel: Path) -> set[str]:
    with zipfile.ZipFile(wheel) as file:
        names = [Path(name) for name in file.namelist()]
    return {path.name for path in names if path.parent.name == "lib"}


@pytest.mark.parametrize(
    ("platform", "tag"),
    [
        ("windows-x64", "win_amd64"),
        ("macos-arm64 macos-x64", "macosx_11_0_arm64.macosx_11_0_x86_64"),
        *[
            pytest.param(name, told.tag, marks=pytest.mark.nightly)
            for name, told in native.PLATFORMS.items()
        ],
    ],
)
def test_a_wheel_holds_the_libraries_of_its_tag(
    platform: str, tag: str, tmp_path: Path
) -> None:
    wheel = build.own_wheel(tmp_path, "*.safetensors", platform=platform)
    assert wheel.name.endswith(f"-py3-none-{tag}.whl")
    assert held(wheel) == {native.library_name(name) for name in platform.split()}
    with zipfile.ZipFile(wheel) as file:
        sources = {Path(name).name for name in file.namelist()}
    assert {path.name for path in native.sources()} <= sources


@pytest.mark.nightly
def test_pip_brings_zig_and_compiles(tmp_path: Path) -> None:
    """In an environment of its own, as for those who install from the source."""
    out = tmp_path / "wheel"
    words = ["wheel", "--quiet", "--no-deps", "--wheel-dir", str(out), str(ROOT)]
    subprocess.run([sys.executable, "-P", "-m", "pip", *words], check=True)
    (wheel,) = out.glob("*.whl")
    assert held(wheel) == {native.library_name(native.this_platform())}
