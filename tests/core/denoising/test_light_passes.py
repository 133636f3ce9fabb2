"""Parts of the light are found by the names that renderers give them."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import pytest

from xrds_core.denoising.light_passes import (
    ALL,
    GROUPS,
    LightPart,
    Wanted,
    find_parts,
    read_renderers,
)
from xrds_core.errors import UsageError
from xrds_core.exr.channels import Channels


def channels(passes: Iterable[str], layer: str = "") -> Channels:
    ahead = f"{layer}." if layer else ""
    return Channels("a.exr", [f"{ahead}{x}.{c}" for x in passes for c in "RGB"])


CYCLES = ("Combined", "DiffDir", "DiffInd", "DiffCol", "Emit", "Combined_key.left")


def found(passes: Iterable[str], *which: str, layer: str = "") -> list[LightPart]:
    wanted = Wanted(which or (ALL,))
    return list(find_parts(channels(passes, layer), layer, wanted))


def names(parts: Iterable[LightPart]) -> list[str]:
    return [part.name for part in parts]


def test_lobes_know_the_colour_that_they_were_divided_by() -> None:
    direct, indirect, emission, group = found(CYCLES, layer="View")
    assert direct.channels == ("View.DiffDir.R", "View.DiffDir.G", "View.DiffDir.B")
    assert direct.colour == ("View.DiffCol.R", "View.DiffCol.G", "View.DiffCol.B")
    assert direct.colour_name == indirect.colour_name != direct.name
    assert (emission.name, emission.colour, emission.colour_name) == ("Emit", (), "")
    assert (group.name, group.sum) == ("Combined_key.left", GROUPS)
    assert {direct.sum, indirect.sum, emission.sum} == {"lobes"}


@pytest.mark.parametrize(
    ("which", "expected"),
    [
        (("none",), []),
        ((GROUPS,), ["Combined_key.left"]),
        (("Diffuse Direct", "Emit"), ["DiffDir", "Emit"]),
        (("key.left", GROUPS), ["Combined_key.left"]),
    ],
)
def test_what_is_wanted(which: tuple[str, ...], expected: list[str]) -> None:
    assert names(found(CYCLES, *which)) == expected


@pytest.mark.parametrize(
    "passes",
    [
        ("diffuse_direct", "specular_indirect", "sss_direct", "RGBA_key"),
        ("directDiffuse", "indirectDiffuse", "subsurface", "lightgroup_key"),
        ("VRayLighting", "VRayGlobalIllumination", "VRayLightSelect_key"),
        ("base_diffuse_direct", "fuzz_direct", "emission", "beauty_key"),
    ],
)
def test_other_renderers_are_known(passes: tuple[str, ...]) -> None:
    parts = found((*passes, "albedo", "N", "crypto00"))
    assert names(parts) == list(passes)
    assert names(found(passes, "key")) == [passes[-1]]


def test_other_layers_are_left_out() -> None:
    both = [*channels(CYCLES, "Near").names, *channels(CYCLES, "Far").names]
    parts = find_parts(Channels("a.exr", both), "Far", Wanted((ALL,)))
    assert {x.partition(".")[0] for part in parts for x in part.channels} == {"Far"}


def test_a_lobe_without_its_colour_is_no_light() -> None:
    assert names(found(("DiffDir", "Emit"))) == ["Emit"]


def test_light_of_other_names_stands_alone() -> None:
    wanted = Wanted(("none",), alone=("sparks/left",))
    (part,) = find_parts(channels((*CYCLES, "sparks/left")), "", wanted)
    assert (part.name, part.sum) == ("sparks/left", "")


def test_what_is_not_there_is_said() -> None:
    with pytest.raises(
        UsageError, match=r"a.exr has no light 'rim'; it holds .*DiffDir"
    ):
        found(CYCLES, "rim")
    with pytest.raises(UsageError, match="no light 'rim'"):
        find_parts(channels(CYCLES), "", Wanted(("none",), alone=("rim",)))


def test_a_file_of_ones_own_goes_first(tmp_path: Path) -> None:
    path = tmp_path / "ours.toml"
    path.write_text('[Ours]\ngroups = ["lg *"]\nlobes = [{ names = ["hot"] }]\n')
    wanted = Wanted((ALL,), renderers=read_renderers(path))
    assert names(find_parts(channels(("hot", "lg a")), "", wanted)) == ["hot", "lg a"]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[Ours", "cannot read the passes in .*ours.toml"),
        ("Ours = 3", r"\[Ours\] is no table"),
        ("[Ours]\nlobe = []", "has 'lobe', which is not among alone, groups, lobes"),
        ('[Ours]\nlobes = "hot"', "lobes: give a list of tables"),
        ("[Ours]\nlobes = [{ names = [] }]", "a lobe without names"),
        ("[Ours]\nlobes = [{ names = [3] }]", "names: give a list of names"),
        ('[Ours]\ngroups = "lg"', "groups: give a list of names"),
    ],
)
def test_a_bad_file_is_said(tmp_path: Path, text: str, told: str) -> None:
    path = tmp_path / "ours.toml"
    path.write_text(text)
    with pytest.raises(UsageError, match=told):
        read_renderers(path)
    with pytest.raises(UsageError, match="cannot read the passes in"):
        read_renderers(tmp_path / "none.toml")
