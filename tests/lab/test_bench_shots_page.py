"""report.html of shots: what it holds, and what its script makes of that."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import run_page

from xrds_lab.shots import page
from xrds_lab.shots.bench import compared
from xrds_lab.shots.crops import REFERENCE, SIZE, SceneCrops, crop_key
from xrds_lab.shots.methods import DEFAULT, XRDS

SCENES = ("car", "house", "<b>cave")
PSNR = {"car": 30.0, "house": 34.0, "<b>cave": 26.0}


def points(**more: Any) -> list[dict[str, Any]]:
    """Two methods at two numbers of samples; the second gains least in the house."""
    found = []
    for scene in SCENES:
        gain = 1.0 if scene == "house" else 4.0
        for samples in (2, 4):
            for method, radius, over in ((DEFAULT, 0, 0.0), (XRDS, 4, gain)):
                point = {"scene": scene, "motion": "pan", "method": method}
                point |= {"samples": samples, "radius": radius, "seed": 0}
                point |= {"psnr": PSNR[scene] + samples + over, "flip": 0.1}
                point |= {"relmse_trimmed": 0.02, "flicker": None}
                point |= {"seconds_per_frame": 5.0 * samples - (method == XRDS)}
                found.append(point | more)
    return found


def results(found: list[dict[str, Any]]) -> dict[str, Any]:
    return {"shots": found} | compared(found)


def crops(folder: Path, found: list[dict[str, Any]]) -> dict[Any, Path]:
    """A file for each point and reference; the two methods' are the same at 4."""
    files = {}
    for key in [*map(crop_key, found), *((s, "pan", *REFERENCE) for s in SCENES)]:
        path = folder / f"{SCENES.index(key[0])}-{'-'.join(map(str, key[1:]))}.webp"
        path.write_text(f"{key[0]} {'same' if key[3] == 4 else key[2]}")
        files[key] = path
    return files


def test_summaries_are_of_the_scenes() -> None:
    found = points()
    made = page.content(results(found), {})
    (own,) = (s for s in made["summaries"] if s["series"] == 1 and s["samples"] == 2)
    of = sorted([36.0, 37.0, 32.0])
    assert own["psnr"] == pytest.approx(np.percentile(of, (5, 50, 95)), abs=1e-3)
    assert own["seconds"] == 9.0
    assert own["flicker"] is None
    assert own["gain"]["worst_scene"] == "house"
    assert own["gain"]["worst"] == pytest.approx(1.0)
    assert made["series"][1]["name"] == "XRDS, radius 4"
    usual = made["series"][made["default"]]
    assert usual["name"] == "Cycles + OIDN"


def test_a_median_is_of_all_scenes_or_none() -> None:
    found = points()
    del found[-1]  # the last scene lacks a method's 4 samples
    made = page.content(results(found), {})
    assert len(made["points"]) == 11
    cases = [(s["series"], s["samples"]) for s in made["summaries"]]
    assert cases == [(0, 2), (1, 2), (0, 4)]
    found[0]["seconds_per_frame"] = None
    made = page.content(results(found), {})
    assert made["summaries"][0]["seconds"] is None


def test_pictures_are_held_once_and_only_whole_motions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = points() + points(motion="still")
    files = crops(tmp_path, found[:12])
    still = {(k[0], "still", *k[2:]): path for k, path in files.items()}
    made = page.content(results(found), files)
    assert len(made["crops"]) == 4 * len(SCENES)
    shown = {p["crop"] for p in made["points"] if p["samples"] == 4}
    assert len(shown - {None}) == len(SCENES)
    size = sum(map(len, made["crops"]))
    monkeypatch.setattr(page, "LARGEST", 2 * size - 1)
    made = page.content(results(found), files | still)
    assert all((p["crop"] is None) == (p["motion"] == "still") for p in made["points"])
    assert made["references"]["car still"] is None


def test_the_page_needs_no_other_file(tmp_path: Path) -> None:
    page.write(tmp_path / "report.html", results(points()), {})
    text = (tmp_path / "report.html").read_text("utf-8")
    addresses = set(re.findall(r"\w+://[^\"' ]+", text))
    assert addresses == {"http://www.w3.org/2000/svg"}
    assert not re.search(r"<link|\bsrc=|@import|fetch\(", text)
    assert "<b>cave" not in text  # names end no script


ASKS = """
const marks = () => places.plot.find(x => x.attributes.class === "mark");
const choose = value => {
    const holds = box => box.children.some(option => option.value === value);
    const [box] = places.choice.find(x => x.name === "select" && holds(x));
    box.value = value;
    box.fire("change");
};
const images = () => places.crops.find(x => x.name === "img").map(x => x.alt);
"""


def written(folder: Path) -> Path:
    found = points()
    page.write(folder / "report.html", results(found), crops(folder, found))
    return folder / "report.html"


def test_pointing_at_a_mark_tells_its_figures(tmp_path: Path) -> None:
    told = run_page(
        written(tmp_path),
        ASKS
        + """
const all = marks();
all[2].fire("mouseenter");
answer({ count: all.length, told: places.told.words, label: all[2].attributes });
""",
    )
    assert told["count"] == 4
    for text in (told["told"], told["label"]["aria-label"]):
        assert "XRDS, radius 4, 2 samples per frame, pan, median of 3 scenes" in text
        assert "Seconds of a frame: 9.00" in text
        assert "PSNR, dB (sRGB): 36.00 (32.40 to 36.90)" in text
        assert "worst scene house +1.00 dB" in text
        assert "flicker" not in text


def test_a_scene_shows_its_own_figures(tmp_path: Path) -> None:
    told = run_page(
        written(tmp_path),
        ASKS
        + """
choose("house");
const all = marks();
all[2].fire("mouseenter");
const bars = places.plot.find(x => x.attributes.class === "bar");
answer({ told: places.told.words, count: all.length, bars: bars.length });
""",
    )
    assert "PSNR, dB (sRGB): 37.00" in told["told"]
    assert "Over Cycles + OIDN: +1.00 dB" in told["told"]
    assert (told["count"], told["bars"]) == (4, 0)


def test_a_click_shows_crops_beside_the_reference(tmp_path: Path) -> None:
    told = run_page(
        written(tmp_path),
        ASKS
        + """
marks()[2].fire("click");
const all = images();
choose("house");
answer({ all, one: images(), pressed: marks().map(x => x.attributes["aria-pressed"]) });
""",
    )
    assert len(told["all"]) == 3 * len(SCENES)
    assert told["one"] == [
        "house, reference",
        "house, Cycles + OIDN, 2 spp: 36.00 dB",
        "house, XRDS, radius 4, 2 spp: 37.00 dB",
    ]
    assert told["pressed"] == ["false", "false", "true", "false"]


def test_keys_go_from_mark_to_mark(tmp_path: Path) -> None:
    told = run_page(
        written(tmp_path),
        ASKS
        + """
const all = marks();
const stops = () => all.map(x => x.attributes.tabindex);
const before = stops();
all[0].focus();
all[0].fire("keydown", { key: "ArrowLeft" });
document.activeElement.fire("keydown", { key: "Enter" });
answer({ before, after: stops(), at: all.indexOf(document.activeElement),
         shown: places.crops.words });
""",
    )
    assert told["before"] == ["0", "-1", "-1", "-1"]
    assert told["after"] == ["-1", "-1", "-1", "0"]
    assert told["at"] == 3
    assert "XRDS, radius 4, 4 spp, pan" in told["shown"]


def test_a_page_without_seconds_or_crops_says_so(tmp_path: Path) -> None:
    found = points(seconds_per_frame=None)
    page.write(tmp_path / "report.html", results(found), {})
    told = run_page(
        tmp_path / "report.html",
        ASKS
        + """
const count = marks().length;
marks()[0].fire("click");
choose("seconds");
answer({ count, crops: places.crops.words, plot: places.plot.words });
""",
    )
    assert told["count"] == 4  # over samples then
    assert "holds no crop" in told["crops"]
    assert "No frames of these were timed" in told["plot"]


def test_one_scene_is_shown_as_it_is(tmp_path: Path) -> None:
    found = [p for p in points() if p["scene"] == "house"]
    page.write(tmp_path / "report.html", results(found), {})
    asks = 'marks()[2].fire("mouseenter"); answer(places.told.words);'
    told = run_page(tmp_path / "report.html", ASKS + asks)
    assert "2 samples per frame, pan, house" in told


# --- crops ----------------------------------------------------------------------------


def test_crops_are_where_two_pictures_differ_most(tmp_path: Path) -> None:
    from PIL import Image

    reference = np.zeros((3 * SIZE, 4 * SIZE, 3), np.float32)
    one, other = reference.copy(), reference.copy()
    place = slice(160, 160 + SIZE), slice(240, 240 + SIZE)
    one[place], reference[place] = 0.5, 0.25
    kept = SceneCrops(tmp_path, "car")
    assert not kept.has_place("pan")
    kept.settle("pan", (one, other), reference, stops=1.0)
    kept.keep("key", "pan", one, stops=1.0)
    again = SceneCrops(tmp_path, "car")
    assert again.has_place("pan")
    for path, shown in (
        (again.path("key"), 255),  # half, brightened by a stop
        (again.references()["pan"], 188),
    ):
        with Image.open(path) as picture:
            pixels = np.asarray(picture.convert("RGB"))
        assert pixels.shape == (SIZE, SIZE, 3)
        assert np.abs(pixels.astype(int) - shown).max() <= 2
