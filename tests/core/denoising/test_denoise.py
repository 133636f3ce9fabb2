from __future__ import annotations

import subprocess
import sys
import threading
import time
import weakref
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from xrds_core import denoising
from xrds_core.denoising import Denoiser, denoise, devices, input_images, oidn_device
from xrds_core.errors import Cancelled, OutOfMemory, PictureError, UsageError, XRDSError
from xrds_core.holes import BRIGHTEST

oidn = pytest.importorskip("mitsuba_oidn")

Array = NDArray[np.float32]
ON_LINUX = pytest.mark.skipif(sys.platform != "linux", reason="asks /proc")
SIZES = [(1, 1), (1, 2), (2, 1), (7, 5), (1, 64), (65, 33)]
POISON = [np.nan, np.inf, -np.inf, 1e30, -100.0, 65505.0, 1e-40]
NOT_LIGHT = [np.nan, np.inf, -np.inf, 1e30, -100.0]


def tiles(height: int, width: int, seed: int) -> Array:
    """Squares of 16 pixels, each of a colour of its own in [0.1, 0.9]."""
    random = np.random.default_rng(seed)
    few = random.uniform(0.1, 0.9, (-(-height // 16), -(-width // 16), 3))
    return few.repeat(16, 0).repeat(16, 1)[:height, :width].astype(np.float32)


def noise(shape: tuple[int, ...], strength: float, seed: int = 9) -> Array:
    random = np.random.default_rng(seed)
    return (strength * random.standard_normal(shape)).astype(np.float32)


def render(height: int, width: int) -> tuple[Array, Array, Array, Array]:
    """A truth that is its albedo under one light, its noisy radiance, and guides."""
    albedo, normal = tiles(height, width, 1), 2 * tiles(height, width, 2) - 1
    light = np.random.default_rng(3).exponential(1.0, albedo.shape)
    return albedo, (albedo * light).astype(np.float32), albedo, normal


def error(a: Array, b: Array) -> float:
    return float(np.sqrt(np.mean((a - b) ** 2)))


@pytest.fixture(scope="module")
def high() -> Denoiser:
    return Denoiser(device="cpu")


@pytest.fixture(scope="module", params=denoising.QUALITIES)
def denoiser(request: pytest.FixtureRequest) -> Denoiser:
    return Denoiser(request.param, device="cpu")


def test_removes_noise(denoiser: Denoiser) -> None:
    truth, noisy, albedo, normal = render(128, 128)
    result = denoiser(noisy, albedo, normal).radiance
    assert result.dtype == np.float32
    assert error(result, truth) < 0.25 * error(noisy, truth)


def test_better_qualities_are_better_and_guides_help() -> None:
    truth, noisy, albedo, normal = render(256, 256)
    guides = (albedo + noise(albedo.shape, 0.05), normal)
    errors = [
        error(Denoiser(quality)(noisy, *guides).radiance, truth)
        for quality in denoising.QUALITIES
        if quality != "accurate"  # what Blender does
    ]
    assert errors == sorted(errors)
    assert errors[0] < 0.8 * error(Denoiser()(noisy).radiance, truth)


# OIDN's quality for each guide.
PREFILTERS = {
    "best": {"albedo": "High", "normal": "Fast"},
    "accurate": {"albedo": "High", "normal": "High"},
    "high": {"albedo": "Fast", "normal": "Fast"},
    "medium": {"albedo": "Fast", "normal": "Fast"},
}


def by_hand(color: Array, guides: dict[str, Array], quality: str) -> Array:
    """What a quality promises, in OIDN's own words, but for the mean of `best`."""

    def run(images: dict[str, Array], quality: str, is_clean: bool = False) -> Array:
        task, result = oidn.Device().new_filter("RT"), np.empty_like(color)
        for name, image in (*images.items(), ("output", result)):
            task.set_image(name, image)
        task.quality = getattr(oidn.Quality, quality)
        task.hdr, task.clean_aux = "color" in images, is_clean
        task.execute()
        return result

    first = PREFILTERS.get(quality, {})
    images = {k: run({k: v}, first[k]) if first else v for k, v in guides.items()}
    images["color"] = color
    expected = run(images, denoising.QUALITIES[quality], bool(first))
    if quality != "best":
        return expected
    over = dict(zip(images, turned(*images.values()), strict=True))
    return (expected + run(over, "High", True)[::-1]) / 2


def turned(*images: Array) -> list[Array]:
    return [np.ascontiguousarray(x[::-1]) for x in images]


@pytest.mark.parametrize("limit", [None, 0])
def test_best_is_the_mean_of_both_ways_up(high: Denoiser, limit: int | None) -> None:
    given = render(51, 60)[1:]
    best = Denoiser("best", memory_limit=limit)(*given, guides_are_clean=True)
    ways = [
        high(*given, guides_are_clean=True).radiance,
        high(*turned(*given), guides_are_clean=True).radiance[::-1],
    ]
    np.testing.assert_array_equal(best.radiance, (ways[0] + ways[1]) * np.float32(0.5))


@pytest.mark.parametrize("quality", denoising.QUALITIES)
def test_qualities_are_what_they_promise(quality: str) -> None:
    denoiser = Denoiser(quality)
    _, noisy, albedo, normal = render(101, 90)
    result = denoiser(noisy, albedo, normal)
    light, *guides = turned(noisy, albedo, normal)  # as Blender has them
    named = dict(zip(("albedo", "normal"), guides, strict=True))
    expected = by_hand(light, named, quality)[::-1]
    if quality in PREFILTERS:
        assert result.prefiltered == ("albedo", "normal")
        np.testing.assert_allclose(result.radiance, expected, rtol=0, atol=5e-3)
    else:  # what Blender's own denoiser makes, to the bit
        assert not result.prefiltered
        np.testing.assert_array_equal(result.radiance, expected)


@pytest.mark.parametrize("value", POISON)
@pytest.mark.parametrize("place", ["radiance", "albedo", "normal", "all"])
def test_poison(high: Denoiser, place: str, value: float) -> None:
    _, *given = render(40, 48)
    names = ("radiance", "albedo", "normal")
    for name, array in zip(names, given, strict=True):
        if place in (name, "all"):
            array[10:13, 20:25] = value
    result = high(*given)
    assert np.isfinite(result.radiance).all()
    assert (result.radiance >= 0).all()
    in_radiance = 15 * (place in ("radiance", "all") and value in NOT_LIGHT)
    in_radiance = in_radiance or 15 * (np.isnan(value) and place in ("radiance", "all"))
    in_guides = {"radiance": 0, "all": 2}.get(place, 1) * 15 * (not np.isfinite(value))
    assert result.bad_pixels == in_radiance + in_guides


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, -1.0])
def test_poison_everywhere(high: Denoiser, value: float) -> None:
    given = [np.full((9, 11, 3), value, np.float32) for _ in range(3)]
    result = high(*given).radiance
    assert (result == 0).all()


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_lost_alpha_is_counted_and_keeps_the_colour(
    high: Denoiser, value: float
) -> None:
    _, noisy, albedo, normal = render(24, 20)
    whole = high(noisy, albedo, normal)
    alpha = np.full((*noisy.shape[:2], 1), value, np.float32)
    lost = high(np.dstack((noisy, alpha)), albedo, normal)
    assert lost.bad_pixels == whole.bad_pixels + alpha.size
    np.testing.assert_array_equal(lost.radiance[..., :3], whole.radiance)
    assert (lost.radiance[..., 3] == 1).all()


def test_one_bad_pixel_leaves_no_mark(high: Denoiser) -> None:
    _, noisy, albedo, normal = render(64, 64)
    noisy[:] = 0.5
    noisy[30, 30] = np.inf
    assert error(high(noisy, albedo, normal).radiance, np.float32(0.5)) < 0.01


@pytest.mark.parametrize("size", SIZES)
def test_sizes(denoiser: Denoiser, size: tuple[int, int]) -> None:
    _, noisy, albedo, normal = render(*size)
    for guides in ((albedo, normal), (albedo,), (None, normal), ()):
        result = denoiser(noisy, *guides).radiance
        assert result.shape == noisy.shape
        assert np.isfinite(result).all()


def test_black_stays_black(denoiser: Denoiser) -> None:
    told: list[float] = []
    _, noisy, albedo, normal = render(32, 32)
    result = denoiser(0 * noisy, albedo, normal, progress=told.append)
    assert (result.radiance == 0).all()
    assert told == [0.0, 1.0]


def test_zero_normals_and_constant_light(denoiser: Denoiser) -> None:
    flat = np.full((64, 64, 3), 0.25, np.float32)
    result = denoiser(flat, flat, np.zeros_like(flat)).radiance
    inside = result[8:-8, 8:-8]  # OIDN is not exact in corners
    np.testing.assert_allclose(inside, 0.25, rtol=0.02)


def test_light_scales(high: Denoiser) -> None:
    _, noisy, albedo, normal = render(64, 64)
    once = high(noisy, albedo, normal).radiance
    for factor in (2.0**-12, 2.0**12):
        scaled = high(factor * noisy, albedo, normal).radiance
        assert error(scaled / factor, once) < 1e-3


def test_albedo_above_one_counts_as_one(denoiser: Denoiser) -> None:
    _, noisy, albedo, normal = render(64, 64)
    results = []
    for lamp in (1.0, 50.0):
        albedo[20:40, 20:40] = lamp
        results.append(denoiser(noisy, albedo, normal).radiance)
    np.testing.assert_array_equal(*results)


def test_what_is_shown_as_it_is(high: Denoiser) -> None:
    truth, noisy, albedo, normal = render(64, 64)
    shown = np.clip(noisy, 0, 1)
    result = high(shown, albedo, normal, hdr=False).radiance
    assert result.max() <= 1
    assert error(result, truth) < error(shown, truth)


def test_alpha_and_inputs_stay_as_they_are(denoiser: Denoiser) -> None:
    _, noisy, albedo, normal = render(33, 47)
    alpha = np.linspace(-0.5, 1.5, 33 * 47, dtype=np.float32).reshape(33, 47, 1)
    given = [np.concatenate((noisy, alpha), axis=2), albedo, normal]
    given[0][3, 3, 0] = np.nan
    before = [x.copy() for x in given]
    for x in given:
        x.flags.writeable = False
    result = denoiser(*given).radiance
    np.testing.assert_array_equal(result[..., 3:], alpha)
    for x, y in zip(given, before, strict=True):
        np.testing.assert_array_equal(x, y)


@pytest.mark.parametrize("kind", ["flipped", "in columns", "float16", "float64"])
def test_arrays_of_any_kind(high: Denoiser, kind: str) -> None:
    given = [x.astype(np.float16).astype(np.float32) for x in render(24, 40)[1:]]
    if kind == "flipped":
        odd = [np.ascontiguousarray(x[::-1, ::-1])[::-1, ::-1] for x in given]
    elif kind == "in columns":
        odd = [np.asfortranarray(x) for x in given]
    else:
        odd = [x.astype(kind) for x in given]
    np.testing.assert_array_equal(high(*odd).radiance, high(*given).radiance)


def test_sizes_and_guides_that_change(denoiser: Denoiser) -> None:
    for height, width, count in ((20, 30, 2), (200, 150, 2), (90, 40, 1), (20, 30, 0)):
        given = render(height, width)[1 : 2 + count]
        fresh = Denoiser(denoiser.quality, "cpu")
        expected = fresh(*given).radiance
        np.testing.assert_array_equal(denoiser(*given).radiance, expected)


def test_progress(denoiser: Denoiser) -> None:
    told: list[float] = []
    denoiser(*render(160, 160)[1:], progress=told.append)
    assert told == sorted(told)
    assert (told[0], told[-1], told.count(1.0)) == (0.0, 1.0, 1)
    assert len(set(told)) > 10
    assert max(np.diff(told)) < 0.3


@pytest.mark.parametrize("when", [0.0, 0.1, 0.5, 0.9, 1.0])
def test_cancel(high: Denoiser, when: float) -> None:
    given = render(64, 64)[1:]
    told: list[float] = []

    def stop(fraction: float) -> bool:
        told.append(fraction)
        return fraction < when

    with pytest.raises(Cancelled):
        high(*given, progress=stop)
    assert sum(x >= when for x in told) == 1  # not asked again
    fresh = Denoiser(device="cpu")(*given).radiance
    np.testing.assert_array_equal(high(*given).radiance, fresh)


def test_cancel_saves_work(high: Denoiser) -> None:
    given = render(256, 256)[1:]
    seconds = []
    for stop in (2.0, 0.1):
        start = time.process_time()
        try:
            high(*given, progress=lambda fraction, stop=stop: fraction < stop)
        except Cancelled:
            assert stop == 0.1
        seconds.append(time.process_time() - start)
    assert seconds[1] < 0.5 * seconds[0]


def test_an_error_of_the_callback_passes(high: Denoiser) -> None:
    def fail(fraction: float) -> None:
        if fraction > 0.5:
            raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        high(*render(64, 64)[1:], progress=fail)


PEAK = """
import sys
from pathlib import Path
import numpy
from xrds_core.denoising import Denoiser

def peak():
    lines = Path("/proc/self/status").read_text("ascii").splitlines()
    return next(int(x.split()[1]) << 10 for x in lines if x.startswith("VmHWM"))

limit = int(sys.argv[1])
denoiser = Denoiser("fast", memory_limit=None if limit < 0 else limit)
light = numpy.full((1280, 1280, 3), 0.5, numpy.float32)
before = peak()
result = denoiser(light).radiance
print(peak() - before - result.nbytes, result.mean())
"""


def in_new_process(code: str, *arguments: str) -> str:
    command = [sys.executable, "-c", code, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert not done.returncode, done.stderr
    return done.stdout


@pytest.mark.nightly
@ON_LINUX
def test_memory_limit_holds() -> None:
    limit = 256 << 20
    free, limited = (in_new_process(PEAK, str(x)).split() for x in (-1, limit))
    assert int(limited[0]) < 1.2 * limit < 1.8 * limit < int(free[0])
    assert free[1] == limited[1]


def test_a_limit_beyond_any_memory_is_none() -> None:
    _, noisy, albedo, normal = render(60, 50)
    pictures = [
        Denoiser("fast", memory_limit=limit)(noisy, albedo, normal).radiance
        for limit in (None, 2**62)
    ]
    np.testing.assert_array_equal(*pictures)


def test_little_memory_takes_rows_as_they_are() -> None:
    _, noisy, albedo, normal = render(60, 50)
    result = Denoiser("fast", memory_limit=0)(noisy, albedo, normal).radiance
    expected = by_hand(noisy, {"albedo": albedo, "normal": normal}, "fast")
    np.testing.assert_array_equal(result, expected)


def test_tiles_leave_no_seam() -> None:
    given = render(600, 290)[1:]
    whole = Denoiser("fast")(*given).radiance
    few = Denoiser("fast", memory_limit=0)(*turned(*given)).radiance[::-1]
    np.testing.assert_allclose(few, whole, atol=1e-4)


@ON_LINUX
def test_frames_leak_nothing() -> None:
    given, fast = render(24, 24)[1:], Denoiser("fast")
    for _ in range(20):
        fast(*given)
    before = resident()
    for _ in range(200):
        fast(*given)
    assert resident() - before < 4 << 20


def resident() -> int:
    """Bytes of memory that this process holds."""
    import resource  # not on Windows

    pages = Path("/proc/self/statm").read_text("ascii").split()[1]
    return resource.getpagesize() * int(pages)


def test_no_array_is_kept(high: Denoiser) -> None:
    given = [x.view(Watched) for x in render(32, 32)[1:]]
    result = high(*given).radiance
    watched = [weakref.ref(x) for x in (*given, result)]
    del given, result
    assert not any(x() is not None for x in watched)


class Watched(np.ndarray[Any, Any]):
    """An array that a weak reference can watch, as any array can."""


def shot(strength: float) -> tuple[Array, Array, Array]:
    """A picture large enough to judge its guides, whose noise is of some strength."""
    y, x = np.mgrid[:640, :704].astype(np.float32) / 64
    waves = np.stack((np.sin(x + y), np.sin(2 * x - y), np.full_like(x, 2.0)), axis=2)
    albedo = 0.5 + 0.2 * waves + noise(waves.shape, strength)
    normal = waves / np.linalg.norm(waves, axis=2, keepdims=True)
    normal += noise(waves.shape, 2 * strength, 8)
    return np.ones_like(waves), albedo, normal


@pytest.mark.parametrize(
    ("strength", "prefiltered"),
    [(0.0, ()), (0.0003, ()), (0.005, ("albedo", "normal"))],
)
def test_guides_are_judged_by_their_noise(
    high: Denoiser, monkeypatch: pytest.MonkeyPatch, strength: float, prefiltered: Any
) -> None:
    monkeypatch.setattr(Denoiser, "_run", lambda *_: None)  # the judgement alone
    assert high(*shot(strength)).prefiltered == prefiltered


def test_one_noisy_guide_is_prefiltered_alone(
    high: Denoiser, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Denoiser, "_run", lambda *_: None)
    noisy, albedo, _ = shot(0.0)
    _, _, normal = shot(0.05)
    assert high(noisy, albedo, normal).prefiltered == ("normal",)


def test_a_lamp_is_no_noise(high: Denoiser, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Denoiser, "_run", lambda *_: None)
    noisy, albedo, normal = shot(0.0)
    albedo[100:300, 100:300] = 50.0
    assert high(noisy, albedo, normal).prefiltered == ()


def test_noise_of_one_spot_is_found(
    high: Denoiser, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Denoiser, "_run", lambda *_: None)
    noisy, albedo, normal = shot(0.0)
    albedo[70:120, 400:450] += noise((50, 50, 3), 0.1)
    assert high(noisy, albedo, normal).prefiltered == ("albedo",)


def test_the_caller_knows_best(denoiser: Denoiser) -> None:
    given = render(32, 32)[1:]
    both = ("albedo", "normal") if denoiser.quality in PREFILTERS else ()
    assert denoiser(*given, guides_are_clean=False).prefiltered == both
    assert denoiser(*given, guides_are_clean=True).prefiltered == ()


def test_clean_guides_help(denoiser: Denoiser) -> None:
    truth, *given = render(128, 128)
    errors = [
        error(denoiser(*given, guides_are_clean=clean).radiance, truth)
        for clean in (True, False)
    ]
    assert errors[0] < 1.02 * errors[1]
    assert errors[0] != errors[1]


def test_a_sample_holds_what_is_busy() -> None:
    guide = np.zeros((640, 704, 3), np.float32)
    guide[128:192, 192:256] = noise((64, 64, 3), 1.0)
    found = input_images.sample(guide)
    assert found is not None
    np.testing.assert_array_equal(found[:64, :64], guide[128:192, 192:256])
    assert not found[64:].any()
    assert input_images.sample(guide[:500, :500]) is None


def multiplies_half_floats() -> bool:
    described = Path("/proc/cpuinfo")
    return described.is_file() and "avx512_fp16" in described.read_text("utf-8")


def test_threads(high: Denoiser) -> None:
    given = render(96, 96)[1:]
    alone = high(*given).radiance
    one = Denoiser(device="cpu", threads=1)(*given).radiance
    # a processor that multiplies half floats rounds as the work is divided
    atol = 0.01 if multiplies_half_floats() else 1e-5
    np.testing.assert_allclose(one, alone, atol=atol)
    assert np.abs(one - alone).mean() < 1e-3  # another network is off by 0.03
    results: list[Array] = []
    calls = [
        threading.Thread(target=lambda: results.append(high(*given).radiance))
        for _ in range(4)
    ]
    for call in calls:
        call.start()
    for call in calls:
        call.join()
    np.testing.assert_array_equal(results, [alone] * 4)


class Apart:
    """A device that cannot see our memory, as that of a graphics card."""

    def __init__(self, device: Any) -> None:
        self.device = device

    def __getattr__(self, name: str) -> Any:
        return getattr(self.device, name)

    def can_share(self, array: Array) -> bool:
        return False


def test_a_device_with_memory_of_its_own(high: Denoiser) -> None:
    _, noisy, albedo, normal = render(50, 70)
    picture = np.dstack((noisy, albedo[..., 0]))
    other = Denoiser(device="cpu")
    other._device = Apart(other._device)
    expected = high(picture, albedo, normal).radiance
    np.testing.assert_array_equal(other(picture, albedo, normal).radiance, expected)


def test_one_call_does_it() -> None:
    given = render(24, 24)[1:]
    expected = Denoiser()(*given).radiance
    np.testing.assert_array_equal(denoise(*given), expected)


def test_devices_are_named() -> None:
    assert "cpu" in devices()
    assert Denoiser(device="auto").device == devices()[0]


def one_line(info: pytest.ExceptionInfo[BaseException]) -> str:
    text = str(info.value)
    assert text
    assert "\n" not in text
    return text


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (
            {"quality": "good"},
            "'good' is not among best, accurate, high, medium, balanced, fast",
        ),
        ({"device": "tpu"}, "'tpu' is not among auto, cpu"),
        ({"threads": -1}, "threads is -1"),
        ({"memory_limit": -1}, "memory_limit is -1"),
    ],
)
def test_wrong_options(options: dict[str, Any], told: str) -> None:
    with pytest.raises(UsageError) as info:
        Denoiser(**options)
    assert told in one_line(info)


def test_a_device_that_is_not_here() -> None:
    absent = next(name for name in ("cuda", "metal") if name not in devices())
    with pytest.raises(UsageError) as info:
        Denoiser(device=absent)
    assert "use auto, or one of: " in one_line(info)


@pytest.mark.parametrize(
    ("shapes", "told"),
    [
        (((4, 4, 2),), "radiance has the shape (4, 4, 2)"),
        (((0, 4, 3),), "radiance has the shape (0, 4, 3)"),
        (((4, 4, 3), (4, 5, 3)), "albedo is 5x4 pixels, but radiance is 4x4"),
        (((4, 4, 3), (4, 4, 3), (4, 4, 1)), "normal has the shape (4, 4, 1)"),
    ],
)
def test_arrays_that_do_not_fit(high: Denoiser, shapes: Any, told: str) -> None:
    with pytest.raises(PictureError) as info:
        high(*(np.zeros(shape, np.float32) for shape in shapes))
    assert told in one_line(info)


def test_integers_are_no_light(high: Denoiser) -> None:
    with pytest.raises(PictureError, match="holds uint8"):
        high(np.zeros((4, 4, 3), np.uint8))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("kind", "expected"), [(MemoryError, OutOfMemory), (oidn.Error, XRDSError)]
)
def test_errors_of_the_library(
    high: Denoiser, monkeypatch: pytest.MonkeyPatch, kind: Any, expected: Any
) -> None:
    def fail(*_: Any) -> None:
        raise kind("first\nsecond")

    monkeypatch.setattr(Denoiser, "_execute", fail)
    with pytest.raises(expected) as info:
        high(*render(4, 4)[1:])
    one_line(info)


@pytest.mark.parametrize("broken", ["missing", "damaged"])
def test_no_library(monkeypatch: pytest.MonkeyPatch, broken: str) -> None:
    def fail(name: str) -> None:
        raise ImportError("libmitsuba_oidn.so: no such file\nand more")

    if broken == "missing":
        monkeypatch.setitem(sys.modules, "mitsuba_oidn", None)
    else:
        monkeypatch.setattr(oidn_device, "import_module", fail)
    for ask in (Denoiser, devices):
        with pytest.raises(XRDSError) as info:
            ask()
        text = one_line(info)
        assert text.startswith("cannot load Open Image Denoise (")
        assert text.endswith("-m pip install mitsuba-oidn")


def test_closing_gives_memory_back() -> None:
    denoiser = Denoiser(device="cpu")
    given = render(24, 24)[1:]
    denoiser(*given)
    denoiser.close()
    denoiser.close()
    with pytest.raises(UsageError, match="closed"):
        denoiser(*given)


END = """
import numpy
from xrds_core.denoising import Denoiser, denoise
light = numpy.ones((8, 8, 3), numpy.float32)
kept = Denoiser()
kept(light)
denoise(light)
"""


def test_a_program_ends_without_a_word() -> None:
    command = [sys.executable, "-c", END]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout + done.stderr == ""


LEAN = """
import sys
sys.modules["torch"] = None
import xrds_core, xrds_core.denoising
assert "mitsuba_oidn" not in sys.modules
import numpy
light = numpy.ones((8, 8, 3), numpy.float32)
xrds_core.denoising.denoise(light, light, light)
"""


def test_needs_no_torch_and_loads_late() -> None:
    in_new_process(LEAN)


def test_the_brightest_light_is_kept(high: Denoiser) -> None:
    light = np.full((8, 8, 3), BRIGHTEST, np.float32)
    assert high(light).bad_pixels == 0
