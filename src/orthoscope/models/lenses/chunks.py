"""Many places through many small steps, a chunk at a time.

What is between the steps then stays in a core's cache.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from orthoscope.geometry.arrays import Float, ndarray

__all__ = ["chunks", "in_chunks"]

# A chunk has this many places: an array of them has 128 kB, and a dozen fit beside each other in 2 MB.
PLACES_AT_ONCE = 16384
# An array of this many numbers has 16 MB; glibc looks at no more than 32 MB.
LARGE_ARRAY_SIZE = 1 << 21


def chunks(count: int) -> Iterator[slice]:
    """Slices that cover `count` places."""
    for start in range(0, count, PLACES_AT_ONCE):
        yield slice(start, min(start + PLACES_AT_ONCE, count))


def in_chunks(
    step: Callable[[ndarray, ndarray], ndarray], places: Float[ndarray, "n 2"], *, width: int
) -> Float[ndarray, "n width"]:
    """What a step makes of places, a chunk of them at a time; NaN comes and goes silently.

    Args:
        step: takes the columns x and y (m,) of a chunk to an array (m, width).
        places: (n,2).
        width: how many numbers the step makes of each place.
    """
    if len(places) > PLACES_AT_ONCE:
        # Made and dropped: glibc from then on keeps what chunks free, instead of giving it back and asking
        # for it again.
        np.empty(LARGE_ARRAY_SIZE)
    results = np.empty((len(places), width))
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        for chunk in chunks(len(places)):
            x, y = np.ascontiguousarray(places[chunk].T)
            results[chunk] = step(x, y)
    return results
