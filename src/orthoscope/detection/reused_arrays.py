"""Memory that is used again: the system hands out the pages of a large new array one by one, cleared, which
may take longer than what is then done with them.
"""

from __future__ import annotations

import threading
from math import prod
from typing import Any

import numpy as np

from orthoscope.geometry.arrays import ndarray

__all__ = ["ReusedArrays"]

# Larger arrays, bytes, are new ones each time, so that little is kept.
MOST_BYTES = 2**23


class ReusedArrays(threading.local):
    """Arrays by name, each thread's its own; the next one of a name takes the place of the last."""

    def __init__(self) -> None:
        self._kept: dict[tuple[str, Any], ndarray] = {}

    def of(self, name: str, shape: tuple[int, ...], dtype: Any = np.float32) -> ndarray:
        """An array of this shape, with whatever values were there.

        Args:
            name: what it is for; nothing else may use it as long as it is needed.
            shape: of the array.
            dtype: likewise.
        """
        size = prod(shape)
        if size * np.dtype(dtype).itemsize > MOST_BYTES:
            return np.empty(shape, dtype)
        kept = self._kept.get((name, dtype))
        if kept is None or len(kept) < size:
            kept = self._kept[name, dtype] = np.empty(size, dtype)
        return kept[:size].reshape(shape)
