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

from orthoscope.detection.chessboards.grid import grid_shape, one_line_more
from orthoscope.detection.chessboards.lattices import CornerLattice
from orthoscope.detection.chessboards.squares import alternating, plain_part
from orthoscope.geometry.arrays import Bool, Float, Int, median, ndarray

__all__ = [
    "Grid",
    "filled",
    "grid_of",
    "is_even",
    "laid_out",
    "on_lines",
    "placements",
    "without_lost_lines",
    "without_strays",
    "without_thin_lines",
]

# A corner strays from the parabolas of its row and column by at most this share of a step.
FARTHEST_STRAY_SHARE = 0.3
# Strays are taken out at most so many times, those nearly as far off as the worst together.
CLEARING_ROUNDS = 12
# Beyond this share of the worst stray a corner is nearly as far off.
NEARLY_WORST_SHARE = 0.8
# At least this share of the corners is left when strays are taken out; with fewer it was a lattice by chance.
LEAST_LEFT_SHARE = 0.5
# A corner has more than this share of the usual strength of one.
LEAST_CONTRAST_SHARE = 0.3
# A line goes on where at least this share of its corners that are in the picture stands out.
GOING_ON_SHARE = 0.6
# The board ends where this share of a line's squares alternates, with white behind them.
BLANK_SQUARES_SHARE = 0.75
# A line at the rim with fewer than three corners, and less than this share of the next line's, is chance.
THIN_LINE_SHARE = 0.34
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
    box = _box(np.isfinite(corners[..., 0]))
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
    box = _box(seen)
    if box is None or seen[box].shape == seen.shape:
        return None
    known = np.where(seen[..., None], corners, np.nan)[box]
    bright = grid.bright ^ bool((box[0].start + box[1].start) % 2)
    return _taken_further(grey, filled(known), seen[box], bright, most)


def filled(grid: Float[ndarray, "r c 2"], *, rounds: int = 1000) -> Float[ndarray, "r c 2"]:
    """The grid with its gaps filled: each from those of its neighbours whose lines foresee it, near ones
    first.
    """
    grid = grid.copy()
    for _ in range(rounds):
        if not np.isnan(grid[..., 0]).any():
            break
        told = _foreseen(grid)
        known = np.isfinite(told[..., 0])
        count = known.sum(0)
        new = np.isnan(grid[..., 0]) & (count > 0)
        if not new.any():
            return np.where(np.isnan(grid), -1e4, grid)  # far outside: nothing foresees it
        total = np.where(known[..., None], told, 0.0).sum(0)
        grid[new] = (total / np.maximum(count, 1)[..., None])[new]
    return grid


def _foreseen(grid: Float[ndarray, "r c 2"]) -> Float[ndarray, "12 r c 2"]:
    """Each place from the two before it on its line, the two beside it, and three of a parallelogram, from
    all four sides.
    """
    rows, columns = grid.shape[:2]
    around = np.full((rows + 4, columns + 4, 2), np.nan)
    around[2:-2, 2:-2] = grid

    def at(down: int, along: int) -> ndarray:
        return around[2 + down : 2 + down + rows, 2 + along : 2 + along + columns]

    told = np.empty((12, *grid.shape))
    for i, (down, along) in enumerate(((0, -1), (1, 0), (0, 1), (-1, 0))):
        beside = (along, -down)
        told[i] = 2.0 * at(down, along) - at(2 * down, 2 * along)
        told[4 + i] = at(down, along) + at(*beside) - at(down + beside[0], along + beside[1])
        told[8 + i] = 0.5 * (at(down, along) + at(-down, -along))
    return told


def without_strays(found: CornerLattice) -> CornerLattice | None:
    """The lattice without corners that are off their neighbours' lines; None where hardly any is left."""
    keep = on_lines(found.pixels, found.cells.astype(float))
    if keep is None:
        return None
    cells = found.cells[keep]
    return CornerLattice(found.pixels[keep], cells - cells.min(0), found.bright[keep])


def without_thin_lines(found: CornerLattice) -> CornerLattice | None:
    """The lattice without lines at its rim that have hardly a corner, and may be chance; None where nothing
    is left.
    """
    seen = np.zeros(found.size[::-1], dtype=bool)
    seen[found.cells[:, 1], found.cells[:, 0]] = True
    box = _box(seen)
    if box is None:
        return None
    low, high = (np.array([getattr(part, end) for part in box[::-1]]) for end in ("start", "stop"))
    keep = ((found.cells >= low) & (found.cells < high)).all(1)
    return CornerLattice(found.pixels[keep], found.cells[keep] - low, found.bright[keep])


def on_lines(pixels: Float[ndarray, "m 2"], places: Float[ndarray, "m 2"]) -> Bool[ndarray, " m"] | None:
    """Which corners of a lattice are on their neighbours' lines, the worst taken out first; None where hardly
    any is.

    Args:
        pixels: the corners.
        places: column and row of each in the lattice, in steps.
    """
    keep = np.arange(len(pixels))
    for _ in range(CLEARING_ROUNDS):
        if len(keep) < max(4, LEAST_LEFT_SHARE * len(pixels)):
            return None
        stray = grid_shape(pixels[keep], places[keep]).stray
        if stray.max() <= FARTHEST_STRAY_SHARE:
            break
        keep = keep[stray <= max(FARTHEST_STRAY_SHARE, NEARLY_WORST_SHARE * stray.max())]
    return np.isin(np.arange(len(pixels)), keep)


def _stands(grey: ndarray, grid: ndarray, bright: bool) -> Bool[ndarray, "r c"]:
    """Where the squares around a corner are bright and dark as they must be there, with contrast enough."""
    strength = alternating(grey, grid) * (1.0 if bright else -1.0)
    usual = median(strength[strength > 0]) if (strength > 0).any() else np.inf
    return strength > LEAST_CONTRAST_SHARE * usual


def _box(seen: Bool[ndarray, "r c"]) -> tuple[slice, slice] | None:
    """Rows and columns with corners, thin lines at the rim left out."""
    top, bottom, left, right = 0, seen.shape[0], 0, seen.shape[1]
    while bottom - top >= 2 and right - left >= 2:
        part = seen[top:bottom, left:right]
        lines = [
            (part[0], part[1]),
            (part[-1], part[-2]),
            (part[:, 0], part[:, 1]),
            (part[:, -1], part[:, -2]),
        ]
        thin = [
            line.sum() == 0 or (line.sum() < 3 and line.sum() < THIN_LINE_SHARE * next_.sum())
            for line, next_ in lines
        ]
        if not any(thin):
            return slice(top, bottom), slice(left, right)
        top, bottom, left, right = top + thin[0], bottom - thin[1], left + thin[2], right - thin[3]
    return None


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
