"""A ChArUco board found as the chessboard that it is, and its ids by all its markers together."""

from __future__ import annotations

from functools import cache, partial

import numpy as np

from orthoscope.detection.chessboards.clear_lattices import without_strays, without_thin_lines
from orthoscope.detection.chessboards.grid import filled
from orthoscope.detection.chessboards.lattices import CornerLattice
from orthoscope.detection.markers.board_lattices import corners_by_lattice
from orthoscope.detection.markers.joint_reading import Way, drawings_of, likeliest_way, seen_squares
from orthoscope.geometry.arrays import Float, Int, ndarray
from orthoscope.targets.charuco import Charuco
from orthoscope.targets.markers import dictionary, modules_of

__all__ = ["charuco_corners"]


def charuco_corners(grey: ndarray, board: Charuco) -> tuple[Float[ndarray, "m 2"] | None, str]:
    """The board's corners by their ids, NaN where they are not seen; a remark where another is such a board.

    Args:
        grey: (h,w) uint8.
        board: what to look for.
    """
    return corners_by_lattice(grey, partial(_placed, grey, board))


def _placed(grey: ndarray, board: Charuco, lattice: CornerLattice) -> Float[ndarray, "m 2"] | None:
    """The board's corners as far as a lattice has them; None where it is not the board's."""
    kept = without_strays(lattice)
    kept = kept and without_thin_lines(kept)  # one beyond the board makes one layout of the other
    if kept is None:
        return None
    columns, rows = kept.size
    seen = np.full((rows + 2, columns + 2, 2), np.nan)
    column, row = kept.cells.T + 1  # a line more on each side: the squares beyond the outer corners
    seen[row, column] = kept.pixels
    full = filled(seen)
    quads = np.stack([full[:-1, :-1], full[:-1, 1:], full[1:, 1:], full[1:, :-1]], axis=2)
    bright = np.add.outer(np.arange(rows + 1), np.arange(columns + 1)) % 2 == (row[0] + column[0]) % 2
    bright ^= not kept.bright[0]
    rim = board.arm + (1.0 - 2.0 * board.arm) / modules_of(board.dictionary)
    squares = seen_squares(grey, quads, int(dictionary(board.dictionary).markerSize), rim)
    way = likeliest_way(squares, ((1, bright), (-1, ~bright)), _layouts(board), drawings_of(*board.markers))
    return None if way is None else _on_board(seen[1:-1, 1:-1], way, board).reshape(-1, 2)


def _on_board(seen: Float[ndarray, "r c 2"], way: Way, board: Charuco) -> Float[ndarray, "a b 2"]:
    """The corners of a lattice laid on the board, where the markers around them agree with it."""
    agree = way.agrees[:-1, :-1] & way.agrees[1:, 1:]
    turned = np.rot90(np.where(agree[..., None], seen, np.nan), way.turns)
    columns, rows = board.grid
    grid = np.full((rows, columns, 2), np.nan)
    row, column = way.row + np.arange(turned.shape[0]), way.column + np.arange(turned.shape[1])
    rows_on, columns_on = (row >= 0) & (row < rows), (column >= 0) & (column < columns)
    grid[np.ix_(row[rows_on], column[columns_on])] = turned[np.ix_(rows_on, columns_on)]
    return grid


@cache
def _layouts(board: Charuco) -> tuple[Int[ndarray, "a b"], ...]:
    """Which marker is in each square, in the board's layout and, where it is another, in the other one."""
    layouts = []
    for legacy in (board.legacy, not board.legacy):
        numbers = np.full((board.rows, board.columns), -1)
        column, row = board.marker_squares(legacy=legacy).T
        numbers[row, column] = np.arange(len(row))
        layouts.append(numbers)
    return tuple(layouts[: 1 if (layouts[0] == layouts[1]).all() else 2])
