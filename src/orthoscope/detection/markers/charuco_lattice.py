"""A ChArUco board found as the chessboard that it is, and its ids by all its markers together."""

from __future__ import annotations

from functools import cache

import numpy as np

from orthoscope.detection.chessboards.lattices import CornerLattice, lattices
from orthoscope.detection.chessboards.partial_board import filled, without_strays
from orthoscope.detection.markers.joint_reading import Way, drawings_of, likeliest_way, seen_squares
from orthoscope.detection.saddles.saddle_points import saddle_points
from orthoscope.detection.sight import TWICE
from orthoscope.detection.small_copies import enlarged, resized, to_photograph
from orthoscope.geometry.arrays import Float, Int, ndarray
from orthoscope.targets.charuco import Charuco
from orthoscope.targets.markers import dictionary, modules_of

__all__ = ["charuco_grid"]

# Copies have these longer sides, pixels; most boards are found in the first.
COPY_SIDES = (640, 320, 1280, 2560)
# Pictures with a longer side of up to this, pixels, are enlarged at last: in squares of ten pixels the circle
# about a corner reaches into the markers else.
LARGEST_ENLARGED = 1400
# A smaller copy shows no board.
LEAST_SIDE = 16
# So many lattices of each copy are looked at.
LATTICES_PER_COPY = 2
# A lattice has at least so many corners.
FEWEST_CORNERS = 6
# And at least this share of those of the largest.
SECOND_SHARE = 0.2
# Where this share of the board's corners is in a lattice no further copy is looked at.
ENOUGH_CORNERS_SHARE = 0.5


def charuco_grid(grey: ndarray, board: Charuco) -> tuple[Float[ndarray, "r c 2"] | None, str]:
    """The board's inner corners, NaN where they are not seen; a remark where another is such a board.

    Args:
        grey: (h,w) uint8.
        board: what to look for.
    """
    best, remark = None, ""
    shapes = set()
    for side in (*COPY_SIDES, 0):
        if not side and max(grey.shape) > LARGEST_ENLARGED:
            break
        copy = resized(grey, side) if side else enlarged(grey)
        if copy.shape in shapes or min(copy.shape) < LEAST_SIDE:
            continue
        shapes.add(copy.shape)
        hanging = lattices(saddle_points(copy))[:LATTICES_PER_COPY]
        least = max([FEWEST_CORNERS, *(SECOND_SHARE * len(one.pixels) for one in hanging[:1])])
        placed = (_placed(grey, one, copy, board) for one in hanging if len(one.pixels) >= least)
        found = sorted((one for one in placed if one is not None), key=_corner_count, reverse=True)
        if found and (best is None or _corner_count(found[0]) > _corner_count(best)):
            best, remark = _together(found)
        if best is not None and _corner_count(best) >= ENOUGH_CORNERS_SHARE * np.prod(board.grid):
            break
    return best, remark


def _together(found: list[Float[ndarray, "r c 2"]]) -> tuple[Float[ndarray, "r c 2"], str]:
    """The largest of several grids with those that are other parts of the same board; a remark where one is
    another such board.
    """
    best, remark = found[0], ""
    for other in found[1:]:
        if np.isfinite(best + other).any():
            remark = TWICE
        else:
            best = np.where(np.isfinite(best), best, other)
    return best, remark


def _corner_count(grid: Float[ndarray, "r c 2"]) -> int:
    return int(np.isfinite(grid[..., 0]).sum())


def _placed(
    grey: ndarray, lattice: CornerLattice, copy: ndarray, board: Charuco
) -> Float[ndarray, "r c 2"] | None:
    """The board's inner corners as far as a copy's lattice has them; None where it is not the board's."""
    kept = without_strays(lattice._replace(pixels=to_photograph(lattice.pixels, copy, grey)))
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
    return None if way is None else _on_board(seen[1:-1, 1:-1], way, board)


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
