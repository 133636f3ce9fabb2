"""What the panel reads of weights files, without torch."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from xrds_core.superres.network import XRDS, preset_config
from xrds_core.superres.weights_header import available, headers, read_header
from xrds_lab.weights import save_network


def test_headers_tell_what_loading_tells() -> None:
    told = {(h.preset, h.scale, h.blender_series) for h in headers()}
    keys = ("preset", "scale", "blender_series")
    assert told == {tuple(r[key] for key in keys) for r in available()}


def test_no_torch_is_loaded() -> None:
    code = (
        "import sys, xrds_core.superres.weights_header as w; "
        "w.headers(); print(*sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert not {"torch", "safetensors", "numpy"} & set(done.stdout.split())


@pytest.mark.parametrize(
    "content",
    [b"", b"\x08", b"\xff" * 64, b"\x02\0\0\0\0\0\0\0{}", b"\x02\0\0\0\0\0\0\0[]"],
)
def test_other_files_are_left_out(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "fast_x2.safetensors"
    path.write_bytes(content)
    assert headers(tmp_path) == []
    assert read_header(tmp_path / "nowhere_x2.safetensors") is None


def test_networks_for_other_guides_are_left_out(tmp_path: Path) -> None:
    for guides in ("fast", "full"):
        config = json.dumps({"scale": 2, "guides": guides})
        header = json.dumps({"__metadata__": {"config": config}}).encode()
        path = tmp_path / f"{guides}_x2.safetensors"
        path.write_bytes(len(header).to_bytes(8, "little") + header)
    assert [h.preset for h in headers(tmp_path)] == ["fast"]


def test_a_file_that_changes_is_read_again(tmp_path: Path) -> None:
    path = tmp_path / "fast_x2.safetensors"
    path.write_bytes(b"")
    assert headers(tmp_path) == []
    save_network(XRDS(preset_config("fast", 2)), path, {"blender_series": "5.2"})
    assert [h.blender_series for h in headers(tmp_path)] == ["5.2"]
