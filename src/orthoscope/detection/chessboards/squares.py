"""The squares between and around a grid's corners: are they bright and dark by turns?"""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np

from orthoscope.detection.chessboards.grid import steps_of
from orthoscope.geometry.arrays import Bool, Float, median, ndarray

__all__ = ["alternating", "plain_part"]

# Where squares are looked at, as shares of their sides.
PLACES_IN_SQUARE = (0.3, 0.5, 0.7)
# The place with the least contrast of bright to dark squares has at least this share of the greatest.
LEAST_PLAIN_SHARE = 0.37
# Of the squares of a strip whose corners are all seen more than this share is plain, or there is a fault.
LEAST_PLAIN_SQUARES_SHARE = 0.5
# A strip's contrast is below that of a square where it is by so many standard errors.
SURE_ERRORS = 3.0
# Where a line's step differs from the next by less than this share of the shorter side of a square it may be
# tilt, or the lens.
MOST_KINK = 0.6
# In the four squares around a corner the grey is looked at so far from their sides, squares.
STEPS_INTO_SQUARE = (0.15, 0.25, 0.35)
# Weights (3, 36) of the corner, its step along the row and its step along the column: nine places in each of
# the four squares, those of one colour first.
PLACES_IN_SQUARES = np.array(
    [
        (1.0, across * step, up * other)
        for across, up in ((1, 1), (-1, -1), (1, -1), (-1, 1))
        for step in STEPS_INTO_SQUARE
        for other in STEPS_INTO_SQUARE
    ]
).T


def plain_part(
    grey: ndarray, grid: Float[ndarray, "r c 2"], seen: Bool[ndarray, "r c"], bright: bool
) -> tuple[slice, slice] | None:
    """Rows and columns of the part of a grid without faults; None where its squares are none.

    Where a board is seen small and slanted a lattice may link every other corner, or middles of squares: its
    own squares are then parts of several, at some of nine places in them. Or links leap from a corner to one
    that is a square farther to the side: on both sides of such a fault, a strip of squares from side to side
    that are not plain, or at which all lines kink, the lattice is right, but its lines do not belong
    together.

    Args:
        grey: (h,w) uint8.
        grid: the corners.
        seen: which of them were seen.
        bright: whether the first square is a bright one.
    """
    rows, columns = (slice(0, count) for count in seen.shape)
    colours = (np.add.outer(*(np.arange(count - 1) for count in seen.shape)) % 2 == 0) == bright
    whole = seen[:-1, :-1] & seen[1:, :-1] & seen[:-1, 1:] & seen[1:, 1:]
    if not (whole & colours).any() or not (whole & ~colours).any():
        return rows, columns
    values = _in_squares(grey, grid)
    if values is None:
        return None
    of_bright, of_dark = values[:, whole & colours], values[:, whole & ~colours]
    level = 0.5 * (median(of_bright) + median(of_dark))
    plain = whole & np.where(colours, values.min(0) > level, values.max(0) < level)
    for axis in (0, 1):
        known, right = whole.sum(1 - axis), plain.sum(1 - axis)
        patchy = _patchy_strips(values, whole & colours, whole & ~colours, axis)
        faulty = (known > 0) & (right <= LEAST_PLAIN_SQUARES_SHARE * known) | patchy
        faults = np.flatnonzero(faulty | _beside_kinks(grid, seen, axis)) + 1
        if len(faults):
            ends, lines = [0, *faults.tolist(), seen.shape[axis]], seen.sum(1 - axis)
            most = max((slice(*part) for part in pairwise(ends)), key=lambda part: lines[part].sum())
            rows, columns = (most, columns) if axis == 0 else (rows, most)
    in_part = np.zeros_like(whole)
    in_part[rows.start : rows.stop - 1, columns.start : columns.stop - 1] = True
    light, dark = whole & colours & in_part, whole & ~colours & in_part
    if not light.any() or not dark.any():
        return rows, columns
    contrast = values[:, light].mean(1) - values[:, dark].mean(1)
    return (rows, columns) if contrast.min() > LEAST_PLAIN_SHARE * contrast.max() else None


def _patchy_strips(
    values: Float[ndarray, "9 a b"], light: Bool[ndarray, "a b"], dark: Bool[ndarray, "a b"], axis: int
) -> Bool[ndarray, " k"]:
    """Which strips of squares have, at one of the nine places, surely less contrast than a square has.

    Where links leap two squares on and one to the side, places are squares of one colour, or lie between
    two.
    """
    (bright, error), (black, black_error) = (
        _means_of_strips(values, squares, 1 - axis) for squares in (light, dark)
    )
    contrast = bright - black
    above = contrast + SURE_ERRORS * np.sqrt(error**2 + black_error**2)
    return (above < LEAST_PLAIN_SHARE * contrast.max(0)).any(0)


def _beside_kinks(
    grid: Float[ndarray, "r c 2"], seen: Bool[ndarray, "r c"], axis: int
) -> Bool[ndarray, " k"]:
    """Which strips of squares are on either side of a line at which those that cross it kink: one of the two
    is a fault.
    """
    lines = np.where(seen[..., None], grid, np.nan)
    lines = lines.transpose(1, 0, 2) if axis else lines  # one after the other now
    beside = np.zeros(len(lines) - 1, dtype=bool)
    steps = np.diff(lines, axis=0)
    kinks, lengths = np.linalg.norm(np.diff(steps, axis=0), axis=-1), np.linalg.norm(steps, axis=-1)
    along = np.linalg.norm(np.diff(lines[1:-1], axis=1), axis=-1)
    for line, (kink, *beyond, side) in enumerate(zip(kinks, lengths[:-1], lengths[1:], along, strict=True)):
        known = np.isfinite(kink)
        if known.sum() > 1 and np.isfinite(side).any():
            least = np.minimum(np.minimum(*beyond)[known], median(side[np.isfinite(side)]))
            beside[line : line + 2] |= median(kink[known] / np.maximum(least, 1e-9)) > MOST_KINK
    return beside


def _means_of_strips(
    values: Float[ndarray, "9 a b"], squares: Bool[ndarray, "a b"], across: int
) -> tuple[Float[ndarray, "9 k"], Float[ndarray, "9 k"]]:
    """The mean of some squares of each strip at each place, and its standard error; NaN for one square."""
    count = squares.sum(across)
    mean = (values * squares).sum(1 + across) / np.maximum(count, 1)
    rest = (values - np.expand_dims(mean, 1 + across)) * squares
    enough = np.where(count > 1, count * (count - 1.0), np.nan)
    return mean, np.sqrt((rest**2).sum(1 + across) / enough)


def _in_squares(grey: ndarray, corners: Float[ndarray, "r c 2"]) -> Float[ndarray, "9 a b"] | None:
    """The grey of nine places in each square between a grid's corners; None where that is not in the
    picture.
    """
    u, v = (part.reshape(-1, 1, 1, 1) for part in np.meshgrid(PLACES_IN_SQUARE, PLACES_IN_SQUARE))
    places = (1 - v) * ((1 - u) * corners[:-1, :-1] + u * corners[:-1, 1:])
    places += v * ((1 - u) * corners[1:, :-1] + u * corners[1:, 1:])
    low = np.maximum(np.floor(places.reshape(-1, 2).min(0)) - 4, 0).astype(int)
    high = np.maximum(np.ceil(places.reshape(-1, 2).max(0)) + 5, low + 1).astype(int)
    part = cv2.GaussianBlur(grey[low[1] : high[1], low[0] : high[0]], (0, 0), 1.0)
    if not part.size:
        return None
    x, y = (places - low).reshape(len(places), -1, 2).astype(np.float32).transpose(2, 0, 1)
    values = cv2.remap(part, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).astype(float)
    return values.reshape(places.shape[:3])


def alternating(grey: ndarray, grid: ndarray) -> Float[ndarray, "r c"]:
    """How much brighter the square between +column and +row and its opposite are than the two others, grey
    levels, every other corner's sign turned: a board has one sign throughout. 0 where they are not two and
    two.
    """
    rows, columns = grid.shape[:2]
    strength = _strengths(grey, grid)
    return strength * np.where(np.add.outer(np.arange(rows), np.arange(columns)) % 2, -1.0, 1.0)


def _strengths(grey: ndarray, grid: ndarray) -> Float[ndarray, "r c"]:
    """How much brighter the square between +column and +row and its opposite are than the two others, grey
    levels.

    Negative where they are darker; 0 where the four squares are not two and two, or one of them is not in the
    picture.
    """
    rows, columns = grid.shape[:2]
    along, down = steps_of(grid)
    at = np.stack([grid, along, down]).reshape(3, -1, 2).transpose(2, 1, 0) @ PLACES_IN_SQUARES  # (2, m, 36)
    height, width = grey.shape
    x, y = np.rint(np.clip(at, -9e5, 9e5)).astype(int)
    inside = ((x >= 0) & (x < width) & (y >= 0) & (y < height)).all(1)
    seen = grey.ravel().take(y * width + x, mode="clip")
    one, two, three, four = seen.reshape(len(seen), 4, -1).mean(-1).T  # the first two are of one colour
    bright = np.minimum(one, two) - np.maximum(three, four)
    dark = np.minimum(three, four) - np.maximum(one, two)
    return np.where(inside, np.maximum(bright, 0.0) - np.maximum(dark, 0.0), 0.0).reshape(rows, columns)
