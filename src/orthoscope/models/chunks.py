"""Many places through many small steps, a block at a time, so that what is between the steps stays in a
core's cache.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from orthoscope.geometry.arrays import Float, ndarray

__all__ = ["blocks", "in_blocks"]

BLOCK = 16384  # places: an array of them has 128 kB, and a dozen fit beside each other in 2 MB
LARGE = 1 << 21  # numbers, 16 MB; glibc looks at no more than 32 MB


def blocks(count: int) -> Iterator[slice]:
    """Slices that cover `count` places."""
    for start in range(0, count, BLOCK):
        yield slice(start, min(start + BLOCK, count))


def in_blocks(
    step: Callable[[ndarray, ndarray], ndarray], places: Float[ndarray, "n 2"], *, width: int
) -> Float[ndarray, "n width"]:
    """What `step` makes of places (n,2): an array (m, width) of the columns x and y (m,) of each block; NaN
    comes and goes silently.
    """
    if len(places) > BLOCK:
        np.empty(
            LARGE
            # made and dropped: glibc from then on keeps what blocks free, instead of giving it back and
            # asking for it again
        )
    results = np.empty((len(places), width))
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        for block in blocks(len(places)):
            x, y = np.ascontiguousarray(places[block].T)
            results[block] = step(x, y)
    return results
