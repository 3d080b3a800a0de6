"""Finding a ChArUco board: its markers say where each corner is to a pixel or two, a saddle fit says the
rest.

No corner is interpolated between markers: what a lens bends is not on straight lines. From each marker the
four corners of its square are foreseen by the marker's own four corners, then fitted; from the corners so
found those next to them whose markers are hidden. Which of OpenCV's two layouts was printed is seen by the
markers: only with the right one do all of them lie on one plane.
"""

from __future__ import annotations

import cv2
import numpy as np

from orthoscope.detection.chessboards.grid import grid_shape
from orthoscope.detection.chessboards.partial_board import filled
from orthoscope.detection.markers.foreseen import are_off
from orthoscope.detection.markers.markers import Markers, find_markers, homography_of, of_one_board, remark_on
from orthoscope.detection.saddles.linked import are_linked
from orthoscope.detection.saddles.refine import refined
from orthoscope.detection.sight import Sight, Unseen
from orthoscope.geometry.arrays import Bool, Float, ndarray
from orthoscope.targets.charuco import Charuco

__all__ = ["see_charuco"]

# Where this share of the board's markers is found no other copy is looked at.
ENOUGH_MARKERS_SHARE = 0.9
# A corner strays from its neighbours' lines by less than this share of a square.
MOST_STRAY_SHARE = 0.1
# These are a square's corners about its middle.
SQUARE_CORNERS = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
# No corner is sought nearer to the picture's rim than this, pixels.
RIM_PX = 2.0
# A sight of the board has at least this many corners.
FEWEST_CORNERS = 4


def see_charuco(grey: ndarray, board: Charuco) -> Sight | Unseen:
    """The corners of a ChArUco board, or of the part of it that can be seen.

    Args:
        grey: (h,w) uint8.
        board: what to look for.
    """
    count = len(board.marker_squares())
    found = find_markers(grey, board.dictionary, int(ENOUGH_MARKERS_SHARE * count))
    markers, legacy, remark = _in_layout(found, board)
    if not len(markers.numbers):
        return Unseen(f"was not found in it: none of the markers of {board.dictionary} was")
    columns, rows = board.grid
    grid = _foreseen(markers, board.marker_corners(legacy=legacy), columns, rows)
    corners, good = _grown(grey, grid, board.arm)
    cells = np.argwhere(good)[:, ::-1]
    good[good] = are_linked(corners[good], cells, cells.astype(float))
    good[good] = ~are_off(corners[good], np.argwhere(good)[:, ::-1].astype(float))
    if good.sum() < FEWEST_CORNERS:
        return Unseen(
            f"was not found in it: {len(markers.numbers)} of its markers were, but no corners between them"
        )
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
    good = np.zeros(grid.shape[:2], dtype=bool)
    tried, sure = good.copy(), good.copy()
    start = grid
    for _ in range(sum(grid.shape[:2])):
        inside = ((start >= RIM_PX) & (start <= np.array(grey.shape[::-1]) - 1 - RIM_PX)).all(-1)
        new = inside & ~tried
        if not new.any():
            break
        tried |= new
        row, column = np.nonzero(good | new)
        places = np.stack([column, row], axis=1).astype(float)
        fine = refined(grey, start[row, column], places, approach=False, arm=arm)
        fits = fine.believed & (grid_shape(fine.pixels, places).stray < MOST_STRAY_SHARE)
        grid, good = np.full_like(grid, np.nan), np.zeros_like(good)
        grid[row[fits], column[fits]] = fine.pixels[fits]
        good[row[fits], column[fits]] = True
        sure[row, column] = fits & fine.sure & fine.whole
        if good.sum() < FEWEST_CORNERS:
            break
        start = filled(grid, rounds=1)
    return grid, good & sure
