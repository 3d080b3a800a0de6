"""An AprilGrid found by the saddles at its tags' corners, and its ids by all its tags together.

Along a row of these saddles steps are a tag and a gap by turns, and colours alternate as on a chessboard. So
they hang together as one lattice, of which every other square each way is a tag: the larger ones.
"""

from __future__ import annotations

from functools import cache, partial

import numpy as np

from orthoscope.detection.chessboards.clear_lattices import on_lines
from orthoscope.detection.chessboards.lattices import CornerLattice
from orthoscope.detection.markers.board_lattices import corners_by_lattice
from orthoscope.detection.markers.foreseen import next_corners
from orthoscope.detection.markers.joint_reading import (
    Drawings,
    Way,
    drawings_of,
    likeliest_way,
    seen_squares,
)
from orthoscope.geometry.arrays import Float, Int, median, ndarray
from orthoscope.targets.aprilgrid import BORDER_SQUARES, DICTIONARY, TAG_SQUARES, AprilGrid
from orthoscope.targets.markers import dictionary

__all__ = ["aprilgrid_corners"]

# Quarter turns from OpenCV's drawing of a tag to how the board has it, likely ones first: Kalibr's, OpenCV's.
WAYS_UP = (2, 0, 1, 3)
# A tag is at least so many times as long as a gap, or the two are not told apart.
LEAST_TAG_GAPS = 1.3
# A tag is at most so many times as long as the next gap on its line as it is on the board, by what tilt does.
TILTED = 2.0


def aprilgrid_corners(grey: ndarray, board: AprilGrid) -> tuple[Float[ndarray, "m 2"] | None, str]:
    """The board's corners by their ids, NaN where they are not seen; a remark where another is such a board.

    Args:
        grey: (h,w) uint8.
        board: what to look for.
    """
    return corners_by_lattice(grey, partial(_placed, grey, board), longest_step=TILTED / board.spacing)


def _placed(grey: ndarray, board: AprilGrid, lattice: CornerLattice) -> Float[ndarray, "m 2"] | None:
    """The board's corners as far as a lattice has them; None where it is not the board's."""
    odd = [_tags_begin_at_odd(lattice, axis) for axis in (0, 1)]
    if odd[0] is None or odd[1] is None:
        return None
    cells = lattice.cells + np.array(odd, dtype=int)  # tags begin at even ones now
    keep = on_lines(lattice.pixels, _places(cells, board))
    if keep is None:
        return None
    columns, rows = 2 * (cells[keep].max(0) // 2 + 1)
    seen = np.full((rows, columns, 2), np.nan)
    seen[cells[keep, 1], cells[keep, 0]] = lattice.pixels[keep]
    full, known = seen.reshape(-1, 2).copy(), np.flatnonzero(np.isfinite(seen[..., 0]))
    all_cells = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2)
    more, there = next_corners(_places(all_cells, board), known, full[known], 1.1 / board.spacing)
    full[more] = there
    grid = full.reshape(rows, columns, 2)
    quads = np.stack([grid[::2, ::2], grid[::2, 1::2], grid[1::2, 1::2], grid[1::2, ::2]], axis=2)
    squares = seen_squares(grey, quads, int(dictionary(DICTIONARY).markerSize), BORDER_SQUARES / TAG_SQUARES)
    is_bright = bool(lattice.bright[0]) ^ bool(cells[0].sum() % 2)
    may_hold = ((-1 if is_bright else 1, np.ones(squares.inside.shape, dtype=bool)),)
    for way_up in WAYS_UP:
        way = likeliest_way(squares, may_hold, (_numbers(board),), _drawings(board.markers[1], way_up))
        if way is not None:
            return _on_board(seen, way, board)
    return None


def _places(cells: Int[ndarray, "m 2"], board: AprilGrid) -> Float[ndarray, "m 2"]:
    """Where corners of a lattice are, in gaps, if tags begin at even ones."""
    pair, end = np.divmod(cells, 2)
    return pair * (1.0 + 1.0 / board.spacing) + end / board.spacing


def _tags_begin_at_odd(lattice: CornerLattice, axis: int) -> bool | None:
    """Whether tags are the steps from odd corners of a line to even ones; None where that is not seen."""
    grid = np.full((*lattice.size[::-1], 2), np.nan)
    grid[lattice.cells[:, 1], lattice.cells[:, 0]] = lattice.pixels
    steps = np.linalg.norm(np.diff(grid, axis=1 - axis), axis=-1)
    steps = steps.T if axis else steps
    even, odd = (part[np.isfinite(part)] for part in (steps[:, ::2], steps[:, 1::2]))
    if not len(even) or not len(odd):
        return None
    ratio = median(odd) / median(even)
    return None if 1.0 / LEAST_TAG_GAPS < ratio < LEAST_TAG_GAPS else bool(ratio > 1.0)


def _on_board(seen: Float[ndarray, "r c 2"], way: Way, board: AprilGrid) -> Float[ndarray, "m 2"]:
    """The corners of a lattice laid on the board, where the tags around them agree with it."""
    agree = way.agrees.repeat(2, axis=0).repeat(2, axis=1)
    turned = np.rot90(np.where(agree[..., None], seen, np.nan), way.turns)
    columns, rows = board.grid
    grid = np.full((rows, columns, 2), np.nan)
    row, column = 2 * way.row + np.arange(turned.shape[0]), 2 * way.column + np.arange(turned.shape[1])
    rows_on, columns_on = (row >= 0) & (row < rows), (column >= 0) & (column < columns)
    grid[np.ix_(row[rows_on], column[columns_on])] = turned[np.ix_(rows_on, columns_on)]
    return grid[::-1].reshape(-1, 2)  # ids go upwards


def _numbers(board: AprilGrid) -> Int[ndarray, "a b"]:
    """Which tag is where, row by row from the top."""
    return np.arange(board.columns * board.rows).reshape(board.rows, board.columns)[::-1]


@cache
def _drawings(numbers: range, way_up: int) -> Drawings:
    """How the tags are drawn, turned by quarters."""
    plain = drawings_of(DICTIONARY, numbers, BORDER_SQUARES)
    bits = int(dictionary(DICTIONARY).markerSize)
    turned = np.rot90(plain.drawn.reshape(-1, bits, bits), way_up, axes=(1, 2))
    return plain._replace(drawn=turned.reshape(len(turned), -1))
