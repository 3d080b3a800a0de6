"""Dark spots whose moments are an ellipse's, which may be discs.

A threshold says which pixels are dark: compared with their surroundings, a few sizes of which are tried, or
with one level for all. A spot is a disc's image where its area A and the covariance C of its pixels agree,

    A = 4 pi sqrt(det C)   for an ellipse, less for any other shape.
"""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np

from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.geometry.ellipses import Ellipses

__all__ = ["SMOOTHING_SIGMA", "spots"]

# Thresholds are taken over windows of these shares of the longer side.
WINDOW_SHARES = (0.12, 0.04, 0.3)
# A spot is darker than its surroundings by at least so many grey levels.
LEAST_STEP = 6.0
# A spot has at least this many pixels.
FEWEST_PIXELS = 9
# A spot covers less than this share of the picture.
LARGEST_SHARE = 0.2
# The area over that of the ellipse, A / (4 pi sqrt(det C)), is more than this; a square has .955, but small
# discs are stairs.
LEAST_LIKENESS = 0.93
# From so many pixels on stairs no longer matter.
SHARP_PIXELS = 120
# A disc of so many pixels has more than this likeness to an ellipse.
LEAST_LIKENESS_SHARP = 0.975
# Half the shorter axis is more than this, pixels.
LEAST_HALF_AXIS = 0.9
# One axis is less than so many times the other.
MOST_AXIS_RATIO = 12.0
# More spots than this are noise.
MOST_SPOTS = 4000
# The picture is smoothed with this sigma, pixels.
SMOOTHING_SIGMA = 0.7


def spots(grey: ndarray) -> Iterator[Ellipses]:
    """Dark spots that may be discs, under one threshold after the other.

    Args:
        grey: (h,w) uint8.
    """
    longer = max(grey.shape)
    smooth = cv2.GaussianBlur(grey, (0, 0), SMOOTHING_SIGMA)
    for share in WINDOW_SHARES:
        window = max(3, int(share * longer)) | 1
        level = cv2.blur(smooth, (window, window), borderType=cv2.BORDER_REPLICATE)
        yield _elliptic(smooth < level.astype(np.int16) - LEAST_STEP)
    level, _ = cv2.threshold(smooth, 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
    yield _elliptic(smooth <= level)


def _elliptic(dark: ndarray) -> Ellipses:
    """The connected parts of a mask whose moments are an ellipse's and that do not touch the border."""
    _, labels, stats, middles = cv2.connectedComponentsWithStats(dark.astype(np.uint8), connectivity=4)
    left, top, width, height, area = stats.T
    inside = (left > 0) & (top > 0) & (left + width < dark.shape[1]) & (top + height < dark.shape[0])
    fits = inside & (area >= FEWEST_PIXELS) & (area < LARGEST_SHARE * dark.size)
    fits &= area > 0.5 * np.pi / (4.0 * np.sqrt(2.0)) / MOST_AXIS_RATIO * np.minimum(width, height) ** 2
    fits[0] = False
    if not 0 < fits.sum() <= MOST_SPOTS:
        return Ellipses(np.zeros((0, 2)), np.zeros((0, 2, 2)))
    covariances = _covariances(labels, fits, middles)
    which = np.flatnonzero(fits)
    values, vectors = np.linalg.eigh(covariances)
    like = area[which] / (4.0 * np.pi * np.sqrt(np.maximum(values.prod(1), 1e-12)))
    least = np.where(area[which] < SHARP_PIXELS, LEAST_LIKENESS, LEAST_LIKENESS_SHARP)
    radii = 2.0 * np.sqrt(np.maximum(values, 1e-12))
    good = (like > least) & (radii[:, 0] > LEAST_HALF_AXIS) & (radii[:, 1] < MOST_AXIS_RATIO * radii[:, 0])
    axes = np.einsum("nij,nj,nkj->nik", vectors, radii, vectors)
    return Ellipses(middles[which][good], axes[good])


def _covariances(labels: ndarray, fits: ndarray, middles: ndarray) -> Float[ndarray, "n 2 2"]:
    """Of the pixels of the parts that fit, each pixel a square."""
    count = int(fits.sum())
    numbers = np.where(fits, np.cumsum(fits) - 1, -1)
    pixels = np.flatnonzero(labels)
    number = numbers[labels.ravel()[pixels]]
    pixels, number = pixels[number >= 0], number[number >= 0]
    row, column = np.divmod(pixels, labels.shape[1])
    x, y = column - middles[fits][number, 0], row - middles[fits][number, 1]
    sums = [np.bincount(number, weight, count) for weight in (x * x, x * y, x * y, y * y)]
    area = np.bincount(number, minlength=count)
    return (np.stack(sums, axis=-1) / area[:, None]).reshape(-1, 2, 2) + np.eye(2) / 12.0
