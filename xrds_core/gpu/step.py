"""The uniform of all kernels: `Step` of kernels/common.wgsl."""

from __future__ import annotations

from typing import Any

import numpy as np

STEP = np.dtype(
    [
        ("size", np.uint32, 2),
        ("band", np.uint32, 2),
        ("there_size", np.uint32, 2),
        ("coarse", np.uint32, 2),
        ("flags", np.uint32),
        ("channels", np.uint32),
        ("stride", np.uint32),
        ("spots", np.uint32),
        ("forth", np.float32, (4, 4)),
        ("back", np.float32, (4, 4)),
        ("turn", np.float32, (3, 4)),
        ("samples", np.float32),
        ("there_samples", np.float32),
        ("fall", np.float32),
        ("whole", np.float32),
        ("apart", np.float32),
        ("number", np.uint32),
        ("coarse_most", np.float32),
        ("usual", np.float32),
        ("guides", np.float32),
        ("changes", np.float32),
        ("area", np.int32),
        ("offset", np.uint32),
    ]
)
# In the order of their bits.
_FLAGS = (
    "aligned",
    "here_half",
    "there_half",
    "here_counts",
    "there_counts",
    "jitter",
    "moving",
    "beside",
    "images",
    "turned",
    "orthographic",
    "first_group",
    "dark",
)


def flagged(step: Any, **flags: bool) -> Any:
    """Return a copy of a step with further flags, those that are true."""
    found = step.copy()
    more = sum(1 << _FLAGS.index(name) for name, is_set in flags.items() if is_set)
    found["flags"] = int(step["flags"]) | more
    return found
