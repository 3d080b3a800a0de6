"""Which discs hang together as a lattice.

A disc's own ellipse says how the board is foreshortened where it stands: with its axes taken for unit length,
the discs next to it stand at equal distances in four directions at right angles, however the board is tilted.
Two discs are linked where each has the other in such a place. Blur makes the outlines of small slanted discs
rounder than they are: the links that were found say better how the board is foreshortened, and with that the
others are found. Following links numbers the lattice.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from orthoscope.geometry.arrays import Float, Int, ndarray
from orthoscope.geometry.ellipses import Ellipses

__all__ = ["DIRECTION_STEPS", "diameter_in_steps", "numbered"]

# So many discs may be next to one.
NEIGHBOUR_CANDIDATES = 12
# Neighbours' areas differ by no more than this factor.
MOST_AREA_RATIO = 2.2
# A neighbour is within this range of the nearest one's distance.
LENGTH_RANGE = (0.7, 1.42)
# A neighbour's direction is off its right angle by less than this, radians.
MOST_ANGLE = 0.35
# So many discs at least are next to others where there is a lattice.
FEWEST_LINKED = 4
# The neighbours of so many discs are sought at once.
ROWS_AT_ONCE = 256
# Where there are more spots than this most are noise, and how the board is foreshortened is seen by each
# one's own outline.
MOST_FRAMED = 1000
# These are the steps on the lattice, in the order of the four directions.
DIRECTION_STEPS = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])


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
    found = _linked(discs, discs.axes)
    frames = _frames(discs.centres, found)
    return found if frames is None else _linked(discs, frames)


def _linked(discs: Ellipses, frames: Float[ndarray, "n 2 2"]) -> Int[ndarray, "n 4"]:
    """The disc next to each in four directions, -1 where there is none: those that have each other there.

    Args:
        discs: spots.
        frames: in these a disc's neighbours stand at equal distances and right angles.
    """
    count = len(discs.centres)
    if count < FEWEST_LINKED:
        return np.full((count, 4), -1)
    areas, inverses = np.linalg.det(discs.axes), np.linalg.inv(frames)
    rows = np.arange(count)
    parts = [rows[first : first + ROWS_AT_ONCE] for first in range(0, count, ROWS_AT_ONCE)]
    found = np.concatenate([_next_to(some, discs.centres, areas, inverses) for some in parts])
    both = (found[found] == rows[:, None, None]).any(2)
    return np.where((found >= 0) & both, found, -1)


def _next_to(
    some: Int[ndarray, " k"],
    centres: Float[ndarray, "n 2"],
    areas: Float[ndarray, " n"],
    inverses: Float[ndarray, "n 2 2"],
) -> Int[ndarray, "k 4"]:
    """The disc next to each of some in the four directions of its frame, -1 where there is none."""
    offsets = (centres - centres[some, None]) @ inverses[some].swapaxes(1, 2)
    far = np.hypot(offsets[..., 0], offsets[..., 1])
    ratio = areas / areas[some, None]
    far[(ratio > MOST_AREA_RATIO) | (ratio < 1.0 / MOST_AREA_RATIO)] = np.inf
    far[np.arange(len(some)), some] = np.inf
    most = min(NEIGHBOUR_CANDIDATES, len(centres) - 1)
    near = np.argpartition(far, most, axis=1)[:, :most]
    length = np.take_along_axis(far, near, 1)
    x, y = np.take_along_axis(offsets, near[..., None], 1).transpose(2, 0, 1)
    angle = np.arctan2(y, x)
    angle -= np.take_along_axis(angle, length.argmin(1)[:, None], 1)
    quarter = np.rint(angle / (0.5 * np.pi))
    off = np.abs(angle - quarter * 0.5 * np.pi)
    nearest = length.min(1, keepdims=True)
    fits = (off < MOST_ANGLE) & (length > LENGTH_RANGE[0] * nearest) & (length < LENGTH_RANGE[1] * nearest)
    off[~fits] = np.inf
    found = np.full((len(some), 4), -1)
    for direction in range(4):
        away = np.where(quarter % 4 == direction, off, np.inf)
        best = away.argmin(1)[:, None]  # the straightest
        there = np.isfinite(np.take_along_axis(away, best, 1))[:, 0]
        found[there, direction] = np.take_along_axis(near, best, 1)[there, 0]
    return found


def _frames(
    centres: Float[ndarray, "n 2"], neighbours: Int[ndarray, "n 4"]
) -> Float[ndarray, "n 2 2"] | None:
    """How the board is foreshortened at each disc, by its own neighbours or those of the disc nearest to it:
    blur makes the outlines of small slanted discs rounder than they are. None where few are next to any.
    """
    steps = np.where((neighbours >= 0)[..., None], centres[neighbours] - centres[:, None], np.nan)
    ahead, back = steps[:, :2], -steps[:, 2:]
    along = np.where(np.isnan(ahead), back, np.where(np.isnan(back), ahead, 0.5 * (ahead + back)))
    known = np.flatnonzero(np.isfinite(along).all((1, 2)))
    if len(known) < FEWEST_LINKED or len(centres) > MOST_FRAMED:
        return None
    values, turns = np.linalg.eigh(along[known].swapaxes(1, 2) @ along[known])
    frames = np.einsum("nij,nj,nkj->nik", turns, np.sqrt(np.maximum(values, 1e-9)), turns)
    apart = np.linalg.norm(centres[:, None] - centres[known], axis=2)
    return frames[apart.argmin(1)]


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
