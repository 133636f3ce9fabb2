"""Parts of the light, denoised with the picture's guides."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from xrds_core.denoising import QUALITIES, Denoiser
from xrds_core.errors import PictureError

pytest.importorskip("mitsuba_oidn")

Array = NDArray[np.float32]


@pytest.fixture(scope="module")
def high() -> Denoiser:
    return Denoiser(device="cpu")


def in_parts(count: int = 2) -> tuple[Array, dict[str, Array], Array, Array]:
    """The truth of each of some equal parts, the noisy ones, and guides."""
    random = np.random.default_rng(1)
    albedo = random.uniform(0.2, 0.9, (6, 8, 3)).repeat(16, 0).repeat(16, 1)
    albedo = albedo.astype(np.float32)
    normal = np.zeros_like(albedo)
    normal[..., 2] = 1.0
    light = random.exponential(1.0, (count, *albedo.shape[:2], 1)).astype(np.float32)
    parts = {f"part {n}": albedo * x / count for n, x in enumerate(light)}
    return albedo / count, parts, albedo, normal


def error(a: Array, b: Array) -> float:
    return float(np.sqrt(np.mean((a - b) ** 2)))


@pytest.mark.parametrize("quality", QUALITIES)
def test_parts_are_denoised(quality: str) -> None:
    truth, parts, albedo, normal = in_parts()
    picture = sum(parts.values())
    found = Denoiser(quality, device="cpu")(picture, albedo, normal, parts=parts)
    assert list(found.parts) == list(parts)
    for name, part in parts.items():
        assert error(found.parts[name], truth) < 0.25 * error(part, truth)


@pytest.mark.parametrize("quality", ["best", "high"])
@pytest.mark.parametrize("limit", [None, 0])
def test_the_picture_is_the_same_with_and_without(
    quality: str, limit: int | None
) -> None:
    _, parts, albedo, normal = in_parts()
    denoiser = Denoiser(quality, device="cpu", memory_limit=limit)
    picture = sum(parts.values())
    plain = denoiser(picture, albedo, normal).radiance
    assert np.array_equal(
        denoiser(picture, albedo, normal, parts=parts).radiance, plain
    )


def test_the_one_part_is_the_picture(high: Denoiser) -> None:
    _, parts, albedo, normal = in_parts(1)
    (part,) = parts.values()
    found = high(part, albedo, normal, parts=parts)
    assert np.array_equal(found.parts["part 0"], found.radiance)


def test_many_parts_take_a_smaller_network(high: Denoiser) -> None:
    networks = [
        high._choose_part_network(count).network for count in (1, 3, 4, 8, 9, 40)
    ]
    assert networks == ["High", "High", "Balanced", "Balanced", "Fast", "Fast"]
    fast = Denoiser("balanced", device="cpu")
    assert [fast._choose_part_network(x).network for x in (1, 9)] == [
        "Balanced",
        "Fast",
    ]


def test_what_has_no_light_costs_nothing(
    high: Denoiser, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, parts, albedo, normal = in_parts()
    picture, runs = sum(parts.values()), []
    execute = high._execute
    monkeypatch.setattr(
        high, "_execute", lambda task, *rest: (runs.append(1), execute(task, *rest))
    )
    high(picture, albedo, normal, guides_are_clean=True)
    dark = dict.fromkeys("abcd", np.zeros_like(picture))
    found = high(picture, albedo, normal, parts=dark, guides_are_clean=True)
    assert len(runs) == 2
    assert not any(part.any() for part in found.parts.values())


def test_bad_pixels_of_parts_are_counted(high: Denoiser) -> None:
    _, parts, albedo, normal = in_parts()
    picture = sum(parts.values())
    parts["part 0"][3, 4] = np.nan
    found = high(picture, albedo, normal, parts=parts)
    assert found.bad_pixels == 1
    assert np.isfinite(found.parts["part 0"]).all()


def test_parts_have_the_pictures_size(high: Denoiser) -> None:
    _, parts, albedo, normal = in_parts()
    picture = sum(parts.values())
    with pytest.raises(PictureError, match="key is 128x10 pixels"):
        high(picture, albedo, normal, parts={"key": picture[:10]})


def test_progress_covers_the_parts(high: Denoiser) -> None:
    _, parts, albedo, normal = in_parts(5)
    told: list[float] = []
    high(sum(parts.values()), albedo, normal, parts=parts, progress=told.append)
    assert told == sorted(told)
    assert told[0] == 0.0
    assert told[-1] == 1.0
