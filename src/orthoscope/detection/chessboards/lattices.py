"""From corners of four squares to lattices of them: who is whose neighbour, and so column and row of each.

From a corner its edges run to its four neighbours, and since squares are bright and dark by turns, a
neighbour's bright and dark squares are the other way round. The nearest corner along an edge of which both is
true is a neighbour if the other one says the same of it; what hangs together by such links is a lattice.
Chance makes links too, rarely many: noise and texture give lattices of a few corners.
"""

from __future__ import annotations

from math import cos, pi
from typing import NamedTuple

import numpy as np

from orthoscope.detection.saddles.saddle_points import SaddlePoints
from orthoscope.geometry.arrays import Float, Int, ndarray

__all__ = ["LONGEST_STEP", "CornerLattice", "lattices"]

# So many of the nearest corners may be neighbours.
NEIGHBOUR_CANDIDATES = 16
# The edge is off the direction to the neighbour, and off the neighbour's edge, by less than this, radians.
WIDEST_TURN = np.deg2rad(22.0)
# A link is at most so many times as long as the next one of its line.
LONGEST_STEP = 2.0
# A lattice worth telling of has at least this many corners.
FEWEST_LATTICE_CORNERS = 4


class CornerLattice(NamedTuple):
    """Corners that hang together.

    Attributes:
        pixels: (n,2).
        cells: (n,2) column and row of each, whole, from 0; they run as x and y do, seen from the front.
        bright: (n,) whether the square between the next column and the next row is the bright one.
    """

    pixels: Float[ndarray, "n 2"]
    cells: Int[ndarray, "n 2"]
    bright: ndarray

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows that the cells reach over."""
        columns, rows = self.cells.max(0) + 1
        return int(columns), int(rows)


def lattices(points: SaddlePoints, longest_step: float = LONGEST_STEP) -> list[CornerLattice]:
    """What hangs together, the most corners first.

    Args:
        points: corners of four squares.
        longest_step: a link is at most so many times as long as the next one of its line.
    """
    if len(points.pixels) < FEWEST_LATTICE_CORNERS:
        return []
    links = _single_steps(_mutual(_neighbours(points)), points.pixels, longest_step)
    left, count = np.ones(len(links), dtype=bool), (links >= 0).sum(1)
    listed, edges = links.tolist(), points.edges.tolist()
    found = []
    for seed in np.argsort(-count, kind="stable").tolist():
        if left[seed] and count[seed] >= 2:
            members, cells = _spread(listed, edges, seed, left)
            left[members] = False
            if len(members) >= FEWEST_LATTICE_CORNERS:
                found.append(_lattice(points, members, cells))
    return sorted(found, key=lambda lattice: -len(lattice.pixels))


def _neighbours(points: SaddlePoints) -> Int[ndarray, "n 4"]:
    """For each corner the nearest fitting one along the first edge, the second, and back along both; -1:
    none.
    """
    pixels, count = points.pixels.astype(np.float32), len(points.pixels)
    few = min(NEIGHBOUR_CANDIDATES, count - 1)
    square = (pixels * pixels).sum(1)
    apart = square[:, None] + square - 2.0 * pixels @ pixels.T
    np.fill_diagonal(apart, np.inf)
    rows, others = np.nonzero(apart <= np.partition(apart, few - 1, axis=1)[:, few - 1 : few])
    turns = np.exp(2j * points.edges)  # the same for both directions along an edge
    alike = (turns[others, ::-1] * turns[rows].conj()).real.min(1) > np.cos(2.0 * WIDEST_TURN)
    rows, others = rows[alike], others[alike]
    step = pixels[others] - pixels[rows]
    heading, far = np.arctan2(step[:, 1], step[:, 0]), np.hypot(step[:, 0], step[:, 1])
    off = np.abs((heading - points.edges[rows].T + np.pi) % (2 * np.pi) - np.pi)
    links = np.full((count, 4), -1)
    for way, turned in enumerate((*off, *(np.pi - off))):
        length = np.where(turned < WIDEST_TURN, far * (1.0 + turned), np.inf)
        least = np.full(count, np.inf)
        np.minimum.at(least, rows, length)
        nearest = (length == least[rows]) & (turned < WIDEST_TURN)
        links[rows[nearest], way] = others[nearest]
    return links


def _mutual(links: Int[ndarray, "n 4"]) -> Int[ndarray, "n 4"]:
    """The links that both ends have."""
    back = (links[links] == np.arange(len(links))[:, None, None]).any(-1)
    return np.where((links >= 0) & back, links, -1)


def _single_steps(
    links: Int[ndarray, "n 4"], pixels: Float[ndarray, "n 2"], longest: float
) -> Int[ndarray, "n 4"]:
    """The links without those that leap over corners that are not seen, as behind a mark: they are much
    longer than the next link of their line.
    """
    length = np.where(links >= 0, np.linalg.norm(pixels[links] - pixels[:, None], axis=-1), np.inf)
    return _mutual(np.where(length > longest * np.roll(length, 2, axis=1), -1, links))


def _spread(
    links: list[list[int]], edges: list[list[float]], seed: int, left: ndarray
) -> tuple[Int[ndarray, " k"], Int[ndarray, "k 2"]]:
    """All that can be reached from a corner, with its cell; the seed's first edge is the direction of
    columns.
    """
    along = {seed: edges[seed][0]}  # the direction of columns at each corner, 0 to 2 pi
    down = {seed: edges[seed][1]}
    cell = {seed: (0, 0)}
    taken = {(0, 0): seed}
    queue = [seed]
    for here in queue:
        for other, direction in zip(links[here], _both_ways(edges[here]), strict=True):
            if other < 0 or not left[other] or other in cell:
                continue
            a, d = cos(direction - along[here]), cos(direction - down[here])
            step = (1 if a > 0 else -1, 0) if abs(a) > abs(d) else (0, 1 if d > 0 else -1)
            place = (cell[here][0] + step[0], cell[here][1] + step[1])
            if place in taken:
                continue
            cell[other], taken[place] = place, other
            along[other] = _nearest_direction(edges[other], along[here])
            down[other] = _nearest_direction(edges[other], down[here])
            queue.append(other)
    members = np.array(queue)
    return members, np.array([cell[i] for i in queue])


def _nearest_direction(edges: list[float], wanted: float) -> float:
    """The direction along one of the edges, either way, nearest to the wanted one."""
    first, second = edges
    one, other = cos(first - wanted), cos(second - wanted)
    way, towards = (first, one) if abs(one) >= abs(other) else (second, other)
    return way if towards > 0 else way + pi


def _both_ways(edges: list[float]) -> tuple[float, float, float, float]:
    """The directions along both edges, and back along both."""
    first, second = edges
    return first, second, first + pi, second + pi


def _lattice(points: SaddlePoints, members: ndarray, cells: ndarray) -> CornerLattice:
    """The lattice, turned so that rows follow columns as y follows x."""
    seed = points.edges[members[0]]
    flipped = np.sin(seed[1] - seed[0]) < 0  # the seed's edges are its directions of columns and rows
    if flipped:
        cells = cells * [1, -1]
    cells = cells - cells.min(0)
    even = (cells - cells[0]).sum(
        1
    ) % 2 == 0  # the seed's bright square lies from its first edge to its second
    by_rows = np.lexsort(cells.T)
    return CornerLattice(points.pixels[members[by_rows]], cells[by_rows], even[by_rows])
