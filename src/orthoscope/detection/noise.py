"""How noisy a picture is."""

from __future__ import annotations

import numpy as np

from orthoscope.geometry.arrays import ndarray

__all__ = ["noise_variance"]

# About so many pixels, in rows evenly picked, tell the noise.
NOISE_PIXELS = 20_000


def noise_variance(grey: ndarray) -> float:
    """The variance of a picture's noise, from what differs from pixel to pixel in its even parts.

    Args:
        grey: (h,w) uint8.
    """
    if min(grey.shape) < 3:
        return 0.0
    every = max(1, grey.size // NOISE_PIXELS)
    rows = (grey[:-2:every], grey[1:-1:every], grey[2::every])
    above, here, below = (row.astype(np.int16) for row in rows)
    bent = above + below - 2 * here
    rough = bent[:, :-2] + bent[:, 2:] - 2 * bent[:, 1:-1]
    return float((_median_of_whole(np.abs(rough)) / (0.6745 * 6.0)) ** 2)


def _median_of_whole(numbers: ndarray) -> float:
    """The median of whole numbers, none negative, that stand for all that is rounded to them: one between two
    of them where many are alike.
    """
    counts = np.bincount(numbers.ravel())
    half, upto = 0.5 * numbers.size, counts.cumsum()
    middle = int(np.searchsorted(upto, half))
    share = (half - (upto[middle] - counts[middle])) / counts[middle]
    return middle - 0.5 + share if middle else 0.5 * share
