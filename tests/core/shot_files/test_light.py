"""Parts of the light in files of a shot: gathered, denoised, added up, written."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from numpy.typing import NDArray
from sequences import CYCLES, frame, picture, write

from xrds_core import exr

pytest.importorskip("mitsuba_oidn")

from xrds_core.denoising import Denoiser
from xrds_core.denoising.light_passes import ALL, GROUPS, Wanted
from xrds_core.errors import PictureError, UsageError
from xrds_core.shot_files.frame_file import Reading
from xrds_core.shot_files.sequence import Files, denoise_sequence

Array = NDArray[np.float32]
NAMES = {
    "direct": "ViewLayer.DiffDir.RGB",
    "indirect": "ViewLayer.DiffInd.RGB",
    "colour": "ViewLayer.DiffCol.RGB",
    "emission": "ViewLayer.Emit.RGB",
    "key": "ViewLayer.Combined_key.RGB",
    "combined": "ViewLayer.Combined.RGB",
    "id": "ViewLayer.Crypto00.RGB",
}


@pytest.fixture(scope="module")
def denoiser() -> Denoiser:
    return Denoiser("fast", "cpu", threads=1)


def passes(number: int) -> dict[str, Array]:
    """The parts of a frame's light; the key light is half of it."""
    light = frame(number).radiance
    assert light is not None
    colour = np.full_like(light, 0.5)
    colour[:6] = 0.0
    emission = 0.1 * light
    emission[:6] = light[:6]
    rest = np.where(colour > 0.0, (light - emission) / 0.5, 0.0)
    random = np.random.default_rng(number)
    share = random.uniform(0.0, 1.0, (*light.shape[:2], 1)).astype(np.float32)
    return {
        "direct": (rest * share).astype(np.float32),
        "indirect": (rest * (1 - share)).astype(np.float32),
        "colour": colour,
        "emission": emission,
        "key": 0.5 * light,
        "combined": np.zeros_like(light),
        "id": random.uniform(0.0, 1.0, light.shape).astype(np.float32),
    }


@pytest.fixture
def shot(tmp_path: Path) -> Path:
    for number in range(1, 4):
        write(tmp_path / "in", frame(number), CYCLES | NAMES, **passes(number))
    return tmp_path


def denoise(shot: Path, denoiser: Denoiser, *which: str, **more: Any) -> Path:
    files = Files(str(shot / "in/####.exr"), str(shot / "out/####.exr"))
    reading = Reading(light=Wanted(which, **more))
    result = denoise_sequence(files, denoiser, reading=reading)
    assert result["left_out"] == []
    return shot / "out/0002.exr"


def read(path: Path, name: str) -> Array:
    return np.asarray(picture(path, f"ViewLayer.{name}"), np.float32)


def test_lobes_add_up_to_the_picture(shot: Path, denoiser: Denoiser) -> None:
    out, noisy = denoise(shot, denoiser, ALL), shot / "in/0002.exr"
    direct, indirect, colour, emission = (
        read(out, x) for x in ("DiffDir", "DiffInd", "DiffCol", "Emit")
    )
    whole = (direct + indirect) * colour + emission
    assert whole == pytest.approx(read(out, "Combined"), rel=1e-3, abs=1e-4)
    assert not (direct + indirect)[colour == 0.0].any()
    assert min(x.min() for x in (direct, indirect, emission)) >= 0.0
    assert np.std(direct[10:]) < 0.7 * np.std(read(noisy, "DiffDir")[10:])


def test_groups_that_are_not_all_leave_the_rest(shot: Path, denoiser: Denoiser) -> None:
    out = denoise(shot, denoiser, GROUPS)
    key, whole = read(out, "Combined_key"), read(out, "Combined")
    assert key.mean() == pytest.approx(0.5 * whole.mean(), rel=0.05)
    assert (key <= whole * 1.001 + 1e-5).all()


def test_what_is_not_wanted_stays_to_the_bit(shot: Path, denoiser: Denoiser) -> None:
    out, noisy = denoise(shot, denoiser, GROUPS), shot / "in/0002.exr"
    for name in ("DiffDir", "DiffCol", "Emit", "Crypto00"):
        assert np.array_equal(read(out, name), read(noisy, name))
    assert not np.array_equal(read(out, "Combined_key"), read(noisy, "Combined_key"))


def test_the_picture_is_the_same_with_and_without(
    shot: Path, denoiser: Denoiser
) -> None:
    plain = read(denoise(shot, denoiser, "none"), "Combined")
    assert np.array_equal(read(denoise(shot, denoiser, ALL), "Combined"), plain)


def test_light_that_stands_alone_is_denoised(shot: Path, denoiser: Denoiser) -> None:
    out = denoise(shot, denoiser, "none", alone=("Crypto00",))
    noisy = read(shot / "in/0002.exr", "Crypto00")
    assert np.std(read(out, "Crypto00")) < 0.7 * np.std(noisy)


def test_neighbours_lend_their_parts(shot: Path, denoiser: Denoiser) -> None:
    albedo = frame(2).albedo[10:]

    def error() -> float:
        direct = read(denoise(shot, denoiser, ALL), "DiffDir")[10:]
        return float(np.sqrt(np.mean(np.square(direct - 0.9 * albedo))))

    together = error()
    for number in (1, 3):
        (shot / f"in/{number:04d}.exr").unlink()
    assert together < 0.92 * error()


def test_frames_with_other_parts_lend_nothing(shot: Path, denoiser: Denoiser) -> None:
    few = {name: x for name, x in NAMES.items() if name != "emission"}
    write(shot / "in", frame(3), CYCLES | few, **passes(3))
    told: list[str] = []
    files = Files(str(shot / "in/####.exr"), str(shot / "out/####.exr"))
    reading = Reading(light=Wanted((ALL,)))
    denoise_sequence(files, denoiser, reading=reading, say=told.append)
    assert any("hold different parts of the light" in line for line in told)


def test_names_that_are_not_there_end_the_work(shot: Path, denoiser: Denoiser) -> None:
    with pytest.raises(UsageError, match="no light 'rim'"):
        denoise(shot, denoiser, "rim")
    assert not list((shot / "out").glob("*.exr"))


def test_bad_light_in_one_part_leaves_the_picture(
    shot: Path, denoiser: Denoiser
) -> None:
    bad = passes(2)
    bad["direct"][20, 20] = np.nan
    write(shot / "in", frame(2), CYCLES | NAMES, **bad)
    out = denoise(shot, denoiser, ALL)
    names = ("Combined", "DiffDir", "DiffInd", "Emit")
    assert all(np.isfinite(read(out, name)).all() for name in names)


def test_parts_may_lie_in_other_parts_of_the_file(
    shot: Path, denoiser: Denoiser
) -> None:
    """As Blender 5 writes them, each pass in a part of its own."""
    expected = read(denoise(shot, denoiser, ALL), "DiffDir")
    for number in range(1, 4):
        path = shot / f"in/{number:04d}.exr"
        (part,) = OpenEXR.File(str(path), separate_channels=True).parts
        by_pass: dict[str, dict[str, Any]] = {}
        for name, channel in part.channels.items():
            by_pass.setdefault(name.rpartition(".")[0], {})[name] = channel.pixels
        header = {k: v for k, v in part.header.items() if k not in ("channels", "name")}
        parts = [OpenEXR.Part(dict(header), x, k) for k, x in by_pass.items()]
        OpenEXR.File(parts).write(str(path))
    out = denoise(shot, denoiser, ALL)
    file = exr.File(out)
    found = np.dstack([file.pixels(f"ViewLayer.DiffDir.{x}") for x in "RGB"])
    assert np.array_equal(found, expected)


def test_parts_may_lie_in_files_of_their_own(shot: Path, denoiser: Denoiser) -> None:
    """As Blender's File Output and Arnold's drivers write them."""
    expected = read(denoise(shot, denoiser, ALL), "DiffDir")
    alone = {"direct": "DiffDir", "colour": "DiffCol"}
    rest = {name: x for name, x in NAMES.items() if name not in alone}
    for number in range(1, 4):
        for name, to in alone.items():
            names = {name: "RGB"}
            path = write(shot / to, frame(number), names, **passes(number))
            path.rename(shot / f"{to}_{number:04d}.exr")
        write(shot / "in", frame(number), CYCLES | rest, **passes(number))
    also = tuple(str(shot / f"{to}_####.exr") for to in alone.values())
    files = Files(str(shot / "in/####.exr"), str(shot / "new/####.exr"), also=also)
    reading = Reading(light=Wanted((ALL,)), also=also)
    denoise_sequence(files, denoiser, reading=reading)
    found = np.asarray(picture(shot / "new/0002.exr", "DiffDir"), np.float32)
    assert np.array_equal(found, expected)
    (shot / "DiffDir_0003.exr").unlink()
    result = denoise_sequence(files, denoiser, reading=reading)
    (left_out,) = result["left_out"]
    assert "DiffDir_0003.exr, which belongs to" in left_out["reason"]


def test_files_that_belong_to_a_frame_are_not_overwritten(
    shot: Path, denoiser: Denoiser
) -> None:
    for number in range(1, 4):
        write(shot / "parts", frame(number), CYCLES | NAMES, **passes(number))
    also = (str(shot / "parts/####.exr"),)
    files = Files(str(shot / "in/####.exr"), also[0], also=also)
    with pytest.raises(PictureError, match=r"parts/0001.exr: it is an input"):
        denoise_sequence(files, denoiser, reading=Reading(also=also))


def test_the_picture_must_lie_in_the_file_that_is_copied(
    shot: Path, denoiser: Denoiser
) -> None:
    guides = {name: x for name, x in CYCLES.items() if name != "radiance"}
    for number in range(1, 4):
        write(shot / "guides", frame(number), guides)
        write(shot / "light", frame(number), {"radiance": CYCLES["radiance"]})
    also = (str(shot / "light/####.exr"),)
    source, output = str(shot / "guides/####.exr"), str(shot / "out/####.exr")
    files = Files(source, output, also=also)
    with pytest.raises(
        PictureError, match=r"the picture of .* lies in a file of --also"
    ):
        denoise_sequence(files, denoiser, reading=Reading(also=also))


def test_files_of_another_size_are_no_part_of_a_frame(
    shot: Path, denoiser: Denoiser
) -> None:
    small = np.zeros((4, 4), np.float32)
    for number in range(1, 4):
        exr.write_picture(shot / f"key_{number:04d}.exr", dict.fromkeys("RGB", small))
    also = (str(shot / "key_####.exr"),)
    files = Files(str(shot / "in/####.exr"), str(shot / "out/####.exr"), also=also)
    with pytest.raises(PictureError, match=r"key_0001.exr is no part of .*0001.exr"):
        denoise_sequence(files, denoiser, reading=Reading(also=also))


# Passes of these renderers; their picture is R, G, B without a layer.
OTHERS = {
    "Arnold": (
        ("diffuse_direct", "diffuse_indirect", "specular_direct", "emission"),
        ("RGBA_key", "RGBA_fill"),
    ),
    "RenderMan": (
        ("directDiffuse", "indirectDiffuse", "directSpecular", "emissive"),
        ("lightgroup_key", "lightgroup_fill"),
    ),
}


@pytest.mark.parametrize("renderer", OTHERS)
def test_files_of_other_renderers_add_up(
    renderer: str, tmp_path: Path, denoiser: Denoiser
) -> None:
    lobes, groups = OTHERS[renderer]
    names = {
        "radiance": "RGB",
        "albedo": "albedo.RGB",
        "normal": "N.XYZ",
        "depth": "Z",
        "id": "crypto00.RGB",
    } | {name: f"{name}.RGB" for name in (*lobes, *groups)}
    for number in range(1, 4):
        made = frame(number)
        light = made.radiance
        assert light is not None
        shares = np.random.default_rng(number).dirichlet(np.ones(4), light.shape[:2])
        parts = {n: light * shares[..., i, None] for i, n in enumerate(lobes)}
        parts |= {n: light * share for n, share in zip(groups, (0.3, 0.7), strict=True)}
        write(tmp_path / "in", made, names, id=np.full_like(light, 0.25), **parts)
    files = Files(str(tmp_path / "in/####.exr"), str(tmp_path / "out/####.exr"))
    result = denoise_sequence(
        files, denoiser, reading=Reading(light=Wanted((ALL,))), radius=0
    )
    assert result["left_out"] == []
    out, noisy = tmp_path / "out/0002.exr", tmp_path / "in/0002.exr"
    whole = picture(out)
    for kind in (lobes, groups):
        added = sum(picture(out, name) for name in kind)
        assert added == pytest.approx(whole, rel=1e-3, abs=1e-4)
        for name in kind:
            assert picture(out, name).min() >= 0.0
            assert np.std(picture(out, name)) < np.std(picture(noisy, name))
    assert np.array_equal(picture(out, "crypto00"), picture(noisy, "crypto00"))
