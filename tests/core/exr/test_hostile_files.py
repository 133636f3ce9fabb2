"""Damaged and hostile files: a clear error, little memory, no crash.

Every reader is run on many damaged copies of a good file in one child process that may
take no more than so much memory and time: a crash would end it without its report.
"""

from __future__ import annotations

import json
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest
import torch

from xrds_core import exr
from xrds_core.superres.network import XRDS, NetworkConfig
from xrds_lab.weights import save_network

if sys.platform == "win32":
    pytest.skip("limits of memory are POSIX'", allow_module_level=True)

MEMORY = 2 << 30  # bytes of address space beyond what the imports took
SECONDS = 30  # of the processor; other work on the machine does not count
COUNT = 150

# The readers, and the errors that they may raise; anything else is a fault.
READERS = {
    "exr": ("from xrds_core.exr import read_beauty as read", "PictureError"),
    "safetensors": (
        "from xrds_core.superres.weights import load as read",
        "WeightsError",
    ),
    "toml": ("from xrds_lab.training.config import read_config as read", "UsageError"),
    "npz": (
        "from xrds_lab.training.windows import read_window\n"
        "read = lambda path: read_window(path, 2)",
        "PictureError",
    ),
}

CHILD = """
import json, resource, sys
from pathlib import Path
from xrds_core.errors import *
{imports}

read(Path(sys.argv[1]))  # what the first use loads is not the damaged file's
pages = int(Path("/proc/self/statm").read_text().split()[0])
limit = pages * resource.getpagesize() + {memory}
resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
spent = int(sum(resource.getrusage(resource.RUSAGE_SELF)[:2]))
resource.setrlimit(resource.RLIMIT_CPU, (spent + {seconds},) * 2)
told = {{"read": 0, "refused": 0, "faults": []}}
for path in sorted(Path(sys.argv[2]).iterdir()):
    try:
        read(path)
        told["read"] += 1
    except {error} as error:
        told["refused"] += 1
        if path.stem not in str(error) or len(str(error)) > 2000:
            told["faults"].append([path.name, "unclear: " + str(error)[:200]])
    except BaseException as error:
        told["faults"].append([path.name, repr(error)[:200]])
print("REPORT" + json.dumps(told))
"""


def good_exr(path: Path) -> None:
    random = np.random.default_rng(0)
    planes = {
        f"View.{name}.{c}": random.random((12, 9), np.float32)
        for name in ("Combined", "Denoising Albedo")
        for c in "RGB"
    }
    exr.write_picture(path, planes)


def good_safetensors(path: Path) -> None:
    torch.manual_seed(0)
    config = NetworkConfig(
        scale=2, groups=1, blocks=1, channels=4, guide_channels=4, window_size=2
    )
    save_network(XRDS(config), path, {"preset": "fast"})


def good_toml(path: Path) -> None:
    path.write_text(
        textwrap.dedent("""
        data = "windows"
        preset = "fast"
        scale = 4
        steps = 200
        betas = [0.9, 0.99]
        [loss]
        charbonnier = 1.0
        [variation]
        noisy = 0.5
        symmetries = true
        """)
    )


def good_npz(path: Path) -> None:
    full, low = (np.ones((size, size, 3), np.float16) for size in (16, 8))
    arrays = {"reference": full, "meta": np.array(json.dumps({"guide_spp": [1, 1]}))}
    arrays |= {f"guides_{k}": np.dstack((full, full)) for k in "ab"}
    arrays |= {f"low2_{i}{k}": low for i in (0, 1) for k in ("", "_noisy")}
    np.savez_compressed(path, **arrays)


def damaged(whole: bytes, random: np.random.Generator) -> bytes:
    """One of: cut, bits flipped, bytes overwritten, a claim of size, padded, empty."""
    data = bytearray(whole)
    kind = random.integers(6)
    place = int(random.integers(len(data)))
    head = int(random.integers(min(len(data), 400)))
    if kind == 0:
        return bytes(data[:place])
    if kind == 1:
        for at in random.integers(0, len(data), random.integers(1, 9)):
            data[at] ^= 1 << int(random.integers(8))
    elif kind == 2:
        data[head : head + 8] = random.bytes(8)
    elif kind == 3:
        claim = int(random.choice([2**31 - 1, 2**32 - 1, 2**40, 2**62, 10**9]))
        data[head : head + 8] = claim.to_bytes(8, "little")
    elif kind == 4:
        data[place:place] = random.bytes(int(random.integers(1, 500)))
    else:
        data[head] ^= 1 << int(random.integers(8))
    return bytes(data)


@pytest.mark.parametrize("kind", READERS)
def test_damaged_files_are_refused_in_bounds(kind: str, tmp_path: Path) -> None:
    good = tmp_path / f"good.{kind}"
    globals()[f"good_{kind}"](good)
    folder = tmp_path / "damaged"
    folder.mkdir()
    (folder / f"empty.{kind}").write_bytes(b"")
    random = np.random.default_rng(len(kind))
    for number in range(COUNT):
        copy = folder / f"copy{number:03}.{kind}"
        copy.write_bytes(damaged(good.read_bytes(), random))
    imports, error = READERS[kind]
    code = CHILD.format(imports=imports, error=error, memory=MEMORY, seconds=SECONDS)
    done = subprocess.run(
        [sys.executable, "-c", code, good, folder],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, (done.returncode, done.stderr[-2000:])
    report = done.stdout.rpartition("REPORT")[2]
    told = json.loads(report)
    assert not told["faults"]
    assert told["read"] + told["refused"] == COUNT + 1
    assert told["refused"] > COUNT // 10
