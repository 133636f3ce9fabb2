"""A picture of 8192 x 8192 in a process of its own: memory beyond the arrays."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from xrds_core.children import run_python
from xrds_core.errors import XRDSError

from .measured import Measured

if TYPE_CHECKING:
    from collections.abc import Iterator

    from .subject import Subject

SIDE = 8192
LIMIT = 2 << 30

_PROGRAM = """
import json, sys
import numpy as np
from xrds_core.superres.upscaler import Upscaler

preset, scale, precision, side, limit = sys.argv[1], *sys.argv[2:6]
scale, side, limit = int(scale), int(side), int(limit)

def status(key):
    lines = open("/proc/self/status").read().splitlines()
    return 1024 * int(next(x for x in lines if x.startswith(key)).split()[1])

made = Upscaler(preset, scale, precision=precision, device="cpu")
random = np.random.default_rng(0)
low = random.random((side // scale, side // scale, 3), np.float32)
albedo = random.random((side, side, 3), np.float32)
normal = random.random((side, side, 3), np.float32)
low[side // scale // 2 :], albedo[side // 2 :], normal[side // 2 :] = 0.5, 0.5, 0.0
made(low[:8, :8], albedo[: 8 * scale, : 8 * scale], normal[: 8 * scale, : 8 * scale])
open("/proc/self/clear_refs", "w").write("5")
before = status("VmRSS")
result = made(low, albedo, normal, memory_limit=limit)
peak = status("VmHWM") - before - result.radiance.nbytes
bad = sum(
    int((~np.isfinite(rows) | (rows < 0)).sum()) for rows in np.array_split(
        result.radiance, 64)
)
print("REPORT" + json.dumps({"peak": peak, "bad": bad, "tiles": result.tiles}))
"""


def large(subject: Subject) -> Iterator[Measured]:
    """Bytes beside the arrays given and returned, with a limit of 2 GiB.

    The lower half is background, which the network does not see: both ways count.
    Only in fp32: tiles are planned for it, whatever the layers then take.
    """
    if subject.precision != "fp32":
        return
    words = [subject.preset, subject.scale, subject.precision, SIDE, LIMIT]
    done = run_python("-c", _PROGRAM, *map(str, words))
    if done.returncode:
        raise XRDSError(
            f"{subject.name} ended with {done.returncode} on {SIDE}x{SIDE} pixels: "
            f"{done.stderr.strip().rpartition(chr(10))[2]}"
        )
    result = json.loads(done.stdout.rpartition("REPORT")[2])
    yield Measured("shapes.memory", result["peak"] / 2**30)
    yield Measured("shapes.large_faults", result["bad"])
