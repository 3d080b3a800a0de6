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

import numpy as np

from orthoscope.detection.chessboards.board_marks import ways_by_marks
from orthoscope.detection.chessboards.grid import cross, grid_shape, nearest_neighbour
from orthoscope.detection.chessboards.lattices import CornerLattice, lattices
from orthoscope.detection.chessboards.opencv_finders import opencv_boards
from orthoscope.detection.chessboards.partial_board import (
    Grid,
    filled,
    grid_of,
    has_plain_squares,
    is_even,
    laid_out,
    placements,
    without_lost_lines,
)
from orthoscope.detection.saddles.contradicted import are_contradicted
from orthoscope.detection.saddles.linked import are_linked
from orthoscope.detection.saddles.refine import Refined, refined
from orthoscope.detection.saddles.saddle_points import saddle_points
from orthoscope.detection.saddles.smooth_grid import off_smooth_grid
from orthoscope.detection.sight import TWICE, Sight, Unseen
from orthoscope.detection.small_copies import resized, to_photograph
from orthoscope.geometry.arrays import Bool, Float, InputError, Int, median, ndarray
from orthoscope.targets.chessboard import Chessboard
from orthoscope.targets.marked_chessboard import MarkedChessboard

__all__ = ["board_size", "find_chessboard", "see_chessboard"]

# Copies have these longer sides, pixels; most boards are found in the first.
COPY_SIDES = (640, 320, 1280, 2560)
# So many lattices of each copy are looked at, since a chequered shirt may be larger than the board.
LATTICES_PER_COPY = 2
# In a poor picture saddles usually explain less of their windows than this.
LEAST_EXPLAINED = 0.9
# Boards with smaller steps, pixels, are treated as a poor picture's.
SMALL_STEP = 12.0
# A part of a board has at least this many corners.
FEWEST_PART_CORNERS = 6
# At least this share of the board's corners hangs together, or trying other finders is not worth while.
ENOUGH_CORNERS_SHARE = 0.25
# Of a second board that is wholly in the picture at least this share of the corners hangs together.
SECOND_BOARD_SHARE = 0.5
# More than this many times the board's corners are a tiled floor, not a board.
TOO_MANY_RATIO = 1.5
# Where one lattice has this many times the board's corners, whatever it is, no further copy is looked at.
FLOOR_RATIO = 6
# A corner that is off its neighbours' lines is sought again so many times.
REPAIR_ROUNDS = 2
# A corner is off its neighbours' lines by at least so many steps, and so many times the usual stray.
OFF_LIMITS = (0.1, 6.0)
# A corner that is no saddle is off by at least so many steps, and so many times the usual stray.
OFF_LIMITS_WITHOUT_SADDLE = (0.04, 3.0)
# The usual stray is at most this, steps.
LARGEST_USUAL_STRAY = 0.03
# No corner that was not seen is sought nearer to the picture's rim than this, pixels.
RIM_PX = 2.0
# A part with more than this share of corners that are no saddles is not believed.
MOST_DOUBTFUL_SHARE = 0.4


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
    hanging, open_ = 0, False
    for found, copy, others in _hanging_together(grey):
        if len(found.pixels) > FLOOR_RATIO * board.columns * board.rows:
            break
        grid = _in_photograph(grey, copy, found, board)
        if grid is None:
            continue
        if is_even(grey, grid):
            hanging = max(hanging, int(grid.seen.sum()))
        sight = _on_board(grey, grid, board)
        open_ |= sight is None
        if sight and len(sight.ids) == board.columns * board.rows:
            large = (other for other in others if len(other.pixels) >= SECOND_BOARD_SHARE * len(sight.ids))
            alike = any(_is_whole(_in_photograph(grey, copy, other, board), board) for other in large)
            return _sure(grey, sight, board, TWICE if alike else "")
        parts += [sight] if sight and len(sight.ids) >= FEWEST_PART_CORNERS else []
    best = max(parts, key=lambda sight: int(sight.sure.sum()), default=None)
    count = board.columns * board.rows
    if ENOUGH_CORNERS_SHARE * count <= hanging <= TOO_MANY_RATIO * count and (
        best is None or len(best.ids) > 0.8 * count
    ):
        best = _by_opencv(grey, board) or best
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
    if grid is None or not has_plain_squares(copy, grid):
        return None
    return grid._replace(corners=to_photograph(grid.corners, copy, grey))


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
    """The largest lattices of each copy, the copy, and the lattices of it that are smaller."""
    shapes = set()
    for side in COPY_SIDES:
        copy = resized(grey, side)
        if copy.shape not in shapes:
            shapes.add(copy.shape)
            found = lattices(saddle_points(copy))[:LATTICES_PER_COPY]
            for number, one in enumerate(found, 1):
                yield one, copy, found[number:]


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
        ways = ways_by_marks(grey, grid, ways, board) or ways_by_marks(grey, grid, negative, board)
    if not ways or not _alike(ways, grid.seen, board.symmetries()):
        return None
    whole = grid.seen.size == board.columns * board.rows
    ids = _first_way(ways, grid.corners, whole)
    if isinstance(board, MarkedChessboard):
        arms[np.isin(ids, board.marked_corners())] = board.arm
    pixels, good, *evidence = _refined(grey, grid.corners, grid.seen, arms)
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


def _refined(
    grey: ndarray,
    corners: Float[ndarray, "r c 2"],
    seen: Bool[ndarray, "r c"],
    arms: Float[ndarray, "r c"],
) -> tuple[
    Float[ndarray, "r c 2"],
    Bool[ndarray, "r c"],
    Bool[ndarray, "r c"],
    Float[ndarray, "r c"],
    Bool[ndarray, "r c"],
]:
    """The grid's corners in the photograph, which of them are good, which of these are sure, how far they
    spread, and which have plain windows.
    """
    inside = ((corners >= RIM_PX) & (corners <= np.array(grey.shape[::-1]) - 1 - RIM_PX)).all(-1)
    row, column = np.nonzero(seen | inside)
    places = np.stack([column, row], axis=1).astype(float)
    fine = refined(grey, corners[row, column], places, arm=arms[row, column])
    off = _off(fine, places)
    for _ in range(REPAIR_ROUNDS):
        if not off.any() or off.all():
            break
        known = np.full_like(corners, np.nan)
        known[row[~off], column[~off]] = fine.pixels[~off]
        start = np.where(off[:, None], filled(known)[row, column], fine.pixels)
        again = refined(grey, start, places, approach=False, arm=arms[row, column])
        fine = fine.with_others(off, again)
        off = _off(fine, places)
    fine, off = _on_smooth_grid(grey, fine, places, off, arms[row, column])
    off = _without_strays(fine, places, off)
    good = np.zeros_like(seen)
    good[row, column] = ~off & (seen[row, column] | fine.believed)
    if not good.all() and (~fine.believed[good[row, column]]).mean() > MOST_DOUBTFUL_SHARE:
        good[:] = False
    pixels = corners.copy()
    pixels[row, column] = fine.pixels
    sure, plain, spread = np.zeros_like(seen), np.zeros_like(seen), np.zeros(seen.shape)
    sure[row, column] = fine.sure & fine.whole
    spread[row, column], plain[row, column] = fine.spread, fine.plain
    return pixels, good, sure, spread, plain


def _on_smooth_grid(
    grey: ndarray,
    fine: Refined,
    places: Float[ndarray, "m 2"],
    off: Bool[ndarray, " m"],
    arms: Float[ndarray, " m"],
) -> tuple[Refined, Bool[ndarray, " m"]]:
    """The corners, those that are off where all others foresee them sought again from there; and which stay
    off.
    """
    on = np.flatnonzero(~off)
    if not len(on):
        return fine, off
    step = median(nearest_neighbour(fine.pixels[on], places[on]))
    poor = median(fine.explained[on]) < LEAST_EXPLAINED or step < SMALL_STEP
    away, foreseen, limit = off_smooth_grid(
        fine.pixels[on], places[on], step, doubtful=~fine.believed[on], poor=poor
    )
    if not away.any():
        return fine, off
    start, off = np.where(away[:, None], foreseen, fine.pixels[on]), off.copy()
    again = refined(grey, start, places[on], approach=False, arm=arms[on])
    moved = np.hypot(*(again.pixels - foreseen).T)
    off[on[away]] = ((moved > limit) | ~again.believed)[away]
    fine = Refined(*(part.copy() for part in fine))
    for part, new in zip(fine, again, strict=True):
        part[on[away]] = new[away]
    return fine, off


def _without_strays(
    fine: Refined, places: Float[ndarray, "m 2"], off: Bool[ndarray, " m"]
) -> Bool[ndarray, " m"]:
    """Which corners are off once the lines are laid through those that are not, the worst first."""
    off = off.copy()
    for _ in range(len(off)):
        on = np.flatnonzero(~off)
        if len(on) < FEWEST_PART_CORNERS:
            break
        some = fine.of(on)
        strays = _off(some, places[on])
        if not strays.any():
            break
        stray = grid_shape(some.pixels, places[on]).stray
        off[on[np.where(strays, stray, 0.0).argmax()]] = True
    return off


def _off(fine: Refined, places: Float[ndarray, "m 2"]) -> Bool[ndarray, " m"]:
    """Which corners are off their neighbours' lines by more than is usual, no saddles sooner."""
    stray = grid_shape(fine.pixels, places).stray
    usual = min(median(stray), LARGEST_USUAL_STRAY)
    return stray > np.where(
        fine.believed,
        max(OFF_LIMITS[0], OFF_LIMITS[1] * usual),
        max(OFF_LIMITS_WITHOUT_SADDLE[0], OFF_LIMITS_WITHOUT_SADDLE[1] * usual),
    )


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
