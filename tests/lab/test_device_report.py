"""`xrds bench device-report`, without a card: its rows, its files, going on."""

from __future__ import annotations

from pathlib import Path

import pytest

from xrds_lab.cards.report import bench_devices

pytestmark = pytest.mark.nightly  # it takes minutes

SIZE = (160, 90)


def run(out: Path, minutes: float = 20.0) -> dict:
    return bench_devices(
        out,
        shots=("hand_held",),
        sizes=[SIZE],
        samples=(2,),
        picture_samples=8,
        radii=(1,),
        minutes=minutes,
        rounds=1,
        reference_samples=8,
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("report")


def test_without_minutes_nothing_is_begun_and_all_is_told(folder: Path) -> None:
    found = run(folder, minutes=0.0)
    assert found["shots"] == []
    assert len(found["failures"]) == 2
    assert all("run it again" in why for why in found["failures"].values())


def test_a_second_run_goes_on_to_the_whole_report(folder: Path) -> None:
    found = run(folder)
    assert found["failures"] == {}
    # Cycles on both devices, the frame alone, radius 1, a whole shot
    assert len(found["shots"]) == 5
    for row in found["shots"]:
        assert row["psnr"] > 10.0
        if row["method"] == "xrds":
            assert row["pixels_apart"] == 0.0  # the processor twice
            assert row["cpu_total"] >= row["accumulate"] + row["cpu_denoise"] - 0.1
    names = {path.name for path in folder.iterdir()}
    assert {"results.json", "results.csv", "error-seconds.svg"} <= names
    assert "XRDS, radius 1" in (folder / "error-seconds.svg").read_text()
    methods = ["cycles_oidn", "same_picture", "same_samples"]
    assert [row["method"] for row in found["pans"]] == methods
    again = run(folder, minutes=0.0)
    assert again["shots"] == found["shots"]
