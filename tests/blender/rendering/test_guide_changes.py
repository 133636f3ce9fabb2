"""Guides are kept only as long as they are right: every change of a table is tried.

Each case opens a stage whose guides are kept, changes one thing, and compares what the
cache then gives with guides rendered without it, pass by pass. `--every-change` tries
the whole table, which takes a minute or two; else one in six, and those that were wrong
once.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from guides import deeds, settings, stage

from xrds_blender.cycles import passes as cycles_passes
from xrds_blender.cycles.passes import CyclesPasses
from xrds_blender.interface.registration import ensure_registered
from xrds_blender.planning.plan import GuideRender, savings_but
from xrds_blender.planning.request import Request, render_request
from xrds_blender.rendering import guide_cache
from xrds_blender.rendering import guides as frame_guides
from xrds_blender.rendering.blender_job import call_engine, run_job
from xrds_blender.rendering.facts import find_facts
from xrds_blender.rendering.guide_cache import TOLERANCE
from xrds_blender.rendering.guides import GuideSource
from xrds_lab.studio import traps
from xrds_lab.studio.nodes import Surface

pytestmark = pytest.mark.nightly  # it takes minutes

KEPT = render_request(scale=2, samples=1, guide_samples=1, seed=1)
ANEW = replace(KEPT, savings=savings_but("guide cache"))
Passes = dict[tuple[str, str], np.ndarray]


@dataclass(frozen=True)
class Case:
    """A change of a stage, before whose guides `camera` was chosen."""

    name: str
    stage: str
    change: Callable[[Path], None]
    camera: str = "Main"

    def __str__(self) -> str:
        return f"{self.stage}: {self.name}"


def cases(
    kind: str, rows: dict[str, Any], done: tuple[deeds.Deed, ...] = (), **more: str
) -> list[Case]:
    single = [
        Case(path, kind, lambda _, p=path, v=value: settings.put(p, v), **more)
        for path, value in rows.items()
    ]
    return single + [Case(deed.__name__, kind, deed, **more) for deed in done]


STILL = settings.CAMERA | settings.RENDER | settings.OBJECT
CASES = [
    *cases("still", STILL | settings.SHADING | settings.SHAPES, deeds.STILL),
    *cases("still", settings.LENS, deeds.LENS, camera="Lens"),
    *cases("timed", settings.TIMED, deeds.TIMED),
    *cases("clocked", {}, (deeds.next_frame,)),
    *cases("seen", settings.SEEN),
]
HARMLESS = cases("still", settings.HARMLESS, deeds.HARMLESS)
SHARE = 6
# Each took the guides of before once.
ONCE_WRONG = (
    "use_sky use_solid use_strand pass_alpha_threshold cut_by_marker camera "
    "sequence_file_rewritten lifetime driven_modifier vertex_weight frame_start "
    'objects["Copies"].color ["hue"] ["layer_mood"] Socket_2.value ["Socket_2"] '
    "focused_bone_moves file_of_equal_size_and_time layer_path_shown next_frame "
    "remesh_voxel_size audio_volume lamp_added viewer viewer_as_texture"
)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    for name, table in (("case", CASES), ("harmless", HARMLESS)):
        if name not in metafunc.fixturenames:
            continue
        chosen = [
            each
            for number, each in enumerate(table)
            if metafunc.config.getoption("--every-change")
            or number % SHARE == 0
            or each.name.endswith(tuple(ONCE_WRONG.split()))
        ]
        metafunc.parametrize(name, chosen, ids=str)


@pytest.fixture(scope="module")
def stages(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """The folder of a stage of a kind, built when first asked for."""
    built: dict[str, Path] = {}

    def folder(kind: str) -> Path:
        if kind not in built:
            built[kind] = tmp_path_factory.mktemp(kind)
            stage.save(built[kind], kind)
        return built[kind]

    return folder


@pytest.fixture(autouse=True)
def small_probe(monkeypatch: pytest.MonkeyPatch) -> None:
    """An eighth of the tiny pictures, too, as of large ones."""
    ensure_registered()
    monkeypatch.setattr(cycles_passes, "PROBE_PIXELS", 100)


def guides(job: Request, told: list[str] | None = None) -> tuple[str, str, Passes]:
    """What the cache says of itself, why, and every pass of the guides.

    What goes to the log goes into `told`.
    """

    def report(_: set[str], text: str) -> None:
        if told is not None:
            told.append(text)

    def work(engine: Any, depsgraph: Any) -> tuple[str, str, Passes]:
        with CyclesPasses(engine, depsgraph) as passes:
            facts = find_facts(depsgraph, job.settings)
            chosen = job.plan(facts)
            source = GuideSource(passes, depsgraph, job, chosen, facts, report)
            found = source.guides()
            kept = passes.data_passes()
            kept |= {(view, "alpha"): each.alpha for view, each in found.items()}
            return source.decision.value, source.decision.reason, kept

    return call_engine(bpy.context.scene, work)


def differ(first: Passes, second: Passes) -> list[str]:
    """The passes that are not those of the same scene."""
    return [
        f"{view} {name}"
        for view, name in first.keys() | second.keys()
        if (view, name) not in first
        or (view, name) not in second
        or first[view, name].shape != second[view, name].shape
        or not np.allclose(
            first[view, name], second[view, name], TOLERANCE, TOLERANCE, equal_nan=True
        )
    ]


def changed(case: Case, base: Path, folder: Path) -> tuple[str, Passes, Passes]:
    """What the cache says after the change, its guides, and those without it."""
    work = folder / "work"
    shutil.copytree(base, work)
    bpy.ops.wm.open_mainfile(filepath=str(work / "stage.blend"))
    bpy.context.scene.camera = bpy.data.objects[case.camera]
    guides(KEPT)
    case.change(work)
    said, _, kept = guides(KEPT)
    return said, kept, guides(ANEW)[2]


def test_no_change_takes_guides_that_are_not_its_own(
    case: Case,
    stages: Callable[[str], Path],
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
) -> None:
    said, kept, anew = changed(case, stages(case.stage), tmp_path)
    assert not differ(kept, anew), f"{said}: {case}"
    assert not guide_cache.CACHE.holes, "the probe alone knew it"
    assert "bpy.rna" not in "".join(capfd.readouterr())  # of properties that were read


def test_what_guides_do_not_depend_on_takes_them(
    harmless: Case,
    stages: Callable[[str], Path],
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
) -> None:
    said, kept, anew = changed(harmless, stages(harmless.stage), tmp_path)
    assert said == "used 1 samples"
    assert not differ(kept, anew)
    assert "bpy.rna" not in "".join(capfd.readouterr())


def test_a_key_with_a_hole_costs_a_render_and_no_picture(
    stages: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A camera that the key does not see: the probe does, and the log says so."""
    monkeypatch.setattr(frame_guides, "guide_key", lambda *_: "always the same")
    told: list[str] = []
    bpy.ops.wm.open_mainfile(filepath=str(stages("still") / "stage.blend"))
    assert guides(KEPT)[0] == "cached 1 samples"
    assert guides(KEPT, told)[0] == "used 1 samples"
    assert not told
    deeds.cut_by_marker(Path())
    said, reason, kept = guides(KEPT, told)
    assert said == "cached 1 samples"
    assert "a probe render shows other guides" in reason
    assert "guide cache: nothing XRDS looks at has changed, but" in told[0]
    assert not differ(kept, guides(ANEW)[2])
    assert guide_cache.CACHE.holes == 1


PROBED = GuideRender(4, False, False, False, False)


def probes(order: str) -> Iterator[bytes]:
    """The bytes of each probe (p) among pictures (b) and guides (g) of one session."""

    def work(passes: CyclesPasses) -> list[bytes]:
        found = []
        for each in order:
            if each == "p":
                found.append(passes.probe(PROBED).values.tobytes())
            elif each == "b":
                passes.beauty(2, 16, denoise=False)
            else:
                passes.guides_by_view(4, how=PROBED)
        return found

    yield from run_job(bpy.context.scene, work)


@pytest.mark.parametrize("trap", ["mirror", "fog", "displaced"])
def test_a_probe_is_the_same_whatever_was_rendered_before(trap: str) -> None:
    """Guides are not: Cycles lays its samples out for the most it was asked for."""
    traps.trap(trap, 96, 72)
    found = {each for order in ("p", "bp", "gbpp") for each in probes(order)}
    assert len(found) == 1


def test_a_probe_changes_no_render_after_it() -> None:
    def beauties(order: str) -> bytes:
        def work(passes: CyclesPasses) -> bytes:
            for each in order:
                if each == "p":
                    passes.probe(PROBED)
                else:
                    picture = passes.beauty(2, 16, denoise=False).radiance
            return picture.tobytes()

        return run_job(bpy.context.scene, work)

    traps.trap("mirror", 96, 72)
    assert beauties("b") == beauties("pb") == beauties("bpb")


def test_bevelled_edges_of_a_texture_find_their_guides_again() -> None:
    """Blender rounds their texture coordinates in another order each time."""
    traps.trap("plain", 96, 72)
    thing = bpy.data.objects["Thing"]
    surface = Surface("Textured")
    where = surface.add("TexCoord").outputs["UV"]
    noise = surface.add("TexNoise", Vector=where, Scale=20.0)
    surface.set(Base_Color=noise.outputs["Color"])
    thing.data.materials[0] = surface.material
    bevel = thing.modifiers.new("Bevel", "BEVEL")
    bevel.width, bevel.limit_method = 0.02, "NONE"
    said = [guides(KEPT)[0] for _ in range(6)]
    assert said == ["cached 1 samples", *["used 1 samples"] * 5]
    thing.data.uv_layers[0].data[7].uv = (0.9, 0.1)
    assert guides(KEPT)[0] == "cached 1 samples"
