"""Lay out a release out of the zips that build.py made: static files, for any server.

    index.html            the page that people download from
    notes.md              what is new
    light/, full/, bare/  zips of a kind; each folder is a repository for Blender
    *.whl                 the package, for pip
    sbom/                 a bill of materials (CycloneDX) of each zip and of the package
    SHA256SUMS            of all of these

Blender's own `extension server-generate`, which comes with the bpy module, lists the
zips of a repository in its index.json. No file tells where the release will lie.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import sys
import tempfile
import tomllib
from hashlib import sha256
from html import escape
from pathlib import Path
from string import Template
from typing import Any
from urllib.parse import urlencode

from build import MANIFEST, ROOT, blenders_tool, own_wheel
from markdown import markdown
from sbom import write_bill

PAGE = Path(__file__).with_name("page.html")
KINDS = ("light", "full", "bare")
SYSTEMS = {
    "linux-x64": "Linux",
    "windows-x64": "Windows",
    "macos-arm64": "macOS, Apple chip",
}


def release(zips: Path, out: Path, website: str | None = None) -> Path:
    """Lay out the release of the version that the manifest has; returns its folder.

    Takes the zips of this version out of a folder. An earlier release in `out` is
    replaced once the new one is whole. Ends the program where `out` holds anything
    else, where there is no such zip, or the changelog tells nothing of the version.
    """
    zips, out = zips.resolve(), out.resolve()
    check_replaceable(out, zips)
    version = tomllib.loads((ROOT / MANIFEST).read_text("utf-8"))["version"]
    notes = notes_of(version, (ROOT / "CHANGELOG.md").read_text("utf-8"))
    found = sorted(zips.glob(f"xrds-{version}-*.zip"))
    if not found:
        sys.exit(f"no zip of {version} in {zips}: make extension builds them")
    out.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=out.parent) as folder:
        new = Path(folder) / out.name
        _lay_out(found, new, version, notes, website)
        if out.exists():
            shutil.rmtree(out)
        new.rename(out)
    return out


def check_replaceable(out: Path, zips: Path) -> None:
    """End the program unless `out` is missing, empty, or as an earlier release left it.

    A release lists all of its files, so that what somebody else put there is found.
    """
    if zips.is_relative_to(out):
        sys.exit(f"{out} holds the zips: give another --out, as {zips / 'release'}")
    if not out.exists():
        return
    if not out.is_dir():
        sys.exit(f"{out} is no folder: give another --out")
    sums = out / "SHA256SUMS"
    lines = sums.read_text("utf-8").splitlines() if sums.is_file() else []
    listed = {out / line.partition("  ")[2] for line in lines} | {sums}
    for path in sorted(out.rglob("*")):
        if not path.is_dir() and path not in listed:
            sys.exit(f"{path} is not of a release: remove it, or give another --out")


def _lay_out(
    zips: list[Path], out: Path, version: str, notes: str, website: str | None
) -> None:
    """Write all files of a release into a new folder."""
    files = [_in_its_folder(path, out) for path in zips]
    for folder in sorted({path.parent for path in files}):
        repository(folder)
    with tempfile.TemporaryDirectory() as folder:
        wheel = own_wheel(Path(folder), website=website)
        files.append(Path(shutil.copy(wheel, out)))
    (out / "sbom").mkdir()
    for path in files:
        write_bill(path, version, out / "sbom")
    (out / "notes.md").write_text(notes + "\n", "utf-8")
    (out / "index.html").write_text(page(version, notes, out, website), "utf-8")
    (out / "SHA256SUMS").write_text(checksums(out), "utf-8")


def notes_of(version: str, changelog: str) -> str:
    """What the changelog tells of a version; ends the program where it has no such."""
    parts = re.split(r"^## (\S+).*\n", changelog, flags=re.MULTILINE)
    told = dict(zip(parts[1::2], parts[2::2], strict=True)).get(version, "").strip()
    if not told:
        sys.exit(f"CHANGELOG.md tells nothing of {version}")
    return told


def repository(folder: Path) -> None:
    """List the zips in a folder as Blender reads it: index.json."""
    blenders_tool("server-generate", "--repo-dir", str(folder))


def page(version: str, notes: str, out: Path, website: str | None) -> str:
    """The page to download from, of the zips below `out`."""
    home = (
        f'<p><a href="{escape(website)}">{escape(website)}</a></p>' if website else ""
    )
    told = {"version": version, "notes": markdown(notes), "home": home}
    told |= {f"{kind}_rows": _rows(out / kind) for kind in KINDS}
    text = PAGE.read_text("utf-8")
    for kind in KINDS:  # a section without zips is left out
        if not told[f"{kind}_rows"]:
            text = re.sub(rf"<!-- {kind} -->.*?<!-- / -->\n", "", text, flags=re.DOTALL)
    (wheel,) = out.glob("*.whl")
    return Template(text).substitute(told, wheel=_link(wheel))


def checksums(out: Path) -> str:
    """The lines that `sha256sum --check` reads, of all files below a folder."""
    paths = sorted(path for path in out.rglob("*") if path.is_file())
    return "".join(
        f"{sha256(path.read_bytes()).hexdigest()}  {path.relative_to(out).as_posix()}\n"
        for path in paths
        if path.name != "SHA256SUMS"
    )


def _in_its_folder(path: Path, out: Path) -> Path:
    """Copy a zip into the folder of its kind."""
    kind = next((k for k in KINDS if f"-{k}" in path.name), "full")
    (out / kind).mkdir(parents=True, exist_ok=True)
    return Path(shutil.copy(path, out / kind))


def _rows(folder: Path) -> str:
    """A row of the table for each zip of a repository: whom it is for, and the link."""
    if not folder.is_dir():
        return ""
    told = json.loads((folder / "index.json").read_text("utf-8"))["data"]
    return "\n".join(_row(each, folder) for each in sorted(told, key=_place))


def _place(entry: dict[str, Any]) -> str:
    return str(entry["archive_url"])


def _row(entry: dict[str, Any], folder: Path) -> str:
    path = folder / _place(entry)
    bill = f'<a href="sbom/{path.stem}.cdx.json">contents</a>'
    cells = (
        ", ".join(SYSTEMS[name] for name in entry["platforms"]),
        _blenders(entry),
        f"{_link(path, _drag(entry))}, {bill}",
        f"<code>{entry['archive_hash'].partition(':')[2]}</code>",
    )
    return "<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"


def _blenders(entry: dict[str, Any]) -> str:
    """The Blenders that a zip is for, in words."""
    names = ("blender_version_min", "blender_version_max")
    least, end = (".".join(entry.get(n, "").split(".")[:2]) for n in names)
    return f"{least} or later" + (f", before {end}" if end else "")


def _drag(entry: dict[str, Any]) -> str:
    """What tells Blender, as a link is dropped on it, whether the zip fits."""
    query = {"repository": "./index.json"}
    for name in ("blender_version_min", "blender_version_max"):
        query |= {name: entry[name]} if name in entry else {}
    for name in ("platforms", "python_versions"):
        query |= {name: ",".join(entry[name])} if entry.get(name) else {}
    return "?" + urlencode(query)


def _link(path: Path, query: str = "") -> str:
    place = path.name if path.suffix == ".whl" else f"{path.parent.name}/{path.name}"
    size = f"{path.stat().st_size / 1e6:.0f} MB"
    return f'<a href="{place}{escape(query)}">{path.name}</a> ({size})'


def main() -> None:
    """Lay out the release in the folder named on the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    add = parser.add_argument
    add("--zips", type=Path, default=ROOT / "dist", help="folder of build.py's zips")
    add("--out", type=Path, default=ROOT / "dist" / "release")
    add("--website", help="address of the project, if it has one")
    options = parser.parse_args()
    out = release(options.zips, options.out, options.website or None)
    version = tomllib.loads((ROOT / MANIFEST).read_text("utf-8"))["version"]
    print(f"{out} is whole; tag it with: git tag -a v{version} -F {out}/notes.md")


if __name__ == "__main__":
    main()
