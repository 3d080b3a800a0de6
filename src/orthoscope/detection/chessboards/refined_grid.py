"""The corners of a grid, refined; those that are off the lines of the others are sought again from where
these foresee them, and left out if that fails: no corner is better than a wrong one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orthoscope.detection.chessboards.grid import filled, grid_shape, nearest_neighbour
from orthoscope.detection.saddles.refine import Refined, refined, sought_again
from orthoscope.detection.saddles.smooth_grid import off_smooth_grid
from orthoscope.geometry.arrays import Bool, Float, median, ndarray

__all__ = ["RefinedGrid", "refined_grid"]

# In a poor picture saddles usually explain less of their windows than this.
LEAST_EXPLAINED = 0.9
# Boards with smaller steps, pixels, are treated as a poor picture's.
SMALL_STEP = 12.0
# A corner that is off its neighbours' lines is sought again so many times.
REPAIR_ROUNDS = 2
# A corner is off its neighbours' lines by at least so many steps, and so many times the usual stray.
OFF_LIMITS = (0.1, 6.0)
# A corner that is no saddle is off by at least so many steps, and so many times the usual stray.
OFF_LIMITS_WITHOUT_SADDLE = (0.04, 3.0)
# The usual stray is at most this, steps.
LARGEST_USUAL_STRAY = 0.03
# No corner that was not seen is sought nearer to the picture's rim than this, pixels.
RIM_PX = 2.0
# A part with more than this share of corners that are no saddles is not believed.
MOST_DOUBTFUL_SHARE = 0.4
# With fewer corners on the lines none of them is left out.
FEWEST_ON_LINES = 6


class RefinedGrid(NamedTuple):
    """A grid's corners (rows, columns) in the photograph.

    Attributes:
        pixels: (rows, columns, 2).
        good: which are there and on the lines of the others.
        sure: which of these are sure.
        spread: how far each can be off by its window, pixels.
        plain: which windows hold hardly anything but a saddle.
    """

    pixels: Float[ndarray, "r c 2"]
    good: Bool[ndarray, "r c"]
    sure: Bool[ndarray, "r c"]
    spread: Float[ndarray, "r c"]
    plain: Bool[ndarray, "r c"]


def refined_grid(
    grey: ndarray,
    corners: Float[ndarray, "r c 2"],
    seen: Bool[ndarray, "r c"],
    arms: Float[ndarray, "r c"],
) -> RefinedGrid:
    """The corners of a grid in the photograph.

    Args:
        grey: (h,w) uint8.
        corners: to a fifth of a step.
        seen: which were seen; the others are foreseen.
        arms: how far from each one's edges something else than squares is printed, in steps.
    """
    inside = ((corners >= RIM_PX) & (corners <= np.array(grey.shape[::-1]) - 1 - RIM_PX)).all(-1)
    row, column = np.nonzero(seen | inside)
    places, arm = np.stack([column, row], axis=1).astype(float), arms[row, column]
    fine = refined(grey, corners[row, column], places, arm=arm)
    off = _off(fine, places)
    if off.any() or not (fine.sure & fine.whole).all():
        fine, off = _repaired(grey, fine, places, off, arm, shape=seen.shape)
    good = np.zeros_like(seen)
    good[row, column] = ~off & (seen[row, column] | fine.believed)
    if not good.all() and (~fine.believed[good[row, column]]).mean() > MOST_DOUBTFUL_SHARE:
        good[:] = False
    pixels = corners.copy()
    pixels[row, column] = fine.pixels
    sure, plain, spread = np.zeros_like(seen), np.zeros_like(seen), np.zeros(seen.shape)
    sure[row, column] = fine.sure & fine.whole
    spread[row, column], plain[row, column] = fine.spread, fine.plain
    return RefinedGrid(pixels, good, sure, spread, plain)


def _repaired(
    grey: ndarray,
    fine: Refined,
    places: Float[ndarray, "m 2"],
    off: Bool[ndarray, " m"],
    arm: Float[ndarray, " m"],
    *,
    shape: tuple[int, ...],
) -> tuple[Refined, Bool[ndarray, " m"]]:
    """The corners, those that are off sought again; and which stay off."""
    column, row = places.T.astype(int)
    for _ in range(REPAIR_ROUNDS):
        if not off.any() or off.all():
            break
        known = np.full((*shape, 2), np.nan)
        known[row[~off], column[~off]] = fine.pixels[~off]
        fine = sought_again(grey, fine, filled(known)[row, column], places, off, arm=arm)
        off = _off(fine, places)
    fine, off = _on_smooth_grid(grey, fine, places, off, arm)
    return fine, _without_strays(fine, places, off)


def _on_smooth_grid(
    grey: ndarray,
    fine: Refined,
    places: Float[ndarray, "m 2"],
    off: Bool[ndarray, " m"],
    arm: Float[ndarray, " m"],
) -> tuple[Refined, Bool[ndarray, " m"]]:
    """The corners, those that are off where all others foresee them sought again from there; and which stay
    off.
    """
    on = np.flatnonzero(~off)
    if not len(on):
        return fine, off
    some = fine.of(on)
    step = median(nearest_neighbour(some.pixels, places[on]))
    poor = median(some.explained) < LEAST_EXPLAINED or step < SMALL_STEP
    away, foreseen, limit = off_smooth_grid(some.pixels, places[on], step, doubtful=~some.believed, poor=poor)
    if not away.any():
        return fine, off
    again = sought_again(grey, some, foreseen, places[on], away, arm=arm[on])
    moved = np.hypot(*(again.pixels - foreseen).T)
    off = off.copy()
    off[on[away]] = ((moved > limit) | ~again.believed)[away]
    return fine.with_others(on[away], again.of(away)), off


def _without_strays(
    fine: Refined, places: Float[ndarray, "m 2"], off: Bool[ndarray, " m"]
) -> Bool[ndarray, " m"]:
    """Which corners are off once the lines are laid through those that are not, the worst first."""
    off = off.copy()
    for _ in range(len(off)):
        on = np.flatnonzero(~off)
        if len(on) < FEWEST_ON_LINES:
            break
        some = fine.of(on)
        strays = _off(some, places[on])
        if not strays.any():
            break
        stray = grid_shape(some.pixels, places[on]).stray
        off[on[np.where(strays, stray, 0.0).argmax()]] = True
    return off


def _off(fine: Refined, places: Float[ndarray, "m 2"]) -> Bool[ndarray, " m"]:
    """Which corners are off their neighbours' lines by more than is usual, no saddles sooner."""
    stray = grid_shape(fine.pixels, places).stray
    usual = min(median(stray), LARGEST_USUAL_STRAY)
    return stray > np.where(
        fine.believed,
        max(OFF_LIMITS[0], OFF_LIMITS[1] * usual),
        max(OFF_LIMITS_WITHOUT_SADDLE[0], OFF_LIMITS_WITHOUT_SADDLE[1] * usual),
    )
