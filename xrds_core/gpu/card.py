"""A graphics card: finding it, its memory, running kernels on it.

By the package `wgpu`, which reaches cards of all vendors through Vulkan, Metal or
Direct3D 12. Source: https://wgpu-py.readthedocs.io.
"""

from __future__ import annotations

import os
from contextlib import contextmanager, suppress
from functools import cache
from importlib import import_module, resources
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import XRDSError
from ..notices import warn

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from ..arrays import Array

# Storage buffers that the largest kernel has; what WebGPU promises everywhere is 8.
_BUFFERS = 15
_GROUP = 8  # pixels across that one group of a kernel covers
_OF_ONE_PICTURE = ("own", "weigh", "means")  # modules that read the frame's alone
_EXTRAS = "wgpu.backends.wgpu_native.extras"
# Without OpenGL, which could meet Blender's own.
_INTERFACES = ("Vulkan", "Metal", "DX12")
_KINDS = ("DiscreteGPU", "IntegratedGPU")  # the faster kind first
_LIMITS = ("max-buffer-size", "max-storage-buffer-binding-size")


class CardLost(XRDSError):
    """The card failed: removed, reset by its driver, or out of memory."""


def find_adapters(software: bool = False) -> list[Any]:
    """Return the cards that can accumulate, the fastest kind first; [] without wgpu.

    A wgpu that is there but cannot be loaded is told of. `software` returns those that
    the processor plays instead, for tests.
    """
    try:
        wgpu, extras = (import_module(name) for name in ("wgpu", _EXTRAS))
        with suppress(RuntimeError):  # someone else in this process uses wgpu already
            extras.set_instance_extras(backends=_INTERFACES)
        with _without_windows():
            every = wgpu.gpu.enumerate_adapters_sync()
    except (ImportError, OSError, RuntimeError):
        return []
    except Exception as error:  # cffi raises no other kind beside another cffi
        warn(f"no graphics card is used, for wgpu cannot be loaded: {error}")
        return []
    kinds = ("CPU",) if software else _KINDS
    found = [
        each
        for each in every
        if each.info["adapter_type"] in kinds
        and each.info["backend_type"] != "OpenGL"  # where someone else asked for it
        and each.limits["max-storage-buffers-per-shader-stage"] >= _BUFFERS
    ]
    return sorted(found, key=lambda x: kinds.index(x.info["adapter_type"]))


@contextmanager
def _without_windows() -> Iterator[None]:
    """Keep drivers from complaining that there is no window system."""
    name = "XDG_RUNTIME_DIR"
    if name in os.environ:
        yield
        return
    os.environ[name] = os.devnull
    try:
        yield
    finally:
        del os.environ[name]


def card_names() -> list[str]:
    """Return the names of the cards that can accumulate, the default first."""
    return list(dict.fromkeys(x.info["device"] for x in find_adapters()))


class Card:
    """An opened card; buffers on it are freed with the objects that hold them."""

    def __init__(self, adapter: Any) -> None:
        limits = {name: adapter.limits[name] for name in _LIMITS}
        limits["max-storage-buffers-per-shader-stage"] = _BUFFERS
        self._wgpu = import_module("wgpu")
        self.name: str = adapter.info["device"]
        self.largest_buffer = min(limits[name] for name in _LIMITS)
        with explained(self.name):
            self._device = adapter.request_device_sync(required_limits=limits)
        self._pipelines: dict[tuple[str, str], Any] = {}
        usage = self._wgpu.BufferUsage
        self._usage = usage.STORAGE | usage.COPY_SRC | usage.COPY_DST
        self._uniform = usage.UNIFORM
        self._nothing = self.empty(4)

    def upload(self, values: NDArray[Any], uniform: bool = False) -> Any:
        """Return a buffer with a copy of an array, padded to 16 bytes."""
        data = np.ascontiguousarray(values).reshape(-1).view(np.uint8)
        self._check_size(data.size)
        if data.size % 16 or not data.size:
            data = np.concatenate([data, np.zeros(16 - data.size % 16, np.uint8)])
        usage = self._uniform if uniform else self._usage
        with explained(self.name):
            return self._device.create_buffer_with_data(data=data, usage=usage)

    def empty(self, floats: int) -> Any:
        """Return a buffer of so many float32, all 0."""
        self._check_size(4 * floats)
        with explained(self.name):
            size = 4 * max(floats, 4)
            return self._device.create_buffer(size=size, usage=self._usage)

    def _check_size(self, size: int) -> None:
        if size > self.largest_buffer:
            raise CardLost(
                f"graphics card {self.name} failed (it takes no buffers of "
                f"{size / 1e6:.0f} MB)"
            )

    def download(self, buffer: Any) -> Array:
        """Return a buffer's float32; waits for all that was started."""
        with explained(self.name):
            return np.frombuffer(self._device.queue.read_buffer(buffer), np.float32)

    def start(self, calls: Sequence[Call]) -> None:
        """Start kernels, one after another; does not wait for them."""
        with explained(self.name):
            encoder = self._device.create_command_encoder()
            for call in calls:
                pipeline = self._pipeline(call.module, call.entry)
                buffers = {0: call.step, **call.buffers}
                group = self._device.create_bind_group(
                    layout=pipeline.get_bind_group_layout(0),
                    entries=[
                        {"binding": number, "resource": {"buffer": self._or_nothing(x)}}
                        for number, x in buffers.items()
                    ],
                )
                run = encoder.begin_compute_pass()
                run.set_pipeline(pipeline)
                run.set_bind_group(0, group)
                columns, rows = (-(-side // _GROUP) for side in call.size)
                run.dispatch_workgroups(columns, rows)
                run.end()
            self._device.queue.submit([encoder.finish()])

    def _or_nothing(self, buffer: Any | None) -> Any:
        """What stands for a buffer that a kernel does not read this time."""
        return self._nothing if buffer is None else buffer

    def _pipeline(self, module: str, entry: str) -> Any:
        if (module, entry) not in self._pipelines:
            code = self._device.create_shader_module(code=_source(module))
            self._pipelines[module, entry] = self._device.create_compute_pipeline(
                layout="auto", compute={"module": code, "entry_point": entry}
            )
        return self._pipelines[module, entry]


class Call:
    """One run of a kernel: `entry` of `module`.wgsl, over `size` (columns, rows).

    `step` is the uniform buffer, `buffers` the others by their bindings; None stands
    for one that is not read.
    """

    def __init__(
        self,
        module: str,
        entry: str,
        size: tuple[int, int],
        step: Any,
        buffers: Mapping[int, Any | None],
    ) -> None:
        self.module, self.entry, self.size = module, entry, size
        self.step, self.buffers = step, buffers


@cache
def _source(module: str) -> str:
    folder = resources.files(__package__) / "kernels"
    shared = ("common", "picture") if module in _OF_ONE_PICTURE else ("common",)
    parts = (folder / f"{name}.wgsl" for name in (*shared, module))
    return "\n".join(part.read_text("utf-8") for part in parts)


@contextmanager
def explained(name: str) -> Iterator[None]:
    """Turn what wgpu raises into CardLost, one clear line."""
    wgpu = import_module("wgpu")
    try:
        yield
    except (wgpu.GPUError, RuntimeError, MemoryError) as error:
        if isinstance(error, wgpu.GPUValidationError) and "lost" not in str(error):
            raise  # a mistake of ours
        reason = str(error).strip().partition("\n")[0] or type(error).__name__
        raise CardLost(f"graphics card {name} failed ({reason})") from error
