"""Training windows: reading them, and the crops and variations that they are cut into.

A window file (`.npz`) holds one window of a frame: the reference, two guide renders of
different seeds, and two low-resolution renders per scale, denoised and noisy.
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from ..errors import PictureError
from ..front_end import auto_exposure, clean_albedo, clean_radiance, transfer

Array = NDArray[np.float32]


@dataclass(frozen=True)
class Window:
    """One window, half float (height, width, channels), scene-linear."""

    path: Path
    arrays: dict[str, NDArray[np.float16]]
    meta: dict[str, Any]

    def array(self, name: str) -> Array:
        """One array as float32."""
        return self.arrays[name].astype(np.float32)


def read_window(path: Path, scale: int, guides: str) -> Window:
    """Read what training at one scale needs.

    Raises:
        PictureError: the file is damaged or was rendered without that scale.
    """
    names = ["reference", "guides_a", "guides_b"]
    names += [f"low{scale}_{i}{kind}" for i in (0, 1) for kind in ("", "_noisy")]
    if guides == "full":
        names += ["guide_radiance_a", "guide_radiance_b"]
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in names}
            meta = json.loads(str(file["meta"]))
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise PictureError(
            f"{path} is no training window for scale {scale}, {guides} guides: {error}"
        ) from error
    return Window(path, arrays, meta)


@dataclass(frozen=True)
class Variation:
    """How crops are drawn and varied; the defaults leave a window as it is."""

    noisy: float = 0.0
    """Share of crops whose low-resolution radiance is not denoised."""
    exposure_stops: float = 0.0
    """Standard deviation of the exposure around the automatic one, in stops."""
    tint_stops: float = 0.0
    """Standard deviation of a tint of radiance and albedo, in stops per channel."""
    rotated_normals: float = 0.0
    """Share of crops whose normals are turned at random, as if of another space."""
    black: float = 0.0
    """Share of crops without any light under their guides."""
    shaded: float = 0.0
    """Share of crops lit anew: their albedo under smooth light, without path tracing.

    There demodulation is exact, which teaches the network to trust it where radiance
    over albedo is smooth.
    """
    symmetries: bool = False
    """Flips, transposition and permutations of the colour channels."""


@dataclass(frozen=True)
class Batch:
    """What `XRDS.forward` takes and should give, radiance in the transfer domain."""

    radiance: Tensor  # (B, 3, h, w)
    guides: Tensor  # (B, 6 or 9, H, W)
    reference: Tensor  # (B, 3, H, W)

    @staticmethod
    def stack(batches: Sequence[Batch]) -> Batch:
        """Concatenate along B."""
        return Batch(
            torch.cat([b.radiance for b in batches]),
            torch.cat([b.guides for b in batches]),
            torch.cat([b.reference for b in batches]),
        )


def draw(
    window: Window,
    scale: int,
    guides: str,
    variation: Variation,
    random: np.random.Generator,
    size: int | None = None,
) -> Batch:
    """Cut one varied crop of `size` output pixels (None: the whole window)."""
    noisy = "_noisy" if random.random() < variation.noisy else ""
    low, _ = clean_radiance(window.array(f"low{scale}_{random.integers(2)}{noisy}"))
    exposure = auto_exposure(low) * 2 ** random.normal(0, variation.exposure_stops)
    both = window.array("guides_a")[..., :3] + window.array("guides_b")[..., :3]
    high = {
        "reference": window.array("reference"),
        "guides": mix_guides(window, random),
        "albedo": clean_albedo(both / 2)[0],
    }
    if guides == "full":
        which = "ab"[random.integers(2)]
        high["radiance"], _ = clean_radiance(window.array(f"guide_radiance_{which}"))
    if size is not None:
        low, high = crop(low, high, scale, size, random)
    if random.random() < variation.shaded:
        low, high["reference"] = shade(high["albedo"], scale, exposure, random)
        if "radiance" in high:
            high["radiance"] = high["reference"]
    del high["albedo"]
    if random.random() < variation.black:
        low, high["reference"] = low * 0, high["reference"] * 0
        if "radiance" in high:
            high["radiance"] = high["radiance"] * 0
    if variation.symmetries:
        low, high = permute_colours(low, high, random)
        low, high = transpose_and_flip(low, high, random)
    if variation.tint_stops:
        low, high = tint(low, high, variation.tint_stops, random)
    if random.random() < variation.rotated_normals:
        high["guides"][..., 3:6] = high["guides"][..., 3:6] @ random_rotation(random)
    return to_batch(low, high, exposure)


def mix_guides(window: Window, random: np.random.Generator) -> Array:
    """One of the two guide renders, or their mean by samples: (H, W, 6)."""
    a, b = window.meta["guide_spp"]
    share = ((a / (a + b)), 1.0, 0.0)[random.integers(3)]
    mixed: Array = window.array("guides_a") * np.float32(share)
    mixed += window.array("guides_b") * np.float32(1 - share)
    mixed[..., :3] = clean_albedo(mixed[..., :3])[0]
    return mixed


Pictures = dict[str, Array]


def shade(
    albedo: Array, scale: int, exposure: float, random: np.random.Generator
) -> tuple[Array, Array]:
    """Radiance of `albedo` under a smooth, coloured light: low-resolution and full."""
    stops = random.normal(0, 1, (1, 1, 4, 4)) + random.normal(0, 0.2, (1, 3, 1, 1))
    light = torch.nn.functional.interpolate(
        torch.from_numpy(np.exp2(stops)), size=albedo.shape[:2], mode="bicubic"
    )
    smooth = light[0].permute(1, 2, 0).clamp(min=0.05).numpy() / (4 * exposure)
    reference = (albedo * smooth).astype(np.float32)
    h, w = (n // scale for n in albedo.shape[:2])
    low = reference.reshape(h, scale, w, scale, 3).mean(axis=(1, 3))
    return low, reference


def crop(
    low: Array, high: Pictures, scale: int, size: int, random: np.random.Generator
) -> tuple[Array, Pictures]:
    """The same random square from every picture, on whole low-resolution pixels."""
    side = size // scale
    y, x = (int(random.integers(n - side + 1)) for n in low.shape[:2])
    box = np.s_[y * scale : (y + side) * scale, x * scale : (x + side) * scale]
    return low[y : y + side, x : x + side], {k: v[box] for k, v in high.items()}


def permute_colours(
    low: Array, high: Pictures, random: np.random.Generator
) -> tuple[Array, Pictures]:
    """The same permutation of the channels of radiance and albedo."""
    order = random.permutation(3)
    high = {k: v if k == "guides" else v[..., order] for k, v in high.items()}
    albedo, normal = np.split(high["guides"], 2, axis=-1)
    high["guides"] = np.concatenate((albedo[..., order], normal), axis=-1)
    return low[..., order], high


def transpose_and_flip(
    low: Array, high: Pictures, random: np.random.Generator
) -> tuple[Array, Pictures]:
    """One of the eight symmetries of the square; normals turn with the picture.

    Normals are in camera space, x to the right and y up, rows run downwards: so a
    transposed picture has x' = -y, y' = -x.
    """
    transposed, flip_y, flip_x = random.integers(2, size=3)
    normals = np.eye(3, dtype=np.float32)
    if transposed:
        low = low.swapaxes(0, 1)
        high = {k: v.swapaxes(0, 1) for k, v in high.items()}
        normals = np.array([[0, -1, 0], [-1, 0, 0], [0, 0, 1]], np.float32)
    if flip_y:
        low, high = low[::-1], {k: v[::-1] for k, v in high.items()}
        normals = normals * np.array([1, -1, 1], np.float32)
    if flip_x:
        low, high = low[:, ::-1], {k: v[:, ::-1] for k, v in high.items()}
        normals = normals * np.array([-1, 1, 1], np.float32)
    albedo, normal = np.split(high["guides"], 2, axis=-1)
    high["guides"] = np.concatenate((albedo, normal @ normals), axis=-1)
    return low, high


def tint(
    low: Array, high: Pictures, stops: float, random: np.random.Generator
) -> tuple[Array, Pictures]:
    """Colour surfaces: a factor per channel, at most 1, on radiance and albedo.

    Of one bounce of light; longer paths would be tinted more than once.
    """
    factor = np.exp2(random.normal(0, stops, 3)).astype(np.float32)
    factor /= factor.max()
    high = {k: v if k == "guides" else v * factor for k, v in high.items()}
    albedo, normal = np.split(high["guides"], 2, axis=-1)
    high["guides"] = np.concatenate((albedo * factor, normal), axis=-1)
    return low * factor, high


def random_rotation(random: np.random.Generator) -> Array:
    """A rotation drawn uniformly: (3, 3)."""
    q, r = np.linalg.qr(random.normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    q[:, 0] *= np.linalg.det(q)
    return q.astype(np.float32)


def to_batch(low: Array, high: Pictures, exposure: float) -> Batch:
    """Pictures to a batch of one, radiance in the transfer domain."""
    guides = [high["guides"]]
    if "radiance" in high:
        guides.append(transfer(high["radiance"], exposure))
    reference, _ = clean_radiance(high["reference"])
    return Batch(
        to_tensor(transfer(low, exposure)),
        to_tensor(np.concatenate(guides, axis=-1)),
        to_tensor(transfer(reference, exposure)),
    )


def to_tensor(picture: Array) -> Tensor:
    """(H, W, C) to (1, C, H, W)."""
    channels_first = np.ascontiguousarray(picture.transpose(2, 0, 1), np.float32)
    return torch.from_numpy(channels_first)[None]
