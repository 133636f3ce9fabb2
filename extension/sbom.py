"""A bill of materials of a zip: which packages are in it, under which licences."""

from __future__ import annotations

import io
import zipfile
from email.message import Message
from email.parser import BytesHeaderParser
from hashlib import sha256
from pathlib import Path

from cyclonedx.contrib.license.factories import LicenseFactory
from cyclonedx.model import HashAlgorithm, HashType
from cyclonedx.model.bom import Bom
from cyclonedx.model.component import Component, ComponentType
from cyclonedx.output.json import JsonV1Dot6
from packageurl import PackageURL


def write_bill(path: Path, version: str, out: Path) -> Path:
    """Write NAME.cdx.json (CycloneDX 1.6) about a zip into a folder; returns it."""
    bill = Bom()
    bill.metadata.component = Component(
        name=path.stem,
        version=version,
        type=ComponentType.APPLICATION,
        bom_ref=path.name,
        hashes=[_digest(path.read_bytes())],
    )
    held = [_component(name, data) for name, data in _wheels(path)]
    for each in held:
        bill.components.add(each)
    bill.register_dependency(bill.metadata.component, held)
    told = out / f"{path.stem}.cdx.json"
    told.write_text(JsonV1Dot6(bill).output_as_string(indent=1) + "\n", "utf-8")
    return told


def _wheels(path: Path) -> list[tuple[str, bytes]]:
    """File names and contents of the wheels in a zip; of a wheel, itself."""
    if path.suffix == ".whl":
        return [(path.name, path.read_bytes())]
    with zipfile.ZipFile(path) as file:
        names = sorted(name for name in file.namelist() if name.endswith(".whl"))
        return [(Path(name).name, file.read(name)) for name in names]


def _component(name: str, wheel: bytes) -> Component:
    told = _metadata(wheel)
    package, version = str(told["Name"]), str(told["Version"])
    licence = _licence(told)
    return Component(
        name=package,
        version=version,
        type=ComponentType.LIBRARY,
        bom_ref=name,
        purl=PackageURL("pypi", name=package.lower(), version=version),
        licenses=[LicenseFactory().make_from_string(licence)] if licence else (),
        hashes=[_digest(wheel)],
    )


def _digest(data: bytes) -> HashType:
    return HashType(alg=HashAlgorithm.SHA_256, content=sha256(data).hexdigest())


def _licence(told: Message) -> str | None:
    """Its licence as SPDX has it, or in its own words; None where it tells none."""
    classifiers = told.get_all("Classifier", [])
    names = [c.rpartition(" :: ")[2] for c in classifiers if c.startswith("License ::")]
    expression = told["License-Expression"]
    own_words = (told["License"] or "").strip().partition("\n")[0]  # some give it whole
    return expression or " AND ".join(names) or own_words or None


def _metadata(wheel: bytes) -> Message:
    """What a wheel says about itself."""
    with zipfile.ZipFile(io.BytesIO(wheel)) as file:
        told = (n for n in file.namelist() if n.endswith(".dist-info/METADATA"))
        (name,) = (n for n in told if n.count("/") == 1)  # others are of what it holds
        return BytesHeaderParser().parsebytes(file.read(name))
