"""How noisy a picture is."""

from __future__ import annotations

import cv2
import numpy as np

from orthoscope.geometry.arrays import median, ndarray

__all__ = ["noise_variance"]

# So many pixels, evenly picked, tell the noise.
NOISE_PIXELS = 10_000


def noise_variance(grey: ndarray) -> float:
    """The variance of a picture's noise, from what differs from pixel to pixel in its even parts.

    Args:
        grey: (h,w) uint8.
    """
    rough = cv2.filter2D(grey, cv2.CV_32F, np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], dtype=np.float32))
    rough = rough.ravel()[:: max(1, rough.size // NOISE_PIXELS)]
    return float((median(np.abs(rough)) / (0.6745 * 6.0)) ** 2)
