"""Finding one chessboard in one grey photograph: OpenCV's finders on a ladder of copies, and a look at
whether it is the board.

A board that fills a 12-megapixel photograph is found in a small copy of it in milliseconds, where the full
size takes OpenCV a second; a small or dim board needs a larger copy, more contrast, or the slower finder.
Whichever rung finds it, the corners are then refined in the photograph itself, so the rung does not matter to
them.

What a finder returns is believed where it is a grid (no corner strays from its neighbours' lines) whose
squares are bright and dark by turns, and where it ends: OpenCV finds 8x6 corners in a board of 9x6 without a
word. For this each corner is looked at through the four squares around it: two and two they are bright and
dark, the other way round at its neighbours, and not at all beyond the last line.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

import cv2
import numpy as np

from orthoscope.detection.grid import cross, grid_shape, one_line_more
from orthoscope.detection.refine import refined
from orthoscope.geometry.arrays import Float, InputError, ndarray

__all__ = ["board_size", "find_chessboard"]

Finder = Callable[[ndarray, tuple[int, int]], ndarray | None]
SMALLEST = 15  # px: OpenCV's finders stumble over pictures that are smaller
FARTHEST_STRAY = 0.25  # of a square, from the parabolas of a corner's row and column
LEAST_ALTERNATING = 0.8  # of the corners: glare and shadow hide some
MOST_CONTRARY = 0.05  # of the corners
LINE_GOES_ON = 0.75  # of the corners of a line
LINES_BEFORE = 4  # which a line is compared with


def find_chessboard(grey: ndarray, columns: int, rows: int) -> Float[ndarray, "m 2"] | None:
    """The inner corners (columns * rows, 2) of a board, pixels, row by row; None where there is no such
    board.

    grey: (h,w) uint8. Rows and columns lie as x and y do, seen from the front. Corner 0 is the one with a
    dark square beyond it, where the board has such at one end only (9x6); of ends that look alike the one
    nearer to the picture's top left. Raises InputError for fewer than 3 corners either way, which no finder
    looks for.
    """
    if min(columns, rows) < 3:
        raise InputError(
            f"a board of {columns}x{rows} inner corners cannot be found in photographs; expected at least"
            " 3x3."
        )
    for corners in _boards(grey, columns, rows, LADDER):
        whole = _whole_size(grey, corners, columns, rows) == (columns, rows)
        return _from_first_corner(grey, corners, columns, rows) if whole else None
    return None


def board_size(grey: ndarray, guesses: Iterable[tuple[int, int]]) -> tuple[int, int] | None:
    """The columns and rows of the board that is in a photograph, whole, where one of the guesses is it or a
    part of it; else None.
    """
    for columns, rows in guesses:
        for corners in _boards(grey, columns, rows, LADDER[:1]):
            return _whole_size(grey, corners, columns, rows)
    return None


def _boards(
    grey: ndarray, columns: int, rows: int, ladder: Iterable[Rung]
) -> Iterator[Float[ndarray, "m 2"]]:
    """Refined corners of what the rungs find, as far as it is a board."""
    for rough in _sightings(grey, columns, rows, ladder):
        if _is_grid(grey, rough, columns, rows):
            corners = refined(grey, rough, columns, rows)
            if _is_grid(grey, corners, columns, rows) and _alternates(grey, corners, columns, rows):
                yield corners


def _sightings(
    grey: ndarray, columns: int, rows: int, ladder: Iterable[Rung]
) -> Iterator[Float[ndarray, "m 2"]]:
    """What the rungs find, to a pixel or two, in the photograph's pixels."""
    tried: set[tuple[Finder, tuple[int, ...]]] = set()
    for rung in ladder:
        copy = _resized(grey, rung.side)
        if (rung.find, copy.shape) in tried or min(copy.shape) < SMALLEST:
            continue
        tried.add((rung.find, copy.shape))
        found = rung.find(copy, (columns, rows))
        if found is not None:
            scale = np.array(grey.shape[::-1]) / np.array(copy.shape[::-1])
            yield (found.reshape(-1, 2).astype(float) + 0.5) * scale - 0.5


def _classic(grey: ndarray, size: tuple[int, int]) -> ndarray | None:
    """Quadrangles that touch at their corners (V. Vezhnevets)."""
    found, corners = cv2.findChessboardCorners(grey, size)
    return corners if found else None


def _contrasted(grey: ndarray, size: tuple[int, int]) -> ndarray | None:
    """The same after evening out the light."""
    return _classic(cv2.createCLAHE(3.0, (8, 8)).apply(grey), size)


def _sector_based(grey: ndarray, size: tuple[int, int]) -> ndarray | None:
    """Saddle points by their sectors (A. Duda and U. Frese, BMVC 2018): slower, and finds what the classic
    one misses.
    """
    found, corners = cv2.findChessboardCornersSB(grey, size)
    return corners if found else None


class Rung(NamedTuple):
    """A finder, and the longer side of the copy it looks at, pixels (0: the photograph itself)."""

    find: Finder
    side: int


LADDER = (
    Rung(_classic, 640),
    Rung(_sector_based, 640),
    Rung(_sector_based, 1280),
    Rung(_classic, 1280),
    Rung(_contrasted, 1280),
    Rung(_classic, 0),
    Rung(_sector_based, 2560),
)


def _resized(grey: ndarray, side: int) -> ndarray:
    """A copy whose longer side is `side`; the photograph itself where it is no larger. By halves first: five
    times as quick.
    """
    longer = max(grey.shape)
    if not 0 < side < longer:
        return grey
    if longer >= 2 * side and min(grey.shape) >= 2:
        height, width = (length // 2 for length in grey.shape)
        half = cv2.resize(grey[: 2 * height, : 2 * width], (width, height), interpolation=cv2.INTER_AREA)
        return _resized(half, side)
    height, width = (max(1, round(length * side / longer)) for length in grey.shape)
    return cv2.resize(grey, (width, height), interpolation=cv2.INTER_AREA)


def _is_grid(grey: ndarray, corners: ndarray, columns: int, rows: int) -> bool:
    """Whether corners lie in the picture, without folds, each on its neighbours' lines."""
    shape = grid_shape(corners, columns, rows)
    turn = cross(shape.along, shape.down)
    inside = ((corners >= 0) & (corners <= np.array(grey.shape[::-1]) - 1)).all()
    return bool(inside and ((turn > 0).all() or (turn < 0).all()) and shape.stray.max() <= FARTHEST_STRAY)


def _alternates(grey: ndarray, corners: ndarray, columns: int, rows: int) -> bool:
    """Whether the squares between corners are bright and dark by turns."""
    signs = _alternating(grey, corners.reshape(rows, columns, 2))
    contrary, agree = sorted([(signs > 0).mean(), (signs < 0).mean()])
    return bool(agree >= LEAST_ALTERNATING and contrary <= MOST_CONTRARY)


def _whole_size(grey: ndarray, corners: ndarray, columns: int, rows: int) -> tuple[int, int]:
    """The columns and rows of the board that a grid of corners belongs to: lines are added at its four sides
    as long as they go on.
    """
    grid = corners.reshape(rows, columns, 2)
    refused = 0
    while refused < 4:  # each side in turn, by turning the grid; done when none of the four goes on
        more = one_line_more(grid)
        if _goes_on(grey, more):
            grid, refused = more, 0
        else:
            grid, refused = np.swapaxes(grid, 0, 1)[::-1], refused + 1
    height, width = grid.shape[:2]
    upright = abs(width - columns) + abs(height - rows) <= abs(height - columns) + abs(width - rows)
    return (width, height) if upright else (height, width)


def _goes_on(grey: ndarray, grid: ndarray) -> bool:
    """Whether the last row of a grid is one of the board's, as those before it are."""
    strength = _alternating(grey, grid[-1 - LINES_BEFORE :])
    board, last = strength[:-1], strength[-1]
    sign = np.sign(board.sum())
    return bool((sign * last > 0.5 * np.median(np.abs(board))).mean() >= LINE_GOES_ON)


def _from_first_corner(grey: ndarray, corners: ndarray, columns: int, rows: int) -> Float[ndarray, "m 2"]:
    """The corners in an order that the board determines, as far as it does."""
    grid = corners.reshape(rows, columns, 2)
    if cross(grid[:1, -1] - grid[:1, 0], grid[-1:, 0] - grid[:1, 0]) < 0:
        grid = grid[:, ::-1]
    strength = _strengths(grey, grid)
    quarters = [quarter for quarter in range(4) if np.rot90(grid, quarter).shape == grid.shape]
    orders = [np.rot90(grid, quarter) for quarter in quarters]
    signs = [
        np.sign((-1) ** quarter * _by_turns(np.rot90(strength, quarter)).sum()) for quarter in quarters
    ]  # a quarter swaps squares
    first = min(range(len(orders)), key=lambda i: (signs[i], orders[i][0, 0].sum()))
    return orders[first].reshape(-1, 2)


def _alternating(grey: ndarray, grid: ndarray) -> ndarray:
    """The strengths of saddles (rows, columns), every other one's sign turned: a board has one sign
    throughout.
    """
    return _by_turns(_strengths(grey, grid))


def _by_turns(strength: ndarray) -> ndarray:
    """Every other one's sign turned (rows, columns)."""
    rows, columns = strength.shape
    return strength * np.where(np.add.outer(np.arange(rows), np.arange(columns)) % 2, -1.0, 1.0)


def _strengths(grey: ndarray, grid: ndarray) -> ndarray:
    """How much brighter the square between +along and +down and its opposite are than the two others, grey
    levels (rows, columns).

    Negative where they are darker; 0 where the four squares are not two and two, or one of them is not in the
    picture.
    """
    rows, columns = grid.shape[:2]
    corners = grid.reshape(-1, 2)
    shape = grid_shape(corners, columns, rows)
    steps = np.array([0.15, 0.25, 0.35])  # squares from the corner
    along = np.array([1, -1, 1, -1])[:, None, None] * steps[:, None]
    down = np.array([1, -1, -1, 1])[:, None, None] * steps
    a, d = (part.reshape(1, 4, -1, 1) for part in np.broadcast_arrays(along, down))
    places = (
        corners[:, None, None] + a * shape.along[:, None, None] + d * shape.down[:, None, None]
    )  # (m, 4 squares, 9, 2)
    height, width = grey.shape
    x, y = np.rint(places).astype(int).transpose(3, 0, 1, 2)
    inside = ((x >= 0) & (x < width) & (y >= 0) & (y < height)).all((1, 2))
    squares = grey[np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)].mean(-1)  # (m, 4)
    bright = squares[:, :2].min(1) - squares[:, 2:].max(1)
    dark = squares[:, 2:].min(1) - squares[:, :2].max(1)
    return np.where(inside, np.maximum(bright, 0.0) - np.maximum(dark, 0.0), 0.0).reshape(rows, columns)
