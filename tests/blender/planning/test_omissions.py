"""Nothing that guides show is left out: scenes built to trap each decision."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from xrds_blender import run_job
from xrds_blender.interface.registration import ensure_registered
from xrds_blender.planning import plan
from xrds_blender.planning.request import render_request
from xrds_blender.planning.settings import Settings
from xrds_blender.rendering.blender_job import call_engine
from xrds_blender.rendering.explain import explain
from xrds_blender.rendering.facts import find_facts
from xrds_lab.studio import traps

pytestmark = pytest.mark.nightly  # it takes minutes

SAMPLES = 32
# What the guide render may do less, by itself.
LESS = {
    "bounces": plan.GuideRender(bounces=0),
    "lamps": plan.GuideRender(lamps=False),
}


@pytest.fixture(autouse=True)
def registered() -> None:
    ensure_registered()


def small(name: str) -> Any:
    return traps.trap(name, 64, 48)


def guides(passes: Any, how: plan.GuideRender, seed: int = 1) -> np.ndarray:
    """Albedo as a network takes it, and normal: (H, W, 6)."""
    rendered = passes.guides_by_view(SAMPLES, seed=seed, how=how)[""]
    return np.concatenate([rendered.albedo.clip(0, 1), rendered.normal], -1)


def distance(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.abs(one - other).mean())


@pytest.mark.parametrize("name", traps.TRAPS)
def test_the_plan_leaves_guides_as_they_are(name: str) -> None:
    scene = small(name)

    def job(passes: Any) -> Any:
        facts = find_facts(passes._depsgraph, Settings())
        how = plan.decide(facts).guides
        whole = [guides(passes, plan.GuideRender(), seed) for seed in (1, 2)]
        return how, whole, guides(passes, how)

    how, (whole, other), short = run_job(scene, job)
    assert how != plan.GuideRender()
    assert distance(short, whole) <= distance(other, whole)


@pytest.mark.parametrize(
    ("name", "omission"),
    [
        ("mirror", "bounces"),
        ("gloss", "bounces"),
        ("glass", "bounces"),
        ("lacquer", "bounces"),
        ("hidden", "bounces"),
        ("seen_lamp", "lamps"),
        ("mirrored_lamp", "lamps"),
        ("linked_lamp", "lamps"),
    ],
)
def test_the_traps_are_traps(name: str, omission: str) -> None:
    """What the plan keeps would be missed, and by more than noise."""
    if bpy.app.version >= (5, 1) and name in {"gloss", "lacquer"}:
        pytest.skip("guides of this Blender do not follow gloss and coats")
    scene = small(name)

    def job(passes: Any) -> Any:
        facts = find_facts(passes._depsgraph, Settings())
        whole = [guides(passes, plan.GuideRender(), seed) for seed in (1, 2)]
        return plan.decide(facts).guides, whole, guides(passes, LESS[omission])

    how, (whole, other), short = run_job(scene, job)
    assert distance(short, whole) > 1.5 * distance(other, whole)
    kept = how.bounces > 0 if omission == "bounces" else how.lamps
    assert kept


def test_a_pass_after_the_guides_has_its_lights_again() -> None:
    scene = small("screen")

    def job(passes: Any) -> Any:
        before = passes.beauty(2, 4, denoise=False, seed=1).radiance
        dark = plan.GuideRender(0, False, False, False, False)
        passes.guides_by_view(2, seed=1, how=dark)
        return before, passes.beauty(2, 4, denoise=False, seed=1).radiance

    before, after = run_job(scene, job)
    np.testing.assert_array_equal(after, before)
    assert before.mean() > 0.05


def decided(scene: Any) -> plan.Plan:
    facts = call_engine(scene, lambda _, graph: find_facts(graph, Settings()))
    return plan.decide(replace(facts, has_denoiser=True))


def remove_shapes(scene: Any, *but: str) -> None:
    for item in list(scene.objects):
        if item.type == "MESH" and item.name not in but:
            bpy.data.objects.remove(item)


def test_only_emission_needs_no_denoiser() -> None:
    scene = small("screen")
    assert decided(scene).denoise
    remove_shapes(scene, "Thing")
    assert not decided(scene).denoise

    def job(passes: Any) -> list[np.ndarray]:
        return [passes.beauty(2, 64, denoise=False, seed=s).radiance for s in (1, 2)]

    one, other = run_job(scene, job)
    assert np.median(np.abs(one - other)) < 1e-4  # edges alone differ
    assert one.max() > 0.5


def test_an_empty_scene_needs_no_guides() -> None:
    scene = small("plain")
    remove_shapes(scene)
    assert not decided(scene).render_guides
    scene = small("sky")
    remove_shapes(scene)
    assert decided(scene).render_guides


@pytest.mark.parametrize(
    ("name", "samples"), [("plain", 2), ("texture", 4), ("mirror", 4), ("sky", 4)]
)
def test_samples_follow_detail(name: str, samples: int) -> None:
    assert decided(small(name)).guide_samples == samples


def test_motion_blur_needs_motion() -> None:
    scene = small("still_motion")
    assert not decided(scene).motion_blur
    lamp = bpy.data.objects["Lamp"]
    lamp.keyframe_insert("location", frame=1)
    assert decided(scene).motion_blur


def test_holding_still_is_no_motion_blur() -> None:
    scene = small("texture")
    red = bpy.data.objects["Red"]
    for frame, x in ((1, -3.0), (3, 3.0)):
        red.location.x = x
        red.keyframe_insert("location", frame=frame)
    scene.frame_set(2)

    def picture(blurred: bool, still: bool) -> np.ndarray:
        scene.render.use_motion_blur = blurred

        def job(passes: Any) -> np.ndarray:
            if still:
                passes.hold_still()
            return passes.beauty(2, 4, denoise=False, seed=1).radiance

        return run_job(scene, job)

    sharp = picture(False, False)
    np.testing.assert_array_equal(picture(True, True), sharp)
    assert np.abs(picture(True, False) - sharp).mean() > 0.01
    assert scene.render.use_motion_blur


def test_a_plan_is_of_the_frames_asked_for() -> None:
    """Of the first of them, and of what these frames lend to each other."""
    scene = small("plain")
    shader = bpy.data.objects["Red"].data.materials[0].node_tree.nodes
    alpha = shader["Principled BSDF"].inputs["Alpha"]
    alpha.default_value = 1.0
    alpha.keyframe_insert("default_value", frame=4)
    alpha.default_value = 0.5
    alpha.keyframe_insert("default_value", frame=6)
    other = scene.camera.copy()
    scene.collection.objects.link(other)
    for frame, camera in ((1, scene.camera), (8, other)):
        scene.timeline_markers.new(camera.name, frame=frame).camera = camera
    job = render_request(scale=2, temporal_radius=2)

    def told(*frames: int) -> tuple[bool, dict[str, str]]:
        found = explain(scene, job, frames)
        values = {each["decision"]: each["value"] for each in found["decisions"]}
        values["notes"] = " ".join(found["remarks"])
        return found["facts"]["scene"]["transparent"], values

    opaque, alone = told(2)
    assert not opaque
    assert "accumulation" not in alone
    clear, together = told(6, 7, 8)
    assert clear
    assert together["accumulation"] == "2 frames to each side"
    assert "2 shots: 6–7, 8–8;" in together["notes"]
    assert "shots" not in told(6, 7)[1]["notes"]
