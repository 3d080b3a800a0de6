"""Which of a board's discs those are that hang together.

The lattice is laid onto the board in every way that puts all discs on it. A way is believed where hardly any
disc of the board that ought to be seen next to a found one is missing, and only if no other way is as good
but for the board's own symmetry.
"""

from __future__ import annotations

import numpy as np

from orthoscope.detection.discs.disc_foresight import beside, foreseen, is_among
from orthoscope.geometry.arrays import Float, Int, ndarray
from orthoscope.geometry.ellipses import Ellipses
from orthoscope.targets.circles import Circles

__all__ = ["laid_on"]

# Of small slanted discs, which blur makes rounder than they are, one that stands diagonally may be taken for
# the next: these steps of the lattice are then the board's.
STRAIGHTENED = (((1, 0), (1, 1)), ((1, 0), (-1, 1)), ((1, 1), (0, 1)), ((1, -1), (0, 1)))
# So they are only where this share of the board's discs hangs together; fewer could lie on it by chance.
LEAST_SLANTED_SHARE = 0.8
# From one step of a lattice to the next its line turns by less than this share of both; at most so many
# discs, or this share of them, are an exception.
MOST_TURN, MOST_TURNS, MOST_TURNS_SHARE = 0.3, 1, 0.04
# A board is laid with at least so many discs.
FEWEST_LAID = 4
# Of the discs that ought to be seen at most this share, of those found, is missing.
MOST_MISSING_SHARE = 0.12
# Where the discs found reach over the whole board, at most this share has no place: something covers them.
MOST_COVERED_SHARE = 0.5
# Another way to lay the board is as good when it misses no more than this share of a shorter side's discs.
RIVAL_SHARE = 0.5
# At most so many spots join the lattice by chance.
MOST_SPOTS_OFF_BOARD = 1


def laid_on(
    board: Circles, discs: Ellipses, places: Int[ndarray, "n 2"], shape: tuple[int, ...]
) -> tuple[Int[ndarray, " n"], bool]:
    """The id of each disc, -1 for one that is not the board's, and whether there is one way only.

    Args:
        board: what was photographed.
        discs: that hang together.
        places: of them in the lattice, as `numbered` says.
        shape: of the picture.
    """
    if _is_kinked(discs.centres, places):
        return np.full(len(places), -1), False
    ids, several = _laid_straight(board, discs, places, shape)
    if (ids >= 0).any() or len(places) < LEAST_SLANTED_SHARE * board.columns * board.rows:
        return ids, several
    for straight in STRAIGHTENED:
        slanted, _ = _laid_straight(board, discs, places @ np.array(straight), shape)
        if (slanted >= 0).any():
            return slanted, False
    return ids, several


def _is_kinked(centres: Float[ndarray, "n 2"], places: Int[ndarray, "n 2"]) -> bool:
    """Whether lines of the lattice turn from one step to the next: in a part of it discs that stand
    diagonally were taken for the next.
    """
    number = {place: i for i, place in enumerate(map(tuple, places.tolist()))}
    before, here, after = (
        np.array([number.get((x + k * dx, y + k * dy), -1) for x, y in number for dx, dy in ((1, 0), (0, 1))])
        for k in (-1, 0, 1)
    )
    known = (before >= 0) & (after >= 0)
    if not known.any():
        return False
    ahead, back = centres[after[known]], centres[before[known]]
    turn = np.linalg.norm(ahead + back - 2.0 * centres[here[known]], axis=1)
    turned = turn > MOST_TURN * np.linalg.norm(ahead - back, axis=1)
    return int(turned.sum()) > max(MOST_TURNS, MOST_TURNS_SHARE * len(turned))


def _laid_straight(
    board: Circles, discs: Ellipses, places: Int[ndarray, "n 2"], shape: tuple[int, ...]
) -> tuple[Int[ndarray, " n"], bool]:
    """The same, where the lattice's steps are the board's, turned by quarters."""
    ways = _ways(board, places)
    if not ways:
        return np.full(len(places), -1), False
    missing = np.array([_missing(board, discs, ids, shape) for ids in ways])
    allowed = MOST_COVERED_SHARE if _reaches_over(board, ways[int(missing.argmin())]) else MOST_MISSING_SHARE
    if missing.min() > allowed * len(places):
        return np.full(len(places), -1), False
    off = np.array([(ids < 0).sum() for ids in ways])
    most = missing.min() + RIVAL_SHARE * min(board.columns, board.rows)
    good = [ways[i] for i in np.flatnonzero((missing <= most) & (off <= off[missing.argmin()]))]
    return _of_same(board, discs, good)


def _ways(board: Circles, places: Int[ndarray, "n 2"]) -> list[Int[ndarray, " n"]]:
    """The ids in each way to lay the lattice that has hardly any spot beside the board."""
    on_board = board.neighbour_places()
    least = on_board.min(0) - 1
    table = np.full(tuple(np.ptp(on_board, axis=0) + 3), -1)
    table[tuple((on_board - least).T)] = np.arange(len(on_board))
    ways = []
    for quarter in range(4):
        turned = places @ np.linalg.matrix_power(np.array([[0, 1], [-1, 0]]), quarter)
        low, high = turned.min(0), turned.max(0)
        for shift_x in range(on_board[:, 0].min() - low[0] - 1, on_board[:, 0].max() - high[0] + 2):
            for shift_y in range(on_board[:, 1].min() - low[1] - 1, on_board[:, 1].max() - high[1] + 2):
                cells = turned + np.array([shift_x, shift_y]) - least
                inside = ((cells >= 0) & (cells < table.shape)).all(1)
                ids = np.full(len(cells), -1)
                ids[inside] = table[tuple(cells[inside].T)]
                if (ids < 0).sum() <= MOST_SPOTS_OFF_BOARD and (ids >= 0).sum() >= FEWEST_LAID:
                    ways.append(ids)
    return ways


def _reaches_over(board: Circles, ids: Int[ndarray, " n"]) -> bool:
    """Whether discs are seen of the board's first and last row and column, and of it at least half: it can
    then lie in one way only, whatever a hand covers of it.
    """
    row, column = np.divmod(ids[ids >= 0], board.columns)
    ends = row.min() == 0, row.max() == board.rows - 1, column.min() == 0, column.max() == board.columns - 1
    return all(ends) and bool((ids >= 0).all()) and 2 * len(ids) >= board.columns * board.rows


def _of_same(board: Circles, discs: Ellipses, ways: list[ndarray]) -> tuple[Int[ndarray, " n"], bool]:
    """Of ways that differ by the board's symmetry the one with corner 0 nearest to the picture's top left."""
    first = ways[0]
    seen = first >= 0
    same = [np.where(seen, way[first], -1) for way in (np.arange(len(board.places())), *board.symmetries())]
    if not all(any(np.array_equal(way, other) for other in same) for way in ways):
        return np.full(len(first), -1), True
    firsts = [discs.centres[seen][way[seen].argmin()].sum() for way in same]
    return same[int(np.argmin(firsts))], False


def _missing(board: Circles, discs: Ellipses, ids: Int[ndarray, " n"], shape: tuple[int, ...]) -> int:
    """How many discs next to found ones ought to be seen and are not."""
    places, mine = board.neighbour_places(), ids >= 0
    near = beside(places[ids[mine]])
    return len(foreseen(discs.of(mine), places[ids[mine]], near[is_among(near, places)], shape)[0])
