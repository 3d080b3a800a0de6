"""Which discs hang together as a lattice, and which of a board's discs they are.

A disc's own ellipse says how the board is foreshortened where it stands: with its axes taken for unit length,
the discs next to it stand at equal distances in four directions at right angles, however the board is tilted.
Two discs are linked where each has the other in such a place; following links numbers the lattice.

The lattice is laid onto the board in every way that puts all discs on it. A way is believed where hardly any
disc of the board that ought to be seen next to a found one is missing, and only if no other way is as good
but for the board's own symmetry.
"""

from __future__ import annotations

from collections import deque
from functools import lru_cache

import numpy as np

from orthoscope.geometry.arrays import Float, Int, ndarray
from orthoscope.geometry.ellipses import Ellipses
from orthoscope.targets.circles import Circles

__all__ = ["FORESEEING_DISCS", "diameter_in_steps", "foreseen", "foretelling", "laid_on", "numbered"]

# So many discs may be next to one.
NEIGHBOUR_CANDIDATES = 12
# Neighbours' areas differ by no more than this factor.
MOST_AREA_RATIO = 2.2
# A neighbour is within this range of the nearest one's distance.
LENGTH_RANGE = (0.7, 1.42)
# A neighbour's direction is off its right angle by less than this, radians.
MOST_ANGLE = 0.35
# These are the steps on the lattice, in the order of the four directions.
DIRECTION_STEPS = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])
# At most this share of the discs found has no place on the board.
MOST_MISSING_SHARE = 0.12
# Where the discs found reach over the whole board, at most this share has no place: something covers them.
MOST_COVERED_SHARE = 0.5
# Another way to lay the board is as good when it misses no more than this share of a shorter side's discs.
RIVAL_SHARE = 0.5
# At most so many spots join the lattice by chance.
MOST_SPOTS_OFF_BOARD = 1
# So many discs nearby foresee one.
FORESEEING_DISCS = 12
# A disc is seen when it is in the picture with its radii multiplied by this.
SEEN_MARGIN = 1.25


def numbered(discs: Ellipses) -> tuple[Int[ndarray, " n"], Int[ndarray, "n 2"]]:
    """The discs that hang together, most of them, and their places in a lattice of neighbours."""
    neighbour = _neighbours(discs)
    best: dict[int, tuple[ndarray, int]] = {}
    left = set(range(len(neighbour)))
    while len(left) > len(best):
        first = left.pop()
        placed, waiting = {first: (np.zeros(2, dtype=int), 0)}, deque([first])
        while waiting:
            disc = waiting.popleft()
            place, turn = placed[disc]
            for direction, other in enumerate(neighbour[disc]):
                if other < 0 or other in placed:
                    continue
                back = int(np.flatnonzero(neighbour[other] == disc)[0])
                placed[other] = (
                    place + DIRECTION_STEPS[(direction + turn) % 4],
                    (direction + turn + 2 - back) % 4,
                )
                waiting.append(int(other))
        left -= placed.keys()
        if len(placed) > len(best):
            best = placed
    which = np.array(sorted(best), dtype=int)
    places = np.array([best[disc][0] for disc in which.tolist()], dtype=int).reshape(-1, 2)
    _, first, count = np.unique(places, axis=0, return_index=True, return_counts=True)
    alone = first[count == 1]
    return which[alone], places[alone]


def _neighbours(discs: Ellipses) -> Int[ndarray, "n 4"]:
    """The disc next to each in four directions, in the order from x to y; -1 where there is none."""
    count = len(discs.centres)
    found = np.full((count, 4), -1)
    if count < 3:
        return found
    areas = np.linalg.det(discs.axes)
    inverse = np.linalg.inv(discs.axes)
    for disc in range(count):
        away = discs.centres - discs.centres[disc]
        offsets = away @ inverse[disc].T
        far = np.hypot(*offsets.T)
        far[disc] = np.inf
        ratio = areas / areas[disc]
        far[(ratio > MOST_AREA_RATIO) | (ratio < 1.0 / MOST_AREA_RATIO)] = np.inf
        near = np.argpartition(far, min(NEIGHBOUR_CANDIDATES, count - 1))[:NEIGHBOUR_CANDIDATES]
        near = near[np.isfinite(far[near])]
        if not len(near):
            continue
        nearest = near[far[near].argmin()]
        length = far[near] / far[nearest]
        direction = np.arctan2(*offsets[near].T[::-1]) - np.arctan2(*offsets[nearest][::-1])
        quarter = np.rint(direction / (0.5 * np.pi))
        off = np.abs(direction - quarter * 0.5 * np.pi)
        good = (off < MOST_ANGLE) & (length > LENGTH_RANGE[0]) & (length < LENGTH_RANGE[1])
        for k in np.flatnonzero(good)[np.argsort(-off[good])]:  # the straightest last, so that it stays
            found[disc, int(quarter[k]) % 4] = near[k]
    for disc in range(count):
        for direction in range(4):
            other = found[disc, direction]
            if other >= 0 and disc not in found[other]:
                found[disc, direction] = -1
    return found


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
    on_board = board.neighbour_places()
    least = on_board.min(0) - 1
    table = np.full(tuple(np.ptp(on_board, axis=0) + 3), -1)
    table[tuple((on_board - least).T)] = np.arange(len(on_board))
    ways: list[ndarray] = []
    for quarter in range(4):
        turned = places @ np.linalg.matrix_power(np.array([[0, 1], [-1, 0]]), quarter)
        low, high = turned.min(0), turned.max(0)
        for shift_x in range(on_board[:, 0].min() - low[0] - 1, on_board[:, 0].max() - high[0] + 2):
            for shift_y in range(on_board[:, 1].min() - low[1] - 1, on_board[:, 1].max() - high[1] + 2):
                cells = turned + np.array([shift_x, shift_y]) - least
                inside = ((cells >= 0) & (cells < table.shape)).all(1)
                ids = np.full(len(cells), -1)
                ids[inside] = table[tuple(cells[inside].T)]
                if (ids < 0).sum() <= MOST_SPOTS_OFF_BOARD and (ids >= 0).sum() >= 4:
                    ways.append(ids)
    missing = np.array([_missing(board, discs, ids, shape) for ids in ways])
    if not len(ways):
        return np.full(len(places), -1), False
    allowed = MOST_COVERED_SHARE if _reaches_over(board, ways[int(missing.argmin())]) else MOST_MISSING_SHARE
    if missing.min() > allowed * len(places):
        return np.full(len(places), -1), False
    off = np.array([(ids < 0).sum() for ids in ways])
    most = missing.min() + RIVAL_SHARE * min(board.columns, board.rows)
    good = [ways[i] for i in np.flatnonzero((missing <= most) & (off <= off[missing.argmin()]))]
    return _of_same(board, discs, good)


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
    _, where = foreseen(board, discs, ids, shape)
    return len(where.centres)


def foreseen(
    board: Circles, discs: Ellipses, ids: Int[ndarray, " n"], shape: tuple[int, ...]
) -> tuple[Int[ndarray, " k"], Ellipses]:
    """Discs next to found ones that should be in the picture, by a parabola through the nearest found ones.

    Args:
        board: what was photographed.
        discs: that were found.
        ids: of these; -1 for none.
        shape: of the picture.
    """
    places = board.neighbour_places()
    mine = ids >= 0
    known, centres, axes = ids[mine], discs.centres[mine], discs.axes[mine]
    missing = np.setdiff1d(np.arange(len(places)), known)
    apart = np.abs(places[missing, None] - places[known]).sum(-1)
    next_to = np.flatnonzero(apart.min(1, initial=9) == 1)
    where, like = [], []
    for k in next_to:
        nearest = np.argsort(apart[k], kind="stable")[:FORESEEING_DISCS]
        where.append(foretelling(places[known[nearest]] - places[missing[k]]) @ centres[nearest])
        like.append(axes[nearest[0]])
    found = Ellipses(np.array(where).reshape(-1, 2), np.array(like).reshape(-1, 2, 2))
    reach = SEEN_MARGIN * np.linalg.norm(found.axes, axis=2)
    inside = ((found.centres - reach > 1) & (found.centres + reach < np.array(shape[1::-1]) - 2)).all(1)
    return missing[next_to][inside], Ellipses(found.centres[inside], found.axes[inside])


def foretelling(steps: Int[ndarray, "k 2"]) -> Float[ndarray, " k"]:
    """By what weights discs so many steps away foretell here: by a parabola, few discs by a plane."""
    return _weights(tuple(steps.ravel().tolist()))


@lru_cache(maxsize=4096)
def _weights(steps: tuple[int, ...]) -> Float[ndarray, " k"]:
    """As above; the discs of a lattice have the same neighbours again and again."""
    x, y = np.array(steps, dtype=float).reshape(-1, 2).T
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)
    enough = len(x) >= FORESEEING_DISCS and min(len(set(steps[::2])), len(set(steps[1::2]))) >= 3
    return np.linalg.pinv(terms[:, : 6 if enough else 3])[0]


def _inverses(axes: Float[ndarray, "n 2 2"]) -> Float[ndarray, "n 2 2"]:
    """NaN for discs without an outline."""
    whole = np.asarray(np.isfinite(axes).all((1, 2)))
    return np.where(
        whole[:, None, None], np.linalg.inv(np.where(whole[:, None, None], axes, np.eye(2))), np.nan
    )


def diameter_in_steps(discs: Ellipses, places: Int[ndarray, "n 2"]) -> float:
    """A disc's diameter over its distance from the next, as its own ellipse's frame has it; 0 of discs
    that stand alone.

    Args:
        discs: NaN for those without an outline.
        places: in the lattice, as `numbered` says.
    """
    inverse, lookup = _inverses(discs.axes), {tuple(place): i for i, place in enumerate(places.tolist())}
    far = [
        float(np.hypot(*(inverse[i] @ (discs.centres[other] - discs.centres[i]))))
        for place, i in lookup.items()
        for step in ((1, 0), (0, 1))
        if (other := lookup.get((place[0] + step[0], place[1] + step[1]))) is not None
    ]
    return 2.0 / float(np.nanmedian(far)) if np.isfinite(far).any() else 0.0
