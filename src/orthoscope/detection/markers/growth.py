"""From some corners of a board of markers, roughly known, to all that are sure.

A saddle is fitted to each, then to those next to them that the known ones foresee, until no more are found;
one that was not found is sought again where others foresee it elsewhere. What does not hang together, or is
off where all others foresee it, goes.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from orthoscope.detection.chessboards.grid import grid_shape, nearest_neighbour
from orthoscope.detection.markers.foreseen import are_off, next_corners
from orthoscope.detection.markers.tag_sides import TagSides, are_at_tags
from orthoscope.detection.saddles.linked import are_linked
from orthoscope.detection.saddles.refine import Refined, refined, sought_again
from orthoscope.detection.sight import Sight
from orthoscope.geometry.arrays import Bool, Float, Int, median, ndarray

__all__ = ["CornersOfBoard", "Grown", "grown_from", "grown_with", "sight_of"]

# A corner strays from its neighbours' lines by less than this share of a step; a fisheye bends them by half.
MOST_STRAY_SHARE = 0.2
# No corner is sought nearer to the picture's rim than this, pixels.
RIM_PX = 2.0
# A corner is sought so many times, where it is foreseen elsewhere by more than this share of a step.
MOST_TRIES, MOVED_SHARE = 3, 0.12
# A corner is fitted no farther from where it was foreseen than this share of a step, that counts as at least
# so many pixels: by 4 a tag's own corners may be off, however small the gaps.
FARTHEST_SHARE, LEAST_STEP_PX = 0.4, 10.0
# What is seen roughly is where others foresee it to this share of a step.
ROUGHLY_SHARE = 0.15
# A corner that is sure moves by less than this, pixels, when it is fitted once more.
STEADY_PX = 0.5
# A sight of a board has at least this many corners.
FEWEST_CORNERS = 4
# Where no more than this share of the corners is missing the whole board is seen.
MOST_MISSING_SHARE = 0.05
# Two ways to find corners have them in the same places, within this share of a step.
MOST_APART_SHARE = 0.3


class CornersOfBoard(NamedTuple):
    """What growing needs to know of a board.

    Attributes:
        places: (m,2) where it has its corners, in steps, x and y as seen from the front.
        cells: (m,2) column and row of each.
        arm: how far from a corner's edges something else than squares is printed, in steps.
        reach: how far from a corner those are that it foresees, in steps.
        tags: on which side of each a tag is, where it is one's corner.
    """

    places: Float[ndarray, "m 2"]
    cells: Int[ndarray, "m 2"]
    arm: float
    reach: float
    tags: TagSides | None = None


class Grown(NamedTuple):
    """What became of some corners.

    Attributes:
        pixels: (m,2) all that were found, NaN for others.
        sure: (m,) which are sure.
        is_complete: whether hardly one is missing that those next to it foresee in the picture.
    """

    pixels: Float[ndarray, "m 2"]
    sure: Bool[ndarray, " m"]
    is_complete: bool


def grown_from(
    grey: ndarray, rough: Float[ndarray, "m 2"], board: CornersOfBoard, *, approach: bool = False
) -> Grown:
    """All corners that can be found from those that are known.

    Args:
        grey: (h,w) uint8.
        rough: where corners are seen roughly; NaN for others.
        board: whose they are.
        approach: whether they may be off by more than a saddle's fit mends.
    """
    places, count = board.places, len(board.places)
    start, good, fine = _without_mistaken(rough, board, grey.shape), np.zeros(count, dtype=bool), None
    tried, tries = np.full_like(start, np.nan), np.zeros(count, dtype=int)
    for _ in range(int(board.cells.max(0).sum()) + 2):
        moved = ~(np.hypot(*(start - tried).T) < MOVED_SHARE * _step(start, places))
        new = _inside(start, grey.shape) & ~good & moved & (tries < MOST_TRIES)
        if not new.any():
            break
        tried[new], tries[new] = start[new], tries[new] + 1
        ids, before = np.flatnonzero(good | new), int(good.sum())
        if fine is None:
            some = refined(grey, start[ids], places[ids], approach=approach, arm=board.arm)
            fine = some.among(ids, count)
        else:
            some = sought_again(grey, fine.of(ids), start[ids], places[ids], new[ids], arm=board.arm)
            fine = fine.with_others(ids, some)
        good[ids] = _fit(grey, some, start[ids], ids, board)
        known = np.flatnonzero(good)
        start = np.where(good[:, None], fine.pixels, np.nan)
        more, there = next_corners(places, known, fine.pixels[known], board.reach)
        start[more] = there
        if len(known) < FEWEST_CORNERS or len(known) <= before:
            break
    missing = int((_inside(start, grey.shape) & ~good).sum())
    if fine is None:
        return Grown(start, good, False)
    before = fine.pixels
    fine, good = _once_more(grey, fine, good, board)
    pixels = np.where(good[:, None], fine.pixels, np.nan)
    sure = good & fine.sure & fine.whole & (np.hypot(*(fine.pixels - before).T) < STEADY_PX)
    return Grown(pixels, sure, missing <= MOST_MISSING_SHARE * good.sum())


def _without_mistaken(
    rough: Float[ndarray, "m 2"], board: CornersOfBoard, shape: tuple[int, ...]
) -> Float[ndarray, "m 2"]:
    """Roughly seen corners without what is none of them: a lattice may end inside a marker."""
    start, ids = rough.copy(), np.flatnonzero(np.isfinite(rough[:, 0]))
    least = ROUGHLY_SHARE * _step(rough, board.places)
    start[ids[are_off(rough[ids], board.places[ids], shape, least=least)]] = np.nan
    return start


def _once_more(
    grey: ndarray, fine: Refined, good: Bool[ndarray, " m"], board: CornersOfBoard
) -> tuple[Refined, Bool[ndarray, " m"]]:
    """The corners that are good fitted from where they are: how their lines bend is known better now."""
    ids = np.flatnonzero(good)
    if not len(ids):
        return fine, good
    start = fine.pixels[ids]
    again = refined(grey, start, board.places[ids], approach=False, arm=board.arm)
    good = good.copy()
    good[ids] = _fit(grey, again, start, ids, board)
    return fine.with_others(ids, again), good


def _fit(
    grey: ndarray, fine: Refined, start: Float[ndarray, "k 2"], ids: Int[ndarray, " k"], board: CornersOfBoard
) -> Bool[ndarray, " k"]:
    """Which corners are saddles of the board's lattice where they were foreseen."""
    places = board.places[ids]
    step = np.maximum(nearest_neighbour(start, places), LEAST_STEP_PX)
    fits = fine.believed & (grid_shape(fine.pixels, places).stray < MOST_STRAY_SHARE)
    fits &= np.hypot(*(fine.pixels - start).T) < FARTHEST_SHARE * step
    fits &= _alternate(fine.contrast, fits, board.cells[ids])
    if board.tags is not None:
        fits[fits] = are_at_tags(grey, fine.pixels[fits], places[fits], ids[fits], board.tags)
    return fits


def sight_of(grown: Grown, board: CornersOfBoard, shape: tuple[int, ...], remark: str) -> Sight | None:
    """The corners that are sure, hang together and are where others foresee them; None where hardly any is.

    Args:
        grown: corners.
        board: whose they are.
        shape: of the picture.
        remark: on the choice of the board.
    """
    ids = np.flatnonzero(grown.sure)
    ids = ids[are_linked(grown.pixels[ids], board.cells[ids], board.places[ids])]
    doubtful = _beside_lost(ids, board.cells)
    ids = ids[~are_off(grown.pixels[ids], board.places[ids], shape, doubtful=doubtful)]
    return Sight(ids, grown.pixels[ids], remark) if len(ids) >= FEWEST_CORNERS else None


def _beside_lost(ids: Int[ndarray, " k"], cells: Int[ndarray, "m 2"]) -> Bool[ndarray, " k"]:
    """Which of some corners are next to one of the board's that is not among them."""
    lost = np.zeros(cells.max(0) + 3, dtype=np.uint8)
    lost[tuple((cells + 1).T)] = 1
    lost[tuple((cells[ids] + 1).T)] = 0
    near = cv2.dilate(lost, np.ones((3, 3), np.uint8))
    return near[tuple((cells[ids] + 1).T)].astype(bool)


def grown_with(
    grey: ndarray,
    seen: Grown | None,
    others: Float[ndarray, "m 2"],
    board: CornersOfBoard,
    *,
    approach: bool = False,
) -> Grown:
    """Corners grown with those that were found otherwise, where they are in the same places.

    Args:
        grey: (h,w) uint8.
        seen: as found at first; None where that was nothing.
        others: where corners are, NaN for others.
        board: whose they are.
        approach: whether the others may be off by more than a saddle's fit mends.
    """
    if seen is None:
        return grown_from(grey, others, board, approach=approach)
    off = np.hypot(*(seen.pixels - others)[np.isfinite(seen.pixels - others).all(1)].T)
    if len(off) and median(off) > MOST_APART_SHARE * _step(seen.pixels, board.places):
        return seen
    if not (np.isfinite(others) & np.isnan(seen.pixels)).any():
        return seen
    both = np.where(np.isfinite(seen.pixels), seen.pixels, others)
    more = grown_from(grey, both, board, approach=approach)
    return more if more.sure.sum() > seen.sure.sum() else seen


def _alternate(
    contrast: Float[ndarray, " k"], fits: Bool[ndarray, " k"], cells: Int[ndarray, "k 2"]
) -> Bool[ndarray, " k"]:
    """Which corners have their bright squares where they must; those next to each other the other way round.

    Where tags stand close a corner's neighbour, a true corner too, may be nearer than it is foreseen.
    """
    way = np.sign(contrast) * (1 - 2 * (cells.sum(1) % 2))
    return np.equal(way, 1 if way[fits].sum() > 0 else -1)


def _inside(pixels: Float[ndarray, "m 2"], shape: tuple[int, ...]) -> Bool[ndarray, " m"]:
    inside: ndarray = (pixels >= RIM_PX) & (pixels <= np.array(shape[::-1]) - 1 - RIM_PX)
    return np.asarray(inside.all(1))


def _step(pixels: Float[ndarray, "m 2"], places: Float[ndarray, "m 2"]) -> float:
    """A usual step of the lattice, pixels."""
    known = np.isfinite(pixels[:, 0])
    return median(nearest_neighbour(pixels[known], places[known])) if known.any() else 1.0
