"""The files of sequences, told from their names."""

from __future__ import annotations

from pathlib import Path

import pytest

from xrds_core.frames import find_sequences, frame_numbers


@pytest.mark.parametrize(
    ("names", "found"),
    [
        (["a_0002.exr", "a_0001.exr"], {"a_####.exr": [1, 2]}),
        (["9.exr", "10.exr"], {"#.exr": [9, 10]}),
        (["0999.exr", "1000.exr", "10000.exr"], {"####.exr": [999, 1000, 10000]}),
        (["s2_v3_01_noisy.exr"], {"s2_v3_##_noisy.exr": [1]}),
        (["a1.exr", "b1.exr"], {"a#.exr": [1], "b#.exr": [1]}),
        (["still.exr"], {"still.exr": []}),
        ([], {}),
    ],
)
def test_patterns_of_names(names: list[str], found: dict[str, list[int]]) -> None:
    assert find_sequences(names) == found


def test_a_pattern_finds_the_files_that_it_is_of(tmp_path: Path) -> None:
    for name in ("a_08.exr", "a_09.exr", "a_10.exr", "a_100.exr"):
        (tmp_path / name).touch()
    ((pattern, numbers),) = find_sequences(x.name for x in tmp_path.iterdir()).items()
    assert frame_numbers(str(tmp_path / pattern)) == numbers == [8, 9, 10, 100]
