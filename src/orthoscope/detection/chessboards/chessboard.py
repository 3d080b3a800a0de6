"""Finding one chessboard, or the part of it that can be seen, in one grey photograph.

Corners of four squares are looked for first, in copies of the photograph, and hung together to lattices
(`saddle_points.py`, `lattices.py`): milliseconds, whatever is in the picture, and where nothing hangs
together there is no board. A lattice is then laid on the board, which gives the ids (`partial_board.py`).
Only where corners hang together without making the board do OpenCV's slower finders of whole boards get a
try. Whatever found them, the corners are refined in the photograph itself, so the way does not matter to
them.

A refined corner that is off its neighbours' lines is sought again from where they foresee it, and left out if
that
fails: no corner is better than a wrong one.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import cv2
import numpy as np

from orthoscope.detection.chessboards.board_marks import ways_by_marks
from orthoscope.detection.chessboards.grid import cross, nearest_neighbour
from orthoscope.detection.chessboards.lattices import CornerLattice, lattices
from orthoscope.detection.chessboards.opencv_finders import opencv_boards
from orthoscope.detection.chessboards.partial_board import (
    Grid,
    grid_of,
    is_even,
    laid_out,
    placements,
    without_lost_lines,
)
from orthoscope.detection.chessboards.refined_grid import refined_grid
from orthoscope.detection.saddles.contradicted import are_contradicted
from orthoscope.detection.saddles.linked import are_linked
from orthoscope.detection.saddles.saddle_points import saddle_points
from orthoscope.detection.sight import TWICE, Sight, Unseen
from orthoscope.detection.small_copies import enlarged, resized, to_photograph
from orthoscope.geometry.arrays import Bool, Float, InputError, Int, median, ndarray
from orthoscope.targets.chessboard import Chessboard
from orthoscope.targets.marked_chessboard import MarkedChessboard

__all__ = ["board_size", "find_chessboard", "see_chessboard"]

# Copies have these longer sides, pixels; most boards are found in the first.
COPY_SIDES = (640, 320, 1280, 2560)
# Where so many corners, closer than so many pixels, hang together and make no whole board, a copy twice as
# large is looked at.
PROMISING_CORNERS, SMALL_SQUARE = 8, 20.0
# So many lattices of each copy are looked at, since a chequered shirt may be larger than the board.
LATTICES_PER_COPY = 2
# A part of a board has at least this many corners.
FEWEST_PART_CORNERS = 6
# At least this share of the board's corners hangs together, or trying other finders is not worth while.
ENOUGH_CORNERS_SHARE = 0.25
# Of a second board that is wholly in the picture at least this share of the corners hangs together.
SECOND_BOARD_SHARE = 0.5
# More than this many times the board's corners are a tiled floor, not a board.
TOO_MANY_RATIO = 1.5
# Where one lattice has this many times the board's corners, a floor or a screen's own pattern, no larger copy
# is looked at.
FLOOR_RATIO = 6


class _Laid(NamedTuple):
    """A lattice laid on the board: ids (n,) in ascending order, pixels (n,2), which of them are sure, how far
    they spread by their windows, and which have windows with nothing but a saddle.
    """

    ids: Int[ndarray, " n"]
    pixels: Float[ndarray, "n 2"]
    sure: Bool[ndarray, " n"]
    spread: Float[ndarray, " n"]
    plain: Bool[ndarray, " n"]


def see_chessboard(grey: ndarray, board: Chessboard | MarkedChessboard) -> Sight | Unseen:
    """The inner corners of a board, or of the part of it that can be seen.

    Rows and columns lie as x and y do, seen from the front. Corner 0 is the one with a dark square beyond it,
    where the board has such at one end only (9x6); of ends that look alike the one nearer to the picture's
    top left.

    Args:
        grey: (h,w) uint8.
        board: what to look for.
    Raises:
        InputError: the board has fewer than 3 corners either way.
    """
    if min(board.grid) < 3:
        raise InputError(
            f"a board of {board.columns}x{board.rows} inner corners cannot be found in photographs; expected"
            " at least 3x3."
        )
    parts: list[_Laid] = []
    count = board.columns * board.rows
    hanging, open_, fits, largest = 0, False, False, np.inf
    for found, copy, others in _hanging_together(grey):
        if max(copy.shape) > largest:
            break
        if len(found.pixels) > FLOOR_RATIO * count:
            largest = max(copy.shape)
            continue
        grid = _in_photograph(grey, copy, found, board)
        if grid is None:
            continue
        seen = int(grid.seen.sum())
        if any(seen <= part.sure.sum() for part in parts):
            continue  # of this copy no more can be sure
        sight = _on_board(grey, grid, board)
        open_ |= sight is None and seen >= ENOUGH_CORNERS_SHARE * count and is_even(grey, grid)
        if sight and len(sight.ids) == count and (any(grid.ends) or sight.sure.all()):
            large = (other for other in others if len(other.pixels) >= SECOND_BOARD_SHARE * len(sight.ids))
            alike = any(_is_whole(_in_photograph(grey, copy, other, board), board) for other in large)
            return _sure(grey, sight, board, TWICE if alike else "")
        if is_even(grey, grid):
            hanging, fits = max(hanging, seen), fits or _may_be_whole(grey, grid, board)
        parts += [sight] if sight and len(sight.ids) >= FEWEST_PART_CORNERS else []
    best = max(parts, key=lambda sight: int(sight.sure.sum()), default=None)
    enough = ENOUGH_CORNERS_SHARE * count <= hanging <= TOO_MANY_RATIO * count
    if best is None and fits and enough and hanging != count:
        best = _by_opencv(grey, board)
    if best:
        return _sure(grey, best, board)
    return Unseen("is in it in part only, and which part cannot be told" if open_ else "was not found in it")


def _sure(
    grey: ndarray, laid: _Laid, board: Chessboard | MarkedChessboard, remark: str = ""
) -> Sight | Unseen:
    """The corners of a board that are sure, hang together and do not contradict each other."""
    ids, pixels, _, spread, plain = (part[laid.sure] for part in laid)
    cells = np.stack([ids % board.columns, ids // board.columns], axis=1)
    width, height = grey.shape[::-1]
    contradicted = are_contradicted(
        pixels, cells, board.grid, (width, height), spread=spread, doubtful=~plain
    )
    ids, pixels, cells = ids[~contradicted], pixels[~contradicted], cells[~contradicted]
    linked = are_linked(pixels, cells, cells.astype(float))
    if linked.sum() < FEWEST_PART_CORNERS:
        return Unseen("is in it, but too blurred, dim or small to say where its corners are")
    return Sight(ids[linked], pixels[linked], remark)


def _in_photograph(
    grey: ndarray, copy: ndarray, found: CornerLattice, board: Chessboard | MarkedChessboard
) -> Grid | None:
    """The grid of a copy's lattice, in the photograph's pixels; None where nothing is left of it."""
    grid = laid_out(copy, found, max(board.grid)) if len(found.pixels) >= FEWEST_PART_CORNERS else None
    return grid and grid._replace(corners=to_photograph(grid.corners, copy, grey))


def _may_be_whole(grey: ndarray, grid: Grid, board: Chessboard | MarkedChessboard) -> bool:
    """Whether all of the board is in the picture in one of the ways in which a grid lies on it, or in none
    that is known.
    """
    ways = placements(grid, board.columns, board.rows)
    far = np.array([board.columns - 1.0, board.rows - 1.0])
    ends = far * [[0, 0], [1, 0], [1, 1], [0, 1]]
    for ids in ways:
        cells = np.stack([ids % board.columns, ids // board.columns], axis=-1).reshape(-1, 2)
        homography, _ = cv2.findHomography(cells.astype(float), grid.corners.reshape(-1, 2), 0)
        there = ends if homography is None else cv2.perspectiveTransform(ends[None], homography)[0]
        if ((there >= 0) & (there <= np.array(grey.shape[::-1]) - 1)).all():
            return True
    return not ways


def _is_whole(grid: Grid | None, board: Chessboard | MarkedChessboard) -> bool:
    """Whether a grid is a whole board of these counts."""
    if grid is None or grid.seen.size != board.columns * board.rows:
        return False
    return bool(placements(grid, board.columns, board.rows))


def find_chessboard(grey: ndarray, columns: int, rows: int) -> Float[ndarray, "m 2"] | None:
    """The inner corners (columns * rows, 2) of a board that is wholly seen, pixels, row by row; None without
    one.
    """
    sight = see_chessboard(grey, Chessboard(columns, rows, 1.0))
    return sight.pixels if isinstance(sight, Sight) and len(sight.ids) == columns * rows else None


def board_size(grey: ndarray, *, whole: bool = True) -> tuple[int, int] | None:
    """The columns and rows of the board that is in a photograph, the larger first; None without one.

    Args:
        grey: (h,w) uint8.
        whole: whether all four of its sides must be seen; else one will do.
    """
    for found, copy, *_ in _hanging_together(grey):
        grid = laid_out(copy, found, max(found.size))
        if grid and (all if whole else any)(grid.ends) and min(grid.seen.shape) > 2:
            rows, columns = sorted(grid.seen.shape)
            return columns, rows
    return None


def lattice_sizes(grey: ndarray) -> set[tuple[int, int]]:
    """The columns and rows of all lattices in a photograph that may be boards, the larger first.

    Args:
        grey: (h,w) uint8.
    """
    grids = (laid_out(copy, found, max(found.size)) for found, copy, _ in _hanging_together(grey))
    sizes = (sorted(grid.seen.shape) for grid in grids if grid)
    return {(columns, rows) for rows, columns in sizes if rows > 2}


def _hanging_together(grey: ndarray) -> Iterator[tuple[CornerLattice, ndarray, list[CornerLattice]]]:
    """The largest lattices of each copy, the copy, and the lattices of it that are smaller; at last of an
    enlarged one, where squares are small.
    """
    shapes, are_small = set(), False
    for side in COPY_SIDES:
        copy = resized(grey, side)
        if copy.shape not in shapes:
            shapes.add(copy.shape)
            found = _largest(copy)
            are_small |= bool(found) and copy is grey and _has_small_squares(found[0])
            yield from ((one, copy, found[number:]) for number, one in enumerate(found, 1))
    if are_small:
        found = _largest(copy := enlarged(grey))
        yield from ((one, copy, found[number:]) for number, one in enumerate(found, 1))


def _largest(copy: ndarray) -> list[CornerLattice]:
    return lattices(saddle_points(copy))[:LATTICES_PER_COPY]


def _has_small_squares(found: CornerLattice) -> bool:
    """Whether many corners hang together, but so close that the circles around them reach into other
    squares.
    """
    if len(found.pixels) < PROMISING_CORNERS:
        return False
    return median(nearest_neighbour(found.pixels, found.cells.astype(float))) < SMALL_SQUARE


def _on_board(
    grey: ndarray, grid: Grid, board: Chessboard | MarkedChessboard, *, again: bool = True
) -> _Laid | None:
    """The corners with their ids, refined; None where the grid is not the board's or the ids are open.

    Where whole lines of the grid are no corners it was none of the board's; what is left is numbered `again`.
    """
    ways = placements(grid, board.columns, board.rows)
    arms = np.ones(grid.seen.shape)
    if isinstance(board, MarkedChessboard):
        negative = placements(grid, board.columns, board.rows, negative=True)
        ways = ways_by_marks(grey, grid, ways, board) or ways_by_marks(
            grey, grid, negative, board, only_seen=True
        )
    if not ways or not _alike(ways, grid.seen, board.symmetries()):
        return None
    whole = grid.seen.size == board.columns * board.rows
    ids = _first_way(ways, grid.corners, whole)
    if isinstance(board, MarkedChessboard):
        arms[np.isin(ids, board.marked_corners())] = board.arm
    pixels, good, *evidence = refined_grid(grey, grid.corners, grid.seen, arms)
    if (less := without_lost_lines(grey, grid, pixels, good, max(board.grid))) and again:
        return _on_board(grey, less, board, again=False)
    order = np.argsort(ids[good])
    return _Laid(*(part[good][order] for part in (ids, pixels, *evidence)))


def _alike(ways: list[ndarray], seen: Bool[ndarray, "r c"], symmetries: tuple[ndarray, ...]) -> bool:
    """Whether all ways to number the corners are the same but for the board's own symmetry."""
    first = ways[0][seen]
    return all(any((other[seen] == turn[first]).all() for turn in symmetries) for other in ways[1:])


def _first_way(ways: list[ndarray], corners: ndarray, whole: bool) -> Int[ndarray, "r c"]:
    """The way whose corner 0 is nearest to the picture's top left; of parts, the one whose ids grow from
    there.
    """
    if whole:
        return min(ways, key=lambda ids: corners[ids == 0].sum())
    across = corners.sum(-1) - corners.sum(-1).mean()
    return max(ways, key=lambda ids: float((ids * across).sum()))


def _by_opencv(grey: ndarray, board: Chessboard | MarkedChessboard) -> _Laid | None:
    """What OpenCV's finders see, if it is the whole board."""
    for rough in opencv_boards(grey, board.columns, board.rows):
        corners = rough.reshape(board.rows, board.columns, 2)
        if cross(corners[:1, -1] - corners[:1, 0], corners[-1:, 0] - corners[:1, 0])[0] < 0:
            corners = corners[:, ::-1]
        grid = grid_of(grey, corners, max(board.grid))
        sight = _on_board(grey, grid, board)
        if sight and len(sight.ids) == board.columns * board.rows:
            return sight
    return None
