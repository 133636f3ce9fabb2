"""How far a value walks through the source."""

from __future__ import annotations

from xrds_lab.pages.walks import WALKS, walk


def test_a_frame_walks_to_where_it_is_finished_and_nowhere_else() -> None:
    found = walk(*WALKS["a frame's passes to the picture"])
    assert "xrds_core.finish" in found.stays
    assert "xrds_blender.rendering.super_resolution" in found.stays  # as a method
    # its `finish` is another class's
    assert "xrds_core.shot_files.sequence" not in found.stays


def test_returns_are_counted() -> None:
    found = walk(*WALKS["a command's options"])
    assert found.rooms + found.returns == len(found.stays)
