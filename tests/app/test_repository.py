"""The repository of a release in a real Blender, from a web server of this machine.

By command alone: added, installed from, updated to the next version, removed.
"""

from __future__ import annotations

import json
import re
import shutil
import sys
import zipfile
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import pytest
from program import HERE, Program

ROOT = HERE.parents[1]
sys.path.insert(0, str(ROOT / "extension"))

import build

pytestmark = pytest.mark.timeout(900)
VERSION = json.loads(
    re.search(r'^version = (".*")$', (ROOT / build.MANIFEST).read_text(), re.M)[1]
)
NEXT = "99.0.0"
ENGINE = "bpy.types.RenderEngine.bl_rna_get_subclass_py('XRDS')"
ASK = f"import bpy; print('engine=%s' % bool({ENGINE}))"


@pytest.fixture(scope="module")
def shop(program: Program) -> Program:
    """The program with preferences of its own, which know no XRDS yet."""
    share = program.share / "repository"
    (share / "home").mkdir(parents=True)
    return Program(program.path, share)


@pytest.fixture(scope="module")
def zips(program: Program, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """The light zip of this version, and the same of the next one."""
    (path,) = program.share.glob("xrds-*-light-*.zip")
    folder = tmp_path_factory.mktemp("next")
    with zipfile.ZipFile(path) as file:
        file.extractall(folder / "old")
    others = sorted((folder / "old" / "wheels").glob("*.whl"))
    others = [wheel for wheel in others if not wheel.name.startswith("xrds-")]
    tree = folder / "tree"
    for name in (*build.PACKAGES, "extension"):
        shutil.copytree(ROOT / name, tree / name)
    for name in (*build.PROJECT_FILES, build.MANIFEST):
        text = (ROOT / name).read_text("utf-8")
        (tree / name).write_text(text.replace(f'"{VERSION}"', f'"{NEXT}"'), "utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(build, "ROOT", tree)
        own = build.own_wheel(folder / "wheel", build.LARGE)
        name = path.stem.partition(f"{VERSION}-")[2]
        lines = {"platforms": ["linux-x64"]}
        return [path, build.build(folder, name, [own, *others], lines)]


@pytest.fixture(scope="module")
def address(shop: Program) -> Iterator[str]:
    """Of a web server that holds the repository's folder, www below `shop.share`."""
    folder = shop.share / "www"
    folder.mkdir()
    handler = partial(SimpleHTTPRequestHandler, directory=str(folder))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/index.json"
        server.shutdown()


def extension(shop: Program, *words: str) -> str:
    """What `blender --command extension` prints; it must succeed."""
    command = ("blender", "--online-mode", "--command", "extension", *words)
    done = shop.run(*command)
    assert done.returncode == 0, done.stdout
    return done.stdout


def publish(shop: Program, path: Path) -> None:
    """Put a zip in the place of what the repository has, and list it anew."""
    folder = shop.share / "www"
    for old in folder.iterdir():
        old.unlink()
    shutil.copy(path, folder)
    build.blenders_tool("server-generate", "--repo-dir", str(folder))


def has_engine(shop: Program) -> bool:
    return "engine=True" in shop.run("blender", "-b", "--python-expr", ASK).stdout


def told_version(shop: Program) -> str:
    """What the installed command calls itself."""
    done = shop.run("blender", "--command", "xrds", "info")
    return re.search(r"^XRDS ([\d.]+),", done.stdout, re.M)[1]


def test_a_repository_gives_installs_updates_and_goes(
    shop: Program, zips: list[Path], address: str
) -> None:
    now, later = zips
    publish(shop, now)
    extension(shop, "repo-add", "--name", "XRDS", "--url", address, "xrds")
    assert not has_engine(shop)

    extension(shop, "install", "--sync", "--enable", "xrds.xrds")
    assert has_engine(shop)
    assert told_version(shop) == VERSION

    publish(shop, later)
    extension(shop, "update", "--sync")
    assert has_engine(shop)
    assert told_version(shop) == NEXT

    extension(shop, "remove", "xrds.xrds")
    assert not has_engine(shop)
    assert not list((shop.share / "home").rglob("xrds_blender"))
    extension(shop, "repo-remove", "xrds")
    assert "xrds" not in extension(shop, "repo-list")


def test_the_program_lists_a_repository_as_the_release_does(
    shop: Program, zips: list[Path]
) -> None:
    """Whichever Blender generates it, `index.json` says the same."""
    folder = shop.share / "twice"
    folder.mkdir()
    shutil.copy(zips[0], folder)
    told = []
    for generate in (
        lambda: build.blenders_tool("server-generate", "--repo-dir", str(folder)),
        lambda: extension(shop, "server-generate", "--repo-dir", shop.seen(folder)),
    ):
        generate()
        told.append(json.loads((folder / "index.json").read_text("utf-8")))
        (folder / "index.json").unlink()
    assert told[0]["data"][0]["id"] == "xrds"
    assert told[0] == told[1]
