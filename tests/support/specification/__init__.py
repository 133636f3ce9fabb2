"""What the compiled library computes, in NumPy: short and plain, for whole pictures.

The library is compared with it. Everything here is float32 and (H, W) or (H, W, C).
"""

from tests.support.specification.summing import Work

__all__ = ["Work"]
