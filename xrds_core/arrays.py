"""The array type of pictures and guides.

Every array is float32 (height, width, channels) or (height, width), row 0 at the top,
and scene-linear where it holds colour, unless a docstring says otherwise.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float32]
