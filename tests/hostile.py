"""Files that would run code, if whoever reads them let them."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any


class Trigger:
    """Makes a folder when it is unpickled: a sign that code of a file has run."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self) -> Any:
        return os.mkdir, (str(self.mark),)
