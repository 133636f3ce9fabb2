"""Too little memory: smaller tiles, then one clear line; never a bare allocator's."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from xrds_core.errors import OutOfMemory
from xrds_core.superres import upscaler
from xrds_core.superres.devices import free_memory, is_out_of_memory
from xrds_core.superres.network import XRDS, preset_config
from xrds_core.superres.upscaler import Upscaler

LOW = (210, 8)  # two tiles of the smallest size
CPU = "[enforce fail at alloc_cpu.cpp:127] DefaultCPUAllocator: can't allocate memory"
ERRORS = (
    RuntimeError(CPU),
    RuntimeError("DefaultCPUAllocator: not enough memory: you tried to allocate 9"),
    RuntimeError("could not create a primitive"),
    RuntimeError("MPS backend out of memory (MPS allocated: 9 GB)"),
    torch.OutOfMemoryError("CUDA out of memory. Tried to allocate 9 GiB"),
    MemoryError(),
)


@pytest.fixture
def fast() -> Iterator[Upscaler]:
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    torch.manual_seed(3)
    made = Upscaler(device="cpu", weights=XRDS(preset_config("fast", 2)))
    assert made.cost  # measured by a run of its own
    yield made
    torch.set_num_threads(threads)


def picture(low: tuple[int, int] = LOW) -> list[np.ndarray]:
    random = np.random.default_rng(0)
    full = (2 * low[0], 2 * low[1], 3)
    return [random.random(size, np.float32) for size in ((*low, 3), full, full)]


def room_for(pixels: int, error: Exception) -> Callable[..., None]:
    """A device on which tiles of more low-resolution pixels do not fit."""

    def hook(module: Any, inputs: tuple[torch.Tensor, ...]) -> None:
        if inputs[0][0, 0].numel() > pixels:
            raise error

    return hook


@pytest.mark.parametrize("error", ERRORS, ids=lambda e: f"{type(e).__name__}-{e}"[:40])
def test_every_device_says_it_in_its_own_way(error: Exception) -> None:
    assert is_out_of_memory(error)
    assert not is_out_of_memory(ValueError("out of memory"))


def test_smaller_tiles_are_tried(fast: Upscaler) -> None:
    whole = fast(*picture())
    told: list[float] = []
    fast.network.register_forward_pre_hook(room_for(1600, ERRORS[0]))
    tiled = fast(*picture(), progress=told.append)
    assert (whole.tiles, tiled.tiles) == (1, 2)
    np.testing.assert_allclose(tiled.radiance, whole.radiance, atol=1e-3)
    assert told == sorted(told)
    assert told[-1] == 1.0


def test_no_room_at_all_is_one_clear_line(fast: Upscaler) -> None:
    hook = fast.network.register_forward_pre_hook(room_for(0, RuntimeError(CPU)))
    with pytest.raises(OutOfMemory, match=r"cpu has too little memory for a tile of "):
        fast(*picture())
    hook.remove()
    assert fast(*picture((8, 8))).radiance.any(), "unusable afterwards"


def test_other_errors_are_not_taken_for_it(fast: Upscaler) -> None:
    calls = []

    def broken(*_: Any) -> None:
        calls.append(1)
        raise RuntimeError("CUDA error: device-side assert triggered")

    fast.network.register_forward_pre_hook(broken)
    with pytest.raises(RuntimeError, match="device-side assert"):
        fast(*picture())
    assert len(calls) == 1


REAL = """
import resource
import numpy as np
import torch
from xrds_core.errors import OutOfMemory
from xrds_core.superres.network import XRDS, preset_config
from xrds_core.superres.upscaler import Upscaler

torch.set_num_threads(1)
made = Upscaler(device="cpu", weights=XRDS(preset_config("fast", 2)))
random = np.random.default_rng(0).random
low, high = random((210, 16, 3), np.float32), random((420, 32, 3), np.float32)
made(low[:8, :8], high[:16, :16], high[:16, :16])  # what is loaded once
taken = next(x for x in open("/proc/self/status") if x.startswith("VmSize"))
for spare in (1 << 20, 8 << 20):
    limit = 1024 * int(taken.split()[1]) + spare
    resource.setrlimit(resource.RLIMIT_AS, (limit, resource.RLIM_INFINITY))
    try:
        print("tiles", made(low, high, high).tiles)
    except OutOfMemory:
        print("OutOfMemory")
"""


@pytest.mark.nightly
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc, limits memory")
def test_what_torch_really_raises_is_understood() -> None:
    done = subprocess.run(
        [sys.executable, "-c", REAL], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert set(done.stdout.splitlines()) <= {"OutOfMemory", "tiles 2", "tiles 1"}
    assert done.stdout.startswith("OutOfMemory")


def test_without_a_limit_no_more_is_taken_than_there_is(
    fast: Upscaler, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert fast(*picture()).tiles == 1
    monkeypatch.setattr(upscaler, "free_memory", lambda device: 1e6)
    assert fast(*picture()).tiles == 2


@pytest.mark.skipif(sys.platform != "linux", reason="asks /proc")
def test_free_memory_is_that_of_the_machine() -> None:
    total = int(Path("/proc/meminfo").read_text().split()[1]) * 1024
    assert 0 < free_memory(torch.device("cpu")) < total
