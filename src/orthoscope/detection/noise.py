"""How noisy a picture is."""

from __future__ import annotations

import numpy as np

from orthoscope.geometry.arrays import median, ndarray

__all__ = ["noise_variance"]

# So many pixels, evenly picked, tell the noise.
NOISE_PIXELS = 10_000
# A pixel and those around it, down and across, with weights that leave nothing of a slope.
OFFSETS = np.array([(down, across) for down in (-1, 0, 1) for across in (-1, 0, 1)])
WEIGHTS = np.array([1, -2, 1, -2, 4, -2, 1, -2, 1], dtype=np.float32)


def noise_variance(grey: ndarray) -> float:
    """The variance of a picture's noise, from what differs from pixel to pixel in its even parts.

    Args:
        grey: (h,w) uint8.
    """
    height, width = grey.shape
    if min(height, width) < 3:
        return 0.0
    row, column = np.divmod(
        np.arange(0, (height - 2) * (width - 2), max(1, height * width // NOISE_PIXELS)), width - 2
    )
    at = ((row + 1) * width + column + 1)[:, None] + (OFFSETS @ [width, 1])
    rough = grey.ravel().take(at).astype(np.float32) @ WEIGHTS
    return float((median(np.abs(rough)) / (0.6745 * 6.0)) ** 2)
