"""What the plan's report makes of its records; measuring them takes Blender."""

from __future__ import annotations

from typing import Any

from xrds_lab.bench.plan_report import text

SETTING = {"width": 96, "height": 54, "scale": 2, "samples": 16, "guide_samples": 4}


def record(scene: str, guides: float, lights: str, **changed: float) -> dict[str, Any]:
    """One second of network and one of guides, of which `guides` are left."""
    record: dict[str, Any] = {"scene": scene, "kind": "still", "saved_share": 0.0}
    for name in ("wall", "overhead", "sync", "beauty", "network"):
        record |= {f"{name}_all": 2.0, f"{name}_plan": 2.0}
    record |= {"guides_all": 1.0, "guides_plan": guides}
    record |= {"plan_psnr": 60.0, "seed_psnr": 50.0, "plan_flip": 0.0, "seed_flip": 0.1}
    decisions = {"guide samples": "4", "guide bounces": "0", "guide lights": lights}
    plan = [{"decision": name, "value": value} for name, value in decisions.items()]
    return record | {"plan": plan, "setting": SETTING | {"rounds": 1}} | changed


def test_savings_are_told_by_what_was_decided() -> None:
    page = text(
        [
            record("wall", 0.5, "none sampled"),
            record("floor", 0.7, "none sampled"),
            record("glass", 1.0, "lamps alone"),
        ]
    )
    assert "| 4 | 0 | none sampled |  | wall, floor | 40% | 20% |" in page
    assert "| 4 | 0 | lamps alone |  | glass | 0% | 0% |" in page


def test_a_difference_above_the_noise_is_counted() -> None:
    lost = record("fog", 0.5, "none sampled", plan_psnr=49.0)
    assert "Below the noise: 1 of 2" in text([record("wall", 0.5, "none"), lost])
