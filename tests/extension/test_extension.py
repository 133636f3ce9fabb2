"""The extension's zip: checked by Blender's own tool, complete, and nothing more."""

from __future__ import annotations

import subprocess
import sys
import tomllib
import zipfile
from importlib.metadata import version
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "extension"))

import build  # lies beside the add-on's root module
import wheels
from packaging.requirements import Requirement

from xrds_core.native import compile as native

ROOT = Path(__file__).resolve().parents[2]
MANIFEST = tomllib.loads((ROOT / "blender_manifest.toml").read_text("utf-8"))
WHEEL = f"wheels/xrds-{MANIFEST['version']}-py3-none-any.whl"


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("extension")
    script = ROOT / "extension" / "build.py"
    done = subprocess.run(
        [sys.executable, script, "--kind", "bare", "--out", out],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    (path,) = out.glob("*.zip")
    assert path.stat().st_size < build.SIZE_LIMIT
    with zipfile.ZipFile(path) as file:
        file.extractall(out / "zip")
    return out / "zip"


def wheel_names(unpacked: Path) -> set[str]:
    with zipfile.ZipFile(unpacked / WHEEL) as wheel:
        return set(wheel.namelist())


def test_the_version_is_that_of_the_manifest() -> None:
    told = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    assert "version" not in told["project"]
    assert MANIFEST["version"] == version("xrds")


def test_zip_holds_manifest_root_module_and_wheel(unpacked: Path) -> None:
    files = {str(p.relative_to(unpacked)) for p in unpacked.rglob("*") if p.is_file()}
    assert files == {"__init__.py", "LICENSE", "blender_manifest.toml", WHEEL}
    told = tomllib.loads((unpacked / "blender_manifest.toml").read_text("utf-8"))
    assert told == {**MANIFEST, "wheels": [f"./{WHEEL}"]}


def test_wheel_holds_what_renders(unpacked: Path) -> None:
    names = wheel_names(unpacked)
    assert {
        "xrds_core/superres/network.py",
        "xrds_blender/interface/engine.py",
    } <= names
    weights = {
        p.name
        for p in (ROOT / "xrds_core" / "superres" / "weights").glob("*.safetensors")
    }
    held = {name for name in weights if f"xrds_core/superres/weights/{name}" in names}
    assert {name for name in weights if not name.startswith("paper_")} == held
    presets = "xrds_blender/interface/shipped/presets/xrds/render"
    assert f"{presets}/Draft.py" in names
    assert "xrds_blender/interface/languages/ja_JP.json" in names


def test_wheel_holds_core_and_add_on_alone(unpacked: Path) -> None:
    tops = {name.partition("/")[0] for name in wheel_names(unpacked)}
    metadata = f"xrds-{MANIFEST['version']}.dist-info"
    assert tops == {"xrds_core", "xrds_blender", metadata}


def test_the_bare_zip_holds_the_core_of_every_platform(unpacked: Path) -> None:
    folder = "xrds_core/native/lib/"
    held = {name for name in wheel_names(unpacked) if name.startswith(folder)}
    assert held == {folder + native.library_name(name) for name in native.PLATFORMS}


def test_every_platform_of_a_zip_has_a_library() -> None:
    assert set(wheels.PLATFORMS) == set(MANIFEST["platforms"])
    for name, (tags, _) in wheels.PLATFORMS.items():
        assert native.PLATFORMS[name].tag in tags


def test_a_zip_with_libraries_holds_the_core_of_its_platform(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked, built = [], {}
    monkeypatch.setattr(build, "resolve", lambda *_: ["oidn==1.0"])
    monkeypatch.setattr(build, "download", lambda *_: [tmp_path / "oidn.whl"])
    monkeypatch.setattr(build, "_print_size", lambda _: None)

    def own_wheel(folder: Path, *left_out: str, **told: str | None) -> Path:
        asked.append((left_out, told["platform"]))
        return folder / "own.whl"

    def zipped(_: Path, name: str, held: list[Path], *__: object) -> None:
        built[name] = [path.parent.name for path in held if path.name == "own.whl"]

    monkeypatch.setattr(build, "own_wheel", own_wheel)
    monkeypatch.setattr(build, "build", zipped)
    words = ["build.py", "--kind", "light", "full", "bare", "--python", "3.11"]
    monkeypatch.setattr(sys, "argv", words)
    build.main()
    assert built == {"bare": ["all"]} | {
        f"{kind}{name.replace('-', '_')}-cp311": [name]
        for kind in ("light-", "")
        for name in wheels.PLATFORMS
    }
    # once for each platform and kind
    light = [((build.LARGE,), name) for name in (*wheels.PLATFORMS, "all")]
    full = [((), name) for name in wheels.PLATFORMS]
    assert sorted(asked) == sorted(light + full)


def target(platform: str, python: str) -> wheels.Target:
    return wheels.targets([platform], [python])[0]


@pytest.fixture
def index(monkeypatch: pytest.MonkeyPatch) -> dict[str, list[str]]:
    """A package index: what depends on what, by name."""
    told: dict[str, list[str]] = {}

    def look_up(_: wheels.Target, wanted: Requirement) -> dict[str, object]:
        if wanted.name not in told:
            raise LookupError(f"no wheel of {wanted.name}")
        return {"version": "1.0", "requires_dist": told[wanted.name]}

    monkeypatch.setattr(wheels, "_look_up", look_up)
    return told


def test_wheels_are_those_of_the_target_and_never_numpy(
    index: dict[str, list[str]],
) -> None:
    index |= {
        "torch": ["sympy", "numpy", 'winlib; platform_system == "Windows"'],
        "sympy": ['old; python_version < "3.12"', "torch", 'more; extra == "more"'],
        "winlib": [],
        "old": [],
    }
    found = wheels.resolve(target("windows-x64", "3.13"), ["torch"])
    assert found == ["sympy==1.0", "torch==1.0", "winlib==1.0"]
    found = wheels.resolve(target("linux-x64", "3.11"), ["torch"])
    assert found == ["old==1.0", "sympy==1.0", "torch==1.0"]


def test_a_build_for_graphics_cards_is_no_cpu_build(
    index: dict[str, list[str]],
) -> None:
    index["torch"] = ['nvidia-cudnn-cu12; platform_system == "Linux"']
    with pytest.raises(wheels.NoCpuBuild, match="linux_x64-cp313 needs nvidia"):
        wheels.resolve(target("linux-x64", "3.13"), ["torch"])
    assert wheels.resolve(target("macos-arm64", "3.13"), ["torch"]) == ["torch==1.0"]
    with pytest.raises(LookupError, match="no wheel of jax"):
        wheels.resolve(target("linux-x64", "3.13"), ["jax"])


def test_only_linux_asks_pytorch_for_its_cpu_build() -> None:
    linux, windows = target("linux-x64", "3.13"), target("windows-x64", "3.13")
    assert linux.index(["sympy", "torch"]) == list(wheels.CPU_INDEX)
    assert linux.index(["sympy"]) == windows.index(["torch"]) == []


def test_a_zip_of_another_python_tells_which_one_is_right(tmp_path: Path) -> None:
    """The root module alone, as where Blender has spread no wheel for its Python."""
    code = "import runpy; runpy.run_path('init.py')['register']()"
    (tmp_path / "init.py").write_text((ROOT / "extension/__init__.py").read_text())
    done = subprocess.run(
        [sys.executable, "-I", "-S", "-c", code],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
    )
    last = done.stderr.strip().splitlines()[-1]
    assert last.startswith("RuntimeError: XRDS finds no xrds_blender: remove XRDS")
    assert last.endswith(f"cp{sys.version_info[0]}{sys.version_info[1]}")


def test_a_manifest_takes_lines_above_its_tables() -> None:
    text = build._manifest({"platforms": ["linux-x64"], "wheels": ["./wheels/a.whl"]})
    told = tomllib.loads(text)
    assert told["platforms"] == ["linux-x64"]
    assert told["wheels"] == ["./wheels/a.whl"]
    assert told["permissions"] == MANIFEST["permissions"]
