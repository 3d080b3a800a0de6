"""Corners of a lattice as they lie in the picture: its local directions, how its lines bend, and where it
stops being a lattice.

Corners come with their places, column and row in steps of the lattice, so that it does not matter which of
them were found. At each a cubic is laid through the nearest four of its row, and of its column: its slope is
one step in pixels, its second derivative how a straight edge bends there (a lens does that). A parabola
fitted to the nearest five says whether a corner is on its neighbours' line: one that lies far from it has
been mistaken for something else.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from orthoscope.geometry.arrays import Float, ndarray

__all__ = [
    "GridShape",
    "cross",
    "filled",
    "grid_shape",
    "lattice",
    "nearest_neighbour",
    "one_line_more",
    "steps_of",
]

# Through so many corners of a line the polynomial of this degree goes exactly.
EXACT_FIT = (4, 3)
# Between so many corners of a line the polynomial of this degree goes smoothly.
SMOOTH_FIT = (5, 2)


class GridShape(NamedTuple):
    """At each of m corners.

    Attributes:
        along, down: (m,2) one step along the row and along the column, pixels.
        bend_along, bend_down: (m,) curvature of those lines, 1/px, positive towards +90 degrees (from x to y)
            of their direction.
        stray: (m,) distance from its neighbours' lines, in steps.
    """

    along: Float[ndarray, "m 2"]
    down: Float[ndarray, "m 2"]
    bend_along: Float[ndarray, " m"]
    bend_down: Float[ndarray, " m"]
    stray: Float[ndarray, " m"]

    def of(self, which: ndarray) -> GridShape:
        """At some of them."""
        return GridShape(*(part[which] for part in self))


@cache
def lattice(columns: int, rows: int) -> Float[ndarray, "m 2"]:
    """The places of a full grid, row by row."""
    row, column = np.mgrid[:rows, :columns].reshape(2, -1).astype(float)
    places = np.stack([column, row], axis=1)
    places.setflags(write=False)
    return places


def grid_shape(corners: Float[ndarray, "m 2"], places: Float[ndarray, "m 2"]) -> GridShape:
    """The shape of a lattice around corners, pixels, that are at these places of it."""
    along, turn_along, on_row = _along_lines(corners, places, 0)
    down, turn_down, on_column = _along_lines(corners, places, 1)
    step = np.maximum(np.minimum(np.hypot(*along.T), np.hypot(*down.T)), 1e-9)
    stray = np.maximum(np.hypot(*(corners - on_row).T), np.hypot(*(corners - on_column).T)) / step
    return GridShape(along, down, _curvature(along, turn_along), _curvature(down, turn_down), stray)


def steps_of(grid: Float[ndarray, "r c 2"]) -> tuple[Float[ndarray, "r c 2"], Float[ndarray, "r c 2"]]:
    """One step along the row and along the column at each corner of a full grid, pixels; as `grid_shape`
    gives them, sooner.
    """
    rows, columns = grid.shape[:2]
    along, down = (_slopes(count) for count in (columns, rows))
    return along @ grid, (down @ grid.reshape(rows, -1)).reshape(grid.shape)


@cache
def _slopes(count: int) -> Float[ndarray, "count count"]:
    """From the points of a whole line to their first derivatives; those of a point alone are 0."""
    return _polynomials(tuple(map(float, range(count))), *EXACT_FIT)[1]


def nearest_neighbour(corners: Float[ndarray, "m 2"], places: Float[ndarray, "m 2"]) -> Float[ndarray, " m"]:
    """The shortest step from each corner towards those next to it in its row and column, pixels."""
    if whole := _full(places):
        grid, gaps = corners.reshape(*whole, 2), np.full((whole[0] + 1, whole[1] + 1, 2), np.inf)
        gaps[:-1, 1:-1, 0] = np.hypot(*(grid[:, 1:] - grid[:, :-1]).transpose(2, 0, 1))
        gaps[1:-1, :-1, 1] = np.hypot(*(grid[1:] - grid[:-1]).transpose(2, 0, 1))
        along = np.minimum(gaps[:-1, 1:, 0], gaps[:-1, :-1, 0])
        return np.minimum(along, np.minimum(gaps[1:, :-1, 1], gaps[:-1, :-1, 1])).ravel()
    nearest = np.full(len(corners), np.inf)
    for axis in (0, 1):
        for line in _lines(places, axis):
            gaps = np.hypot(*np.diff(corners[line], axis=0).T) / np.diff(places[line, axis])
            np.minimum.at(nearest, line[:-1], gaps)
            np.minimum.at(nearest, line[1:], gaps)
    alone = ~np.isfinite(nearest)
    if alone.any():
        nearest[alone] = nearest[~alone].min() if (~alone).any() else 1.0
    return nearest


def one_line_more(grid: Float[ndarray, "rows columns 2"]) -> Float[ndarray, "more columns 2"]:
    """The grid with one row more after its last, by the parabola through the last three of each column."""
    return np.concatenate([grid, 3.0 * grid[-1:] - 3.0 * grid[-2:-1] + grid[-3:-2]])


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


def cross(first: Float[ndarray, "*batch 2"], second: Float[ndarray, "*batch 2"]) -> Float[ndarray, "*batch"]:
    """The area between two vectors of the plane: positive where the second lies clockwise of the first on the
    screen (y down).
    """
    return first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]


def _curvature(slope: ndarray, turn: ndarray) -> ndarray:
    return cross(slope, turn) / np.maximum((slope * slope).sum(-1), 1e-9) ** 1.5


def _along_lines(
    corners: Float[ndarray, "m 2"], places: Float[ndarray, "m 2"], axis: int
) -> tuple[Float[ndarray, "m 2"], Float[ndarray, "m 2"], Float[ndarray, "m 2"]]:
    """First and second derivative along the lattice's lines, and the place on the smooth line, of each
    corner.

    A corner that is alone on its line has the slope of the corner nearest to it that is not.
    """
    if whole := _full(places):
        grid = corners.reshape(*whole, 2)
        lines = grid.transpose(1, 0, 2) if axis else grid
        steps = tuple(map(float, range(lines.shape[1])))
        matrices = (*_polynomials(steps, *EXACT_FIT)[1:], _polynomials(steps, *SMOOTH_FIT)[0])
        told = (matrix @ lines for matrix in matrices)
        slope, turn, smooth = (one.transpose(1, 0, 2) if axis else one for one in told)
        return slope.reshape(-1, 2), turn.reshape(-1, 2), smooth.reshape(-1, 2)
    slope, turn, smooth = np.full_like(corners, np.nan), np.zeros_like(corners), corners.copy()
    groups: dict[tuple[float, ...], list[ndarray]] = {}
    for line in _lines(places, axis):
        groups.setdefault(tuple(places[line, axis]), []).append(line)
    for steps, lines in groups.items():
        which = np.stack(lines)
        if len(steps) > 1:
            _, slope[which], turn[which] = np.einsum(
                "kij,ljc->klic", _polynomials(steps, *EXACT_FIT), corners[which]
            )
            smooth[which] = np.einsum("ij,ljc->lic", _polynomials(steps, *SMOOTH_FIT)[0], corners[which])
    alone = np.isnan(slope[:, 0])
    if alone.all():
        return np.zeros_like(slope), turn, smooth
    if alone.any():
        apart = np.abs(places[alone, None] - places[~alone]).sum(-1)
        slope[alone] = slope[~alone][apart.argmin(1)]
    return slope, turn, smooth


def _full(places: Float[ndarray, "m 2"]) -> tuple[int, int] | None:
    """Rows and columns, two at least, of a full grid whose places stand row by row; None for any other."""
    if not len(places):
        return None
    columns, rows = (int(count) + 1 for count in places[-1] - places[0])
    if min(rows, columns) < 2 or rows * columns != len(places):
        return None
    return (rows, columns) if np.array_equal(places - places[0], lattice(columns, rows)) else None


def _lines(places: Float[ndarray, "m 2"], axis: int) -> list[ndarray]:
    """Indices of the corners of each row (axis 0) or column (axis 1), in order."""
    order = np.lexsort((places[:, axis], places[:, 1 - axis]))
    line = places[order, 1 - axis]
    ends = (np.flatnonzero(line[1:] != line[:-1]) + 1).tolist()
    return [order[start:end] for start, end in pairwise([0, *ends, len(order)])]


@cache
def _polynomials(places: tuple[float, ...], nearest: int, degree: int) -> Float[ndarray, "3 count count"]:
    """Matrices from the points of a line to value, first and second derivative, at each, of a polynomial
    fitted to the nearest.
    """
    count, at = len(places), np.array(places)
    width = min(nearest, count)
    matrices = np.zeros((3, count, count))
    for i in range(count):
        first = min(max(i - (width - 1) // 2, 0), count - width)
        nearby = np.arange(first, first + width)
        powers = np.vander(at[nearby] - at[i], min(degree, width - 1) + 1, increasing=True)
        inverse = np.linalg.pinv(powers)[:3]
        matrices[: len(inverse), i, nearby] = inverse * np.array([[1.0], [1.0], [2.0]])[: len(inverse)]
    return matrices
