"""Finding OpenCV's grid of markers: each marker that is read gives its four corners."""

from __future__ import annotations

import numpy as np

from orthoscope.detection.markers.foreseen import are_off
from orthoscope.detection.markers.marker_fit import fit_markers
from orthoscope.detection.markers.markers import Markers, find_markers, of_one_board, remark_on
from orthoscope.detection.sight import Sight, Unseen
from orthoscope.geometry.arrays import ndarray
from orthoscope.targets.grid_board import GridBoard
from orthoscope.targets.markers import marker_modules, modules_of

__all__ = ["see_grid_board"]

# With this share of a board's markers no further copy is looked at.
ENOUGH_SHARE = 0.9
# A marker's corner is at most this share of its side from where OpenCV sees it.
FARTHEST_SHARE = 0.15


def see_grid_board(grey: ndarray, board: GridBoard) -> Sight | Unseen:
    """The corners of the markers that can be read.

    Args:
        grey: (h,w) uint8.
        board: what to look for.
    """
    plane = board.marker_corners()
    found = find_markers(grey, board.dictionary, int(ENOUGH_SHARE * len(plane)))
    numbers = found.numbers - board.first
    known = (numbers >= 0) & (numbers < len(plane))
    markers = Markers(numbers[known], found.corners[known])
    mine = of_one_board(markers, plane[markers.numbers])
    numbers, first = np.unique(markers.numbers[mine], return_index=True)
    rough = markers.corners[mine][first]
    if len(numbers) < min(2, len(plane)):
        return Unseen(f"was not found in it: {len(numbers)} of its {len(plane)} markers were")
    module = board.marker / modules_of(board.dictionary)
    drawings = [marker_modules(board.dictionary, board.first + number) for number in numbers.tolist()]
    fine, good = fit_markers(grey, rough, drawings, gap=board.gap / module)
    sides = np.linalg.norm(rough - np.roll(rough, 1, axis=1), axis=-1).min(1)
    good &= np.linalg.norm(fine - rough, axis=-1) < np.maximum(FARTHEST_SHARE * sides, 1.5)[:, None]
    if not good.any():
        return Unseen(f"was not found in it: its {len(numbers)} markers have no sharp sides")
    ids = 4 * numbers[:, None] + np.arange(4)
    covered = np.broadcast_to(~good.all(1, keepdims=True), good.shape)  # in part: another corner is not sure
    places = board.points()[ids[good], :2]
    good[good] = ~are_off(fine[good], places, grey.shape, doubtful=covered[good])
    return Sight(ids[good], fine[good], remark_on(markers, mine))
