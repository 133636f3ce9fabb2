"""Decisions follow from facts alone; no Blender is needed."""

from __future__ import annotations

from dataclasses import replace

from xrds_blender.planning import plan

FACTS = plan.Facts(
    scale=4,
    width=1366,
    height=768,
    max_bounces=12,
    has_denoiser=True,
    exact_camera=True,
)


def values(facts: plan.Facts) -> dict[str, str]:
    return {d.decision: d.value for d in plan.decide(facts).decisions}


def test_decisions_of_an_ordinary_render() -> None:
    assert values(FACTS) == {
        "denoise": "low resolution",
        "guides": "rendered",
        "guide samples": "4",
        "guide bounces": "4, none diffuse",
        "guide lights": "lamps alone",
        "motion blur": "on",
        "network": "without empty parts",
        "low frame": "342x192",
    }


def test_every_decision_has_a_reason() -> None:
    for decision in (
        plan.decide(FACTS).decisions
        + plan.after(0.5, 0.0)
        + plan.cycles_only("as requested").decisions
    ):
        assert decision.reason
        assert "\n" not in decision.reason


def test_without_a_denoiser_nothing_is_denoised() -> None:
    assert values(replace(FACTS, has_denoiser=False))["denoise"] == "skipped"


def test_guides_never_bounce_more_than_the_scene() -> None:
    assert values(replace(FACTS, max_bounces=2))["guide bounces"] == "2, none diffuse"


def test_a_panorama_says_that_it_is_resampled() -> None:
    (low,) = (
        d
        for d in plan.decide(replace(FACTS, exact_camera=False)).decisions
        if d.decision == "low frame"
    )
    assert "resampled" in low.reason


def test_what_one_session_saved_is_the_second_sync() -> None:
    assert plan.after(1.5, 0.5)[0].saving_seconds == 1.0
    assert plan.after(0.5, 0.6)[0].saving_seconds == 0.0


def test_the_plan_of_a_shot() -> None:
    quiet = replace(
        FACTS.scene,
        motion_blur=False,
        volumes=False,
        hair=False,
        smooth=False,
        glass=False,
        depth_of_field=False,
    )

    def lent(**more: object) -> dict[str, str]:
        found = plan.neighbours(
            replace(FACTS, scene=replace(quiet, **more), scale=1), 3
        )
        assert all(each.reason for each in found)
        return {each.decision: each.value for each in found}

    assert lent() == {"accumulation": "3 frames to each side", "images": "skipped"}
    assert lent(smooth=True)["images"] == "followed"
    assert lent(moving=()) == {"accumulation": "3 frames to each side"}
    blurred = replace(quiet, motion_blur=True, volumes=True)
    assert plan.reused_less(blurred) == [plan.MOTION_BLUR, plan.VOLUMES]
    assert plan.reused_less(replace(blurred, moving=())) == []
    assert plan.reused_less(quiet) == []
    mirrors = replace(FACTS, scene=replace(quiet, smooth=True))
    assert plan.neighbours(mirrors, 3)[1].value == "skipped"  # above scale 1
    panorama = plan.neighbours(replace(FACTS, reprojects=False), 3)
    assert [each.value for each in panorama] == ["none"]
