"""Corners that are sure of themselves, and that all others contradict.

The edge of something that covers a part of the board may cross a square just where one of its own edges was,
a little beside it or a little turned: the picture has a saddle there, and in blur and noise nothing in its
window tells that it is none of the board's. The others tell: each corner is compared with where a homography
and a smooth rest through all of them have it (`smooth_grid.py`), by residuals that are as large as each other
where nothing is wrong (over the root of one minus a corner's own weight). How a lens or a board bends its
outer corners the others cannot foresee well, so that much is allowed to a corner in whose window and beside
which nothing is amiss; little, where its window holds something else than a saddle, or where a corner beside
it was not seen, or where what is left is noise and not the board's shape.
"""

from __future__ import annotations

import cv2
import numpy as np

from orthoscope.detection.saddles.smooth_grid import smooth_fit, smooth_terms
from orthoscope.geometry.arrays import Bool, Float, Int, median, ndarray

__all__ = ["are_contradicted"]

# The median length of vectors whose two parts have standard deviation 1.
MEDIAN_LENGTH = 1.18
# Where noise makes the residuals a doubtful corner is off by less than so many standard deviations, any other
# by less than so many.
MOST_OF_NOISE = (4.0, 5.0)
# The same where lens and board make them.
MOST_OF_SHAPE = (5.0, 15.0)
# A picture is noisy where residuals are less than so many of the spreads that the corners' windows tell.
NOISY_SPREADS = 2.0
# A doubtful corner, and any other, that is off by less than this, pixels, stays.
LITTLE = (0.25, 0.5)
# In a noisy picture a doubtful corner, or one beside one that was not seen, is no farther than this, pixels,
# from where the others alone have it.
MOST_FROM_OTHERS = 0.75
# Whose own weight among the others is more than this they do not foresee: a doubtful one goes.
MOST_WEIGHT = 0.85
# With fewer corners the others say nothing.
FEWEST_CORNERS = 8
# A corner nearer to the picture's rim than this, pixels, may not be seen.
RIM_PX = 3.0


def are_contradicted(
    pixels: Float[ndarray, "m 2"],
    cells: Int[ndarray, "m 2"],
    counts: tuple[int, int],
    image_size: tuple[int, int],
    *,
    spread: Float[ndarray, " m"],
    doubtful: Bool[ndarray, " m"],
) -> Bool[ndarray, " m"]:
    """Which corners are off where the others have them, the worst first.

    Args:
        pixels: the corners.
        cells: the column and row of each.
        counts: columns and rows of the board.
        image_size: width and height, pixels.
        spread: standard deviation of each, pixels, by its own window.
        doubtful: in whose window there is something else than a saddle.
    """
    off, places = np.zeros(len(pixels), dtype=bool), cells.astype(float)
    little = np.zeros(0, dtype=bool)
    for _ in range(len(pixels)):
        on = np.flatnonzero(~off)
        terms = smooth_terms(places[on]) if len(on) >= FEWEST_CORNERS else None
        if terms is None:
            break
        fitted, weight = smooth_fit(pixels[on], places[on], terms, np.ones(len(on), dtype=bool))
        if fitted is None:
            break
        residual = np.hypot(*(pixels[on] - fitted).T) / np.sqrt(1.0 - weight)
        usual = median(residual) / MEDIAN_LENGTH
        noisy = usual < NOISY_SPREADS * median(spread[on])
        times = MOST_OF_NOISE if noisy else MOST_OF_SHAPE
        of_doubtful, of_others = (max(most * usual, least) for most, least in zip(times, LITTLE, strict=True))
        from_others = residual / np.sqrt(1.0 - weight) / MOST_FROM_OTHERS
        alone = weight > MOST_WEIGHT
        if residual.max() <= of_doubtful and from_others.max() <= 1.0 and not alone.any():
            break
        if not len(little):
            little = doubtful | _beside_lost(pixels, cells, counts, image_size)
        excess = residual / np.where(little[on], of_doubtful, of_others)
        excess = np.maximum(excess, np.where(little[on] & noisy, from_others, 0.0))
        if excess.max() <= 1.0:  # what is contradicted goes first: with fewer corners others may foresee less
            excess = np.where(alone & little[on], np.inf, 0.0)
        if excess.max() <= 1.0:
            break
        off[on[excess.argmax()]] = True
    return off


def _beside_lost(
    pixels: Float[ndarray, "m 2"],
    cells: Int[ndarray, "m 2"],
    counts: tuple[int, int],
    image_size: tuple[int, int],
) -> Bool[ndarray, " m"]:
    """Which corners are next to one that ought to be seen and is not among them."""
    columns, rows = counts
    homography, _ = cv2.findHomography(cells.astype(float), pixels, 0)
    if homography is None:
        return np.zeros(len(pixels), dtype=bool)
    row, column = np.mgrid[:rows, :columns].astype(float)
    there = cv2.perspectiveTransform(np.stack([column, row], axis=-1), homography)
    lost = np.all((there >= RIM_PX) & (there <= np.array(image_size) - 1 - RIM_PX), axis=-1)
    lost[cells[:, 1], cells[:, 0]] = False
    near = cv2.dilate(lost.astype(np.uint8), np.ones((3, 3), np.uint8))
    return near[cells[:, 1], cells[:, 0]].astype(bool)
