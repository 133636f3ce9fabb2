"""The panel's figures against what the network measures of itself."""

from __future__ import annotations

import pytest

from xrds_blender.planning import estimates


@pytest.mark.parametrize(("preset", "scale"), list(estimates.NETWORK_BYTES))
def test_network_bytes_are_those_of_the_network(preset: str, scale: int) -> None:
    from xrds_core.superres import upscaler
    from xrds_core.superres.cost import measure
    from xrds_core.superres.network import XRDS, preset_config

    cost = measure(XRDS(preset_config(preset, scale)).eval())
    told = estimates.NETWORK_BYTES[preset, scale]
    assert told == pytest.approx(cost.bytes, rel=0.05)
    assert estimates.OVERHEAD == upscaler._CPU_OVERHEAD
    assert estimates.TILE_BYTES == upscaler._TILE_BYTES
    assert estimates.DEFAULT_LIMIT == upscaler.DEFAULT_MEMORY


def test_memory_stays_under_a_limit() -> None:
    free = estimates.memory(1920, 1080, "fast", 2)
    held = estimates.memory(1920, 1080, "fast", 2, limit=1 << 28)
    assert 0 < held - (1 << 28) < free


def test_the_small_render_covers_the_whole_picture() -> None:
    assert estimates.low_size(1366, 768, 8) == (171, 96)


def test_memory_of_a_shot_grows_with_its_window() -> None:
    assert estimates.shot_memory(1920, 1080, 0) == 0
    one, four = (estimates.shot_memory(1920, 1080, r) for r in (1, 4))
    assert 2.5 < four / one < 4.0
    # guides of full size hold no light, and the light is small
    assert estimates.shot_memory(1920, 1080, 4, scale=4) < four
