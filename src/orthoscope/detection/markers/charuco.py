"""Finding a ChArUco board: as the chessboard that it is, with ids by all its markers together.

Where that shows less than the whole board each marker that can be read alone says where the four corners of
its square are, to a pixel or two. No corner is interpolated between markers: what a lens bends is not on
straight lines. A saddle is fitted to each, then to those next to them that the known ones foresee. Which of
OpenCV's two layouts was printed is seen by the markers: only with the right one do all of them lie where the
board has them.
"""

from __future__ import annotations

import cv2
import numpy as np

from orthoscope.detection.chessboards.grid import grid_shape, lattice, nearest_neighbour
from orthoscope.detection.markers.charuco_lattice import charuco_grid
from orthoscope.detection.markers.foreseen import are_off, next_corners
from orthoscope.detection.markers.markers import Markers, find_markers, homography_of, of_one_board, remark_on
from orthoscope.detection.saddles.linked import are_linked
from orthoscope.detection.saddles.refine import refined
from orthoscope.detection.sight import Sight, Unseen
from orthoscope.geometry.arrays import Bool, Float, median, ndarray
from orthoscope.targets.charuco import Charuco

__all__ = ["see_charuco"]

# Where this share of the board's markers is found no other copy is looked at.
ENOUGH_MARKERS_SHARE = 0.9
# Where no more than this share of its corners is missing, all markers together have shown the board, and none
# is read alone.
MOST_MISSING_SHARE = 0.05
# Markers read alone and together have corners in the same places, within this share of a square.
MOST_APART_SHARE = 0.3
# A corner strays from its neighbours' lines by less than this share of a square.
MOST_STRAY_SHARE = 0.1
# These are a square's corners about its middle.
SQUARE_CORNERS = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
# No corner is sought nearer to the picture's rim than this, pixels.
RIM_PX = 2.0
# A corner is sought again where it is foreseen farther from where it was than this share of a square.
MOVED_SHARE = 0.06
# A sight of the board has at least this many corners.
FEWEST_CORNERS = 4


def see_charuco(grey: ndarray, board: Charuco) -> Sight | Unseen:
    """The corners of a ChArUco board, or of the part of it that can be seen.

    Args:
        grey: (h,w) uint8.
        board: what to look for.
    """
    together, twice = charuco_grid(grey, board)
    seen = None if together is None else _fitted(grey, together, board, twice)
    if seen and _is_complete(seen, board, grey.shape):
        return seen
    count = len(board.marker_squares())
    found = find_markers(grey, board.dictionary, int(ENOUGH_MARKERS_SHARE * count))
    markers, legacy, remark = _in_layout(found, board)
    alone = _foreseen(markers, board.marker_corners(legacy=legacy), *board.grid)
    if together is None and not len(markers.numbers):
        return Unseen(f"was not found in it: none of the markers of {board.dictionary} was")
    if together is not None:
        known = np.isfinite(together) if _agree(together, alone) else True
        alone = np.where(known, together, alone)
    more = _fitted(grey, alone, board, twice or remark)
    if more and not (seen and len(seen.ids) >= len(more.ids)):
        return more
    return seen or Unseen("is in it, but too blurred, dim or small to say where its corners are")


def _is_complete(seen: Sight, board: Charuco, shape: tuple[int, ...]) -> bool:
    """Whether hardly a corner of the board is missing that those next to it foresee in the picture."""
    missing, there = next_corners(lattice(*board.grid), seen.ids, seen.pixels, 1.0)
    inside = ((there >= RIM_PX) & (there <= np.array(shape[::-1]) - 1 - RIM_PX)).all(1)
    return bool(inside.sum() <= MOST_MISSING_SHARE * len(seen.ids)) or not len(missing)


def _agree(one: Float[ndarray, "r c 2"], other: Float[ndarray, "r c 2"]) -> bool:
    """Whether two grids have most corners that both have in the same places."""
    off = np.hypot(*(one - other)[np.isfinite(one - other).all(-1)].T)
    step = _step(one.reshape(-1, 2), lattice(*one.shape[1::-1]))
    return not len(off) or median(off) < MOST_APART_SHARE * step


def _fitted(grey: ndarray, grid: Float[ndarray, "r c 2"], board: Charuco, remark: str) -> Sight | None:
    """The corners that are sure, from where some are foreseen."""
    corners, good = _grown(grey, grid, board.arm)
    cells = np.argwhere(good)[:, ::-1]
    good[good] = are_linked(corners[good], cells, cells.astype(float))
    good[good] = ~are_off(corners[good], np.argwhere(good)[:, ::-1].astype(float))
    if good.sum() < FEWEST_CORNERS:
        return None
    ids = np.flatnonzero(good)
    return Sight(ids, corners.reshape(-1, 2)[ids], remark)


def _in_layout(found: Markers, board: Charuco) -> tuple[Markers, bool, str]:
    """The markers that are the board's, whether they lie in the old layout (of two equally good, as it is
    said), and a remark on the choice.
    """
    best = Markers(found.numbers[:0], found.corners[:0]), board.legacy, ""
    numbers = found.numbers - board.first
    for legacy in (board.legacy, not board.legacy):
        plane = board.marker_corners(legacy=legacy)
        known = (numbers >= 0) & (numbers < len(plane))
        markers = Markers(numbers[known], found.corners[known])
        mine = of_one_board(markers, plane[markers.numbers])
        if mine.sum() > len(best[0].numbers):
            chosen = Markers(markers.numbers[mine], markers.corners[mine])
            best = chosen, legacy, remark_on(markers, mine)
    return best


def _foreseen(
    markers: Markers, plane: Float[ndarray, "k 4 2"], columns: int, rows: int
) -> Float[ndarray, "r c 2"]:
    """The corners of each marker's square, by the marker's own, in the mean over its neighbours; NaN for
    others.
    """
    total, count = np.zeros((rows, columns, 2)), np.zeros((rows, columns, 1))
    for number, corners in zip(markers.numbers, markers.corners, strict=True):
        places = np.round(plane[number].mean(0) + SQUARE_CORNERS)
        on_board = ((places >= 0) & (places < [columns, rows])).all(1)
        if on_board.any():
            there = places[on_board]
            seen = cv2.perspectiveTransform(there[None], homography_of(plane[number], corners))[0]
            column, row = there.astype(int).T
            total[row, column] += seen
            count[row, column] += 1
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _grown(
    grey: ndarray, grid: Float[ndarray, "r c 2"], arm: float
) -> tuple[Float[ndarray, "r c 2"], Bool[ndarray, "r c"]]:
    """Corners fitted where they are foreseen, then those next to them, until no more are found."""
    rows, columns = grid.shape[:2]
    places = lattice(columns, rows)
    start, pixels = grid.reshape(-1, 2).copy(), grid.reshape(-1, 2)
    good, sure = np.zeros((2, len(places)), dtype=bool)
    tried = np.full_like(start, np.nan)
    for _ in range(rows + columns):
        inside = ((start >= RIM_PX) & (start <= np.array(grey.shape[::-1]) - 1 - RIM_PX)).all(1)
        moved = ~(np.hypot(*(start - tried).T) < MOVED_SHARE * _step(start, places))
        new = inside & ~good & moved
        if not new.any():
            break
        tried[new] = start[new]
        ids = np.flatnonzero(good | new)
        fine = refined(grey, start[ids], places[ids], approach=False, arm=arm)
        fits = fine.believed & (grid_shape(fine.pixels, places[ids]).stray < MOST_STRAY_SHARE)
        pixels = np.full_like(pixels, np.nan)
        pixels[ids[fits]], good = fine.pixels[fits], np.isin(np.arange(len(places)), ids[fits])
        sure[ids] = fits & fine.sure & fine.whole
        if len(known := np.flatnonzero(good)) < FEWEST_CORNERS:
            break
        start = pixels.copy()
        more, there = next_corners(places, known, pixels[known], 1.0)
        start[more] = there
    return pixels.reshape(grid.shape), (good & sure).reshape(rows, columns)


def _step(start: Float[ndarray, "m 2"], places: Float[ndarray, "m 2"]) -> float:
    """A usual step of the lattice, pixels."""
    known = np.isfinite(start[:, 0])
    return median(nearest_neighbour(start[known], places[known])) if known.any() else 1.0
