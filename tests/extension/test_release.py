"""What `make release` lays out: complete, in step with itself, and readable."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from hashlib import sha256
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import pytest

pytest.importorskip("bpy")
pytest.importorskip("cyclonedx")
pytest.importorskip("markdown")
ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "extension"))

import build
import release
import sbom

SITE = "https://xrds.example"
VERSION = tomllib.loads((ROOT / build.MANIFEST).read_text("utf-8"))["version"]


@pytest.fixture(scope="module")
def laid_out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A release of two zips as build.py names them, with little in them."""
    folder = tmp_path_factory.mktemp("release")
    zips, site = folder / "zips", {"website": SITE}
    own = build.own_wheel(folder / "wheel", build.LARGE, website=SITE)
    build.build(zips, "bare", [own], site)
    lines = {"platforms": ["linux-x64"], "blender_version_max": "5.1.0"} | site
    build.build(zips, "light-linux_x64-cp311", [own], lines)
    (zips / "xrds-0.0.9-bare.zip").write_bytes(b"of an earlier version")
    return release.release(zips, folder / "out", SITE)


def names(folder: Path) -> set[str]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix() for path in files}


def test_all_is_there_and_nothing_else(laid_out: Path) -> None:
    light, bare = f"xrds-{VERSION}-light-linux_x64-cp311", f"xrds-{VERSION}-bare"
    wheel = f"xrds-{VERSION}-py3-none-any"
    assert names(laid_out) == {
        "SHA256SUMS",
        "index.html",
        "notes.md",
        f"{wheel}.whl",
        f"light/{light}.zip",
        "light/index.json",
        f"bare/{bare}.zip",
        "bare/index.json",
        *(f"sbom/{name}.cdx.json" for name in (light, bare, wheel)),
    }


def test_checksums_are_of_every_file(laid_out: Path) -> None:
    lines = (laid_out / "SHA256SUMS").read_text().splitlines()
    told = {name: digest for digest, name in (line.split("  ") for line in lines)}
    assert told.keys() == names(laid_out) - {"SHA256SUMS"}
    for name, digest in told.items():
        assert digest == sha256((laid_out / name).read_bytes()).hexdigest()


def test_the_repository_names_zips_and_website(laid_out: Path) -> None:
    told = json.loads((laid_out / "light" / "index.json").read_text("utf-8"))
    (entry,) = told["data"]
    path = laid_out / "light" / entry["archive_url"]
    digest = sha256(path.read_bytes()).hexdigest()
    assert entry["archive_hash"] == f"sha256:{digest}"
    assert (entry["version"], entry["website"]) == (VERSION, SITE)
    assert entry["blender_version_max"] == "5.1.0"


def test_the_package_names_the_website(laid_out: Path) -> None:
    (wheel,) = laid_out.glob("*.whl")
    with zipfile.ZipFile(wheel) as file:
        metadata = file.read(f"xrds-{VERSION}.dist-info/METADATA").decode()
        weights = [name for name in file.namelist() if "paper_x" in name]
    assert f"Project-URL: Homepage, {SITE}" in metadata
    assert weights  # of the large network, too


class Links(HTMLParser):
    """The targets of a page's links."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, _: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found += [value for name, value in attrs if name == "href" and value]


def test_the_page_leads_to_what_is_there(laid_out: Path) -> None:
    text = (laid_out / "index.html").read_text("utf-8")
    links = Links()
    links.feed(text)
    here = [urlsplit(link) for link in links.found if link != SITE]
    assert SITE in links.found
    assert "Full:" not in text  # no full zip was built
    assert all((laid_out / link.path).exists() for link in here)
    (light,) = (link for link in here if link.path.startswith("light/xrds"))
    # what Blender reads as the link is dropped on its window
    assert parse_qs(light.query) == {
        "repository": ["./index.json"],
        "blender_version_min": ["4.2.0"],
        "blender_version_max": ["5.1.0"],
        "platforms": ["linux-x64"],
        "python_versions": ["3"],
    }
    assert "4.2 or later, before 5.1" in text
    assert "<strong>Time left</strong>" in text
    assert not re.findall(r"\$\w+", text)


def test_a_bill_names_what_a_zip_holds(laid_out: Path) -> None:
    name = f"xrds-{VERSION}-bare"
    bill = json.loads((laid_out / "sbom" / f"{name}.cdx.json").read_text("utf-8"))
    assert (bill["bomFormat"], bill["specVersion"]) == ("CycloneDX", "1.6")
    whole = bill["metadata"]["component"]
    digest = sha256((laid_out / "bare" / f"{name}.zip").read_bytes()).hexdigest()
    assert whole["hashes"] == [{"alg": "SHA-256", "content": digest}]
    (own,) = bill["components"]
    assert own["purl"] == f"pkg:pypi/xrds@{VERSION}"
    assert own["licenses"] == [{"license": {"id": "GPL-3.0-or-later"}}]
    (needs,) = (d for d in bill["dependencies"] if d["ref"] == whole["bom-ref"])
    assert needs["dependsOn"] == [own["bom-ref"]]


def test_a_wheel_that_holds_others_is_told_by_its_own_name(tmp_path: Path) -> None:
    wheel = tmp_path / "tools-2.0-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as file:
        for name in ("tools/vendor/held-1.0", "tools-2.0"):
            package, _, version = Path(name).name.partition("-")
            told = f"Metadata-Version: 2.1\nName: {package}\nVersion: {version}\n"
            file.writestr(f"{name}.dist-info/METADATA", told)
    bill = json.loads(sbom.write_bill(wheel, "2.0", tmp_path).read_text("utf-8"))
    assert [x["purl"] for x in bill["components"]] == ["pkg:pypi/tools@2.0"]


def test_notes_are_those_of_the_version() -> None:
    changelog = "# Changes\n\n## 1.1.0\n\nmore\n\n## 1.0.0\n\nfirst\n"
    assert release.notes_of("1.1.0", changelog) == "more"
    assert release.notes_of("1.0.0", changelog) == "first"
    with pytest.raises(SystemExit, match=r"tells nothing of 2\.0\.0"):
        release.notes_of("2.0.0", changelog)


def test_the_changelog_tells_of_this_version(laid_out: Path) -> None:
    assert "flicker" in (laid_out / "notes.md").read_text("utf-8")


def test_without_zips_there_is_no_release(tmp_path: Path) -> None:
    script = str(ROOT / "extension" / "release.py")
    words = [script, "--zips", str(tmp_path), "--out", str(tmp_path / "out")]
    done = subprocess.run(
        [sys.executable, *words], capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert f"no zip of {VERSION}" in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("zips", "out", "said"),
    [
        ("dist", "dist", "holds the zips"),
        ("dist", ".", "holds the zips"),
        ("dist", "dist/../dist", "holds the zips"),
        ("dist", "link", "holds the zips"),
        ("dist", "mine", "mine/notes.txt is not of a release"),
        ("dist", "mixed", "mixed/sub/picture.png is not of a release"),
        ("dist", "file", "is no folder"),
    ],
)
def test_only_a_release_is_replaced(
    zips: str, out: str, said: str, tmp_path: Path
) -> None:
    """Nothing is touched but a folder that a release made."""
    for name in ("dist/xrds-0.1.0-bare.zip", "mine/notes.txt", "mixed/sub/picture.png"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("kept")
    (tmp_path / "file").write_text("kept")
    (tmp_path / "mixed" / "SHA256SUMS").write_text("0  index.html\n")
    (tmp_path / "link").symlink_to("dist")
    before = names(tmp_path)
    with pytest.raises(SystemExit, match=said):
        release.release(tmp_path / zips, tmp_path / out)
    assert names(tmp_path) == before


def test_an_earlier_release_is_replaced(laid_out: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    shutil.copytree(laid_out, out)
    stale = out / "light" / "xrds-0.0.9-light.zip"
    stale.write_bytes(b"earlier")
    (out / "SHA256SUMS").write_text(release.checksums(out))
    release.release(laid_out.parent / "zips", out, SITE)
    assert names(out) == names(laid_out)


def test_the_page_of_sizes_tells_that_of_the_bare_zip(laid_out: Path) -> None:
    text = (ROOT / "docs" / "compatibility.md").read_text("utf-8")
    (told,) = re.findall(r"\| `bare`.*?\| ([\d.]+) MB \|", text)
    (path,) = (laid_out / "bare").glob("*.zip")
    assert path.stat().st_size / 1e6 == pytest.approx(float(told), rel=0.05)
