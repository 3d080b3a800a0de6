"""Which part of a chessboard a lattice of corners is: its corners' ids, as far as the board determines them.

The lattice is laid out as a grid (rows, columns) whose gaps are filled from their neighbours, and cleared of
corners that are none: where the four squares around are not bright and dark by turns as everywhere else. At
each of its four sides it then either *goes on* (the next line has such corners too: it is taken in), or
*ends* (the
squares beyond the last corners are there, and behind them white paper: this is the board's own side), or
neither
can be seen: the picture stops there, a hand is in the way. A placement of the lattice on the board is a
quarter turn and a shift; it stands if black squares come to lie on black ones, if sides that end are the
board's sides, and if nothing reaches over them. One placement, or several that are the same but for the
board's own symmetry, give the ids; more than one leave them open.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orthoscope.detection.chessboards.clear_lattices import rim_box, without_strays
from orthoscope.detection.chessboards.grid import filled, one_line_more
from orthoscope.detection.chessboards.lattices import CornerLattice
from orthoscope.detection.chessboards.squares import alternating, plain_part
from orthoscope.geometry.arrays import Bool, Float, Int, median, ndarray

__all__ = [
    "Grid",
    "grid_of",
    "is_even",
    "laid_out",
    "placements",
    "without_lost_lines",
]

# A corner has more than this share of the usual strength of one.
LEAST_CONTRAST_SHARE = 0.3
# A line goes on where at least this share of its corners that are in the picture stands out.
GOING_ON_SHARE = 0.6
# The board ends where this share of a line's squares alternates, with white behind them.
BLANK_SQUARES_SHARE = 0.75
# So many lines more are needed for the shape of those.
SHAPING_LINES = 2
# The usual difference of corners' strengths from their median is less than this share of it on a board.
MOST_UNEVENNESS = 0.45
# A line is compared with so many lines before it.
COMPARED_LINES = 4


class Grid(NamedTuple):
    """A lattice as a grid.

    Attributes:
        corners: (rows, columns, 2) pixels, gaps filled.
        seen: (rows, columns) whether a corner was seen there.
        bright: whether the square between +column and +row of the first corner is the bright one.
        ends: whether the board ends at the first row, the last column, the last row, the first column.
    """

    corners: Float[ndarray, "r c 2"]
    seen: Bool[ndarray, "r c"]
    bright: bool
    ends: tuple[bool, bool, bool, bool]


def laid_out(grey: ndarray, found: CornerLattice, most: int) -> Grid | None:
    """The grid of a lattice, cleared, filled and taken as far as it goes; None where nothing is left of it.

    Args:
        grey: (h,w) uint8, the picture in which the lattice was found.
        found: the lattice.
        most: lines that are added at most.
    """
    kept = without_strays(found)
    if kept is None:
        return None
    columns, rows = kept.size
    corners = np.full((rows, columns, 2), np.nan)
    corners[kept.cells[:, 1], kept.cells[:, 0]] = kept.pixels
    first = int(np.abs(kept.cells).sum(1).argmin())
    bright = bool(kept.bright[first]) ^ bool(kept.cells[first].sum() % 2)
    seen = np.isfinite(corners[..., 0])
    seen &= _stands(grey, filled(corners), bright)
    corners[~seen] = np.nan
    boxed = _boxed(corners, bright)
    if boxed is None:
        return None
    corners, bright = boxed
    grid = filled(corners)
    seen = np.isfinite(corners[..., 0]) | _stands(grey, grid, bright)
    part = plain_part(grey, grid, seen, bright)
    if part is None:
        return None
    if part != tuple(slice(0, count) for count in seen.shape):  # what foresaw its gaps may be gone
        bright ^= bool((part[0].start + part[1].start) % 2)
        boxed = _boxed(np.where(seen[..., None], grid, np.nan)[part], bright)
        if boxed is None:
            return None
        corners, bright = boxed
        grid, seen = filled(corners), np.isfinite(corners[..., 0])
    return _taken_further(grey, grid, seen, bright, most)


def _boxed(
    corners: Float[ndarray, "r c 2"], bright: bool
) -> tuple[Float[ndarray, "rows columns 2"], bool] | None:
    """The rows and columns with corners, and whether their first square is the bright one; None without."""
    box = rim_box(np.isfinite(corners[..., 0]))
    return (corners[box], bright ^ bool((box[0].start + box[1].start) % 2)) if box else None


def placements(grid: Grid, columns: int, rows: int, *, negative: bool = False) -> list[Int[ndarray, "r c"]]:
    """Ids (rows, columns) of the grid's corners, seen or not, for each way it can lie on a board.

    Args:
        grid: the lattice.
        columns: inner corners of the board.
        rows: likewise.
        negative: whether to take white for black.
    """
    as_said, inverted = [], []
    for quarters in range(4):
        seen = np.rot90(grid.seen, quarters)
        height, width = seen.shape
        if width > columns or height > rows:
            continue
        top, right, bottom, left = np.roll(grid.ends, -quarters)
        # the first corner of the turned grid, and whether bright lies between its own +column and +row
        sum_of_first = np.rot90(np.add.outer(*(np.arange(side) for side in grid.seen.shape)), quarters)[0, 0]
        bright = grid.bright ^ bool(sum_of_first % 2) ^ bool(quarters % 2)
        for row in range(rows - height + 1):
            for column in range(columns - width + 1):
                dark = (row + column) % 2 == 0  # between +column and +row of such corners
                if (top and row) or (left and column):
                    continue
                if (bottom and row + height < rows) or (right and column + width < columns):
                    continue
                ids = np.add.outer((np.arange(height) + row) * columns, np.arange(width) + column)
                (inverted if dark == bright else as_said).append(np.rot90(ids, -quarters))
    if negative:
        return inverted
    if (columns + rows) % 2 or (columns == rows and columns % 2):  # white for black is the board turned
        return as_said
    whole = grid.seen.size == columns * rows
    return (as_said or inverted) if whole else [*as_said, *inverted]


def grid_of(grey: ndarray, corners: Float[ndarray, "r c 2"], most: int) -> Grid:
    """The grid of corners that some finder returned, taken as far as it goes."""
    bright = bool(alternating(grey, corners).sum() > 0)
    return _taken_further(grey, corners, np.ones(corners.shape[:2], dtype=bool), bright, most)


def without_lost_lines(
    grey: ndarray, grid: Grid, corners: Float[ndarray, "r c 2"], seen: Bool[ndarray, "r c"], most: int
) -> Grid | None:
    """The grid of the lines of which corners are left, where there are fewer than it had; None otherwise.

    Args:
        grey: (h,w) uint8.
        grid: as it was.
        corners: its corners now.
        seen: which of them are left.
        most: lines that are added at most.
    """
    box = rim_box(seen)
    if box is None or seen[box].shape == seen.shape:
        return None
    known = np.where(seen[..., None], corners, np.nan)[box]
    bright = grid.bright ^ bool((box[0].start + box[1].start) % 2)
    return _taken_further(grey, filled(known), seen[box], bright, most)


def _stands(grey: ndarray, grid: ndarray, bright: bool) -> Bool[ndarray, "r c"]:
    """Where the squares around a corner are bright and dark as they must be there, with contrast enough."""
    strength = alternating(grey, grid) * (1.0 if bright else -1.0)
    usual = median(strength[strength > 0]) if (strength > 0).any() else np.inf
    return strength > LEAST_CONTRAST_SHARE * usual


def _taken_further(grey: ndarray, grid: ndarray, seen: ndarray, bright: bool, most: int) -> Grid:
    """The grid with the lines beyond its sides, as long as they go on; and which of its sides end."""
    ends = []
    for _ in range(4):  # the last row in turn, by turning the grid
        for _ in range(most):
            if len(grid) < 2:
                break
            more = (
                one_line_more(grid) if len(grid) > 2 else np.concatenate([grid, 2 * grid[-1:] - grid[-2:-1]])
            )
            stands = _next_line_stands(grey, more, bright)
            if not stands.any() or stands.sum() < GOING_ON_SHARE * _in_picture(grey, more[-1]).sum():
                break
            grid, seen = more, np.concatenate([seen, stands[None]])
        ends.append(_ends(grey, grid))
        grid, seen = np.rot90(grid), np.rot90(seen)  # what was the last column is now the first row
        bright = bright ^ bool((grid.shape[0] - 1) % 2) ^ True
    # np.rot90 brings the right side to the top, so the last row in turn was: bottom, left, top, right
    bottom, left, top, right = ends
    return Grid(grid, seen, bright, (top, right, bottom, left))


def is_even(grey: ndarray, grid: Grid) -> bool:
    """Whether a grid's corners are about as strong as each other; those of texture are not."""
    strength = alternating(grey, grid.corners)[grid.seen] * (1.0 if grid.bright else -1.0)
    usual = median(strength) if len(strength) else 0.0
    return usual > 0 and median(np.abs(strength - usual)) < MOST_UNEVENNESS * usual


def _next_line_stands(grey: ndarray, more: ndarray, bright: bool) -> ndarray:
    """Which corners of the last row are the board's, as those of the rows before it are."""
    first = max(0, len(more) - 1 - COMPARED_LINES - SHAPING_LINES) // 2 * 2  # even, for the signs
    strength = alternating(grey, more[first:])[-1 - COMPARED_LINES :] * (1.0 if bright else -1.0)
    before = strength[:-1]
    usual = median(before[before > 0]) if (before > 0).any() else np.inf
    return strength[-1] > 0.5 * usual


def _ends(grey: ndarray, grid: ndarray) -> bool:
    """Whether the board ends behind the last row: one more row of squares, then white paper."""
    if len(grid) < 2:
        return False
    last, step = grid[-1], grid[-1] - grid[-2]
    middle, out = 0.5 * (last[1:] + last[:-1]), 0.5 * (step[1:] + step[:-1])
    places = np.stack([middle + share * out for share in (-0.5, 0.5, 0.75, 1.3)])  # (4, columns - 1, 2)
    inside = _in_picture(grey, places).all(0)
    if inside.sum() < max(2, 0.5 * len(middle)):
        return False
    x, y = np.clip(np.rint(places).astype(int), 0, np.array(grey.shape[::-1]) - 1)[:, inside].transpose(
        2, 0, 1
    )
    before, near, far, beyond = grey[y, x].astype(float)
    level = 0.5 * (before + near)  # one of the two squares is bright, the other dark
    contrast = 0.25 * np.abs(near - before)
    dark = near < before
    same = np.abs(far - near) < 2.0 * contrast
    alternates = np.abs(near - before) > 0.5 * median(np.abs(near - before))
    paper = beyond > level  # behind the bright ones too: where the board goes on, there are dark squares
    if dark.all() or not dark.any():
        return False
    ends = min((same & alternates).mean(), paper[dark].mean(), paper[~dark].mean())
    return bool(ends >= BLANK_SQUARES_SHARE)


def _in_picture(grey: ndarray, places: ndarray) -> ndarray:
    return np.all((places >= 0) & (places <= np.array(grey.shape[::-1]) - 1), axis=-1)
