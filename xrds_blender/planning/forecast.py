"""What a render will take, before it begins: sizes, rays and memory.

Pure functions of numbers; neither Blender nor torch is needed here.
"""

from __future__ import annotations

# Bytes of tensors per output pixel of a tile, as the network measures itself when it
# runs, with what the allocator loses; the tests compare. Kept here because measuring
# needs torch, which a panel must not load.
NETWORK_BYTES = {
    ("fast", 2): 268,
    ("fast", 4): 238,
    ("fast", 8): 162,
    ("balanced", 2): 356,
    ("balanced", 4): 326,
    ("balanced", 8): 185,
    ("paper", 2): 1438,
    ("paper", 4): 553,
    ("paper", 8): 540,
}
OVERHEAD, TILE_BYTES = 2.0, 100.0
DEFAULT_LIMIT = 4 << 30
# Full-size float32 channels beside the network: picture, albedo, normal, alphas, the
# result and its copy.
PICTURE_CHANNELS = 24


def low_size(width: int, height: int, scale: int) -> tuple[int, int]:
    """Width and height of the small render."""
    return -(-width // scale), -(-height // scale)


def rays(samples: int, guide_samples: int, scale: int) -> tuple[float, float]:
    """Camera rays per full-size pixel of the small render and of the guides."""
    return samples / scale**2, float(guide_samples)


def memory(
    width: int, height: int, preset: str, scale: int, limit: int | None = None
) -> int:
    """Bytes that XRDS takes at the most beside Cycles; the network's come in tiles."""
    pixels = width * height
    network = pixels * (NETWORK_BYTES[preset, scale] * OVERHEAD + TILE_BYTES)
    pictures = pixels * PICTURE_CHANNELS * 4
    return int(pictures + min(network, limit or DEFAULT_LIMIT))
