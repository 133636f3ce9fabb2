"""What a render will take, before it begins: sizes and memory.

Pure functions of numbers; neither Blender nor torch is needed here.
"""

from __future__ import annotations

from xrds_core.temporal.window import bytes_needed

# Bytes of tensors per output pixel of a tile, as the network measures itself when it
# runs, with what the allocator loses; the tests compare. Kept here because measuring
# needs torch, which a panel must not load.
NETWORK_BYTES = {
    ("fast", 2): 268,
    ("fast", 4): 238,
    ("fast", 8): 142,
    ("balanced", 2): 356,
    ("balanced", 4): 326,
    ("balanced", 8): 144,
    ("paper", 2): 1438,
    ("paper", 4): 553,
    ("paper", 8): 540,
}
OVERHEAD, TILE_BYTES = 2.0, 100.0
DEFAULT_LIMIT = 4 << 30
# Full-size float32 channels beside the network: picture, albedo, normal, alphas, the
# result and its copy.
PICTURE_CHANNELS = 24


# Channels of Cycles' passes that an animation keeps of each frame sampled ahead.
AHEAD_CHANNELS = 15


def low_size(width: int, height: int, scale: int) -> tuple[int, int]:
    """Width and height of the small render."""
    return -(-width // scale), -(-height // scale)


def memory(
    width: int, height: int, preset: str, scale: int, limit: int | None = None
) -> int:
    """Bytes that XRDS takes at the most beside Cycles; the network's come in tiles."""
    pixels = width * height
    network = pixels * (NETWORK_BYTES[preset, scale] * OVERHEAD + TILE_BYTES)
    pictures = pixels * PICTURE_CHANNELS * 4
    return int(pictures + min(network, limit or DEFAULT_LIMIT))


def shot_memory(width: int, height: int, radius: int, scale: int = 1) -> int:
    """Bytes that an animation's window of frames takes, of an ordinary scene.

    Without the user's own passes; `radius` frames to each side are stored.
    """
    if not radius:
        return 0
    frames = 2 * radius + 1
    low = low_size(width, height, scale)
    images = scale == 1
    window = bytes_needed(*low, frames, alpha=True, vector=True, images=images)
    if scale > 1:
        window += bytes_needed(
            width, height, frames, alpha=True, vector=True, light=False
        )
    return window + radius * width * height * AHEAD_CHANNELS * 4
