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

from orthoscope.detection.markers.charuco_lattice import charuco_corners
from orthoscope.detection.markers.growth import CornersOfBoard, grown_from, grown_with, sight_of
from orthoscope.detection.markers.markers import Markers, find_markers, homography_of, of_one_board, remark_on
from orthoscope.detection.sight import Sight, Unseen
from orthoscope.geometry.arrays import Float, ndarray
from orthoscope.targets.charuco import Charuco

__all__ = ["see_charuco"]

# Where this share of the board's markers is found no other copy is looked at; any, where it is seen already.
ENOUGH_MARKERS_SHARE = 0.9
# These are a square's corners about its middle.
SQUARE_CORNERS = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])


def see_charuco(grey: ndarray, board: Charuco) -> Sight | Unseen:
    """The corners of a ChArUco board, or of the part of it that can be seen.

    Args:
        grey: (h,w) uint8.
        board: what to look for.
    """
    together, twice = charuco_corners(grey, board)
    corners = CornersOfBoard(board.places(), board.places().astype(int), board.arm, 1.0)
    seen = None if together is None else grown_from(grey, together, corners)
    if seen and seen.is_complete and (sight := sight_of(seen, corners, grey.shape, twice)):
        return sight
    enough = 1 if seen else int(ENOUGH_MARKERS_SHARE * len(board.marker_squares()))
    markers, legacy, remark = _in_layout(find_markers(grey, board.dictionary, enough), board)
    if not seen and not len(markers.numbers):
        return Unseen(f"was not found in it: none of the markers of {board.dictionary} was")
    alone = _foreseen(markers, board.marker_corners(legacy=legacy), *board.grid)
    more = grown_with(grey, seen, alone, corners)
    sight = sight_of(more, corners, grey.shape, twice or remark)
    return sight or Unseen("is in it, but too blurred, dim or small to say where its corners are")


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
) -> Float[ndarray, "m 2"]:
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
    return np.where(count > 0, total / np.maximum(count, 1), np.nan).reshape(-1, 2)
