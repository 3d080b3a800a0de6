"""A grid of corners as it lies in the picture: its local directions, how its lines bend, and where it stops
being a grid.

At each corner a cubic is laid through the nearest four of its row, and of its column: its slope is one square
in pixels, its second derivative how a straight edge bends there (a lens does that). A parabola fitted to the
nearest five says whether a corner is on its neighbours' line: one that lies far from it has been mistaken for
something else.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from orthoscope.geometry.arrays import Float, ndarray

__all__ = ["GridShape", "cross", "grid_shape", "nearest_neighbour", "one_line_more"]

EXACT = (4, 3)  # corners of a line and degree: through these the polynomial goes
SMOOTH = (5, 2)  # and between these


class GridShape(NamedTuple):
    """At each of m corners, row by row.

    along, down: (m,2) one square along the row and along the column, pixels. bend_along, bend_down: (m,)
    curvature of those lines, 1/px, positive towards +90 degrees (from x to y) of their direction. stray: (m,)
    distance from its neighbours' lines, in squares.
    """

    along: Float[ndarray, "m 2"]
    down: Float[ndarray, "m 2"]
    bend_along: Float[ndarray, " m"]
    bend_down: Float[ndarray, " m"]
    stray: Float[ndarray, " m"]


def grid_shape(corners: Float[ndarray, "m 2"], columns: int, rows: int) -> GridShape:
    """The shape of a grid of corners, pixels, row by row."""
    grid = corners.reshape(rows, columns, 2)
    _, along, turn_along = np.einsum("kij,rjc->kric", _polynomials(columns, *EXACT), grid).reshape(3, -1, 2)
    _, down, turn_down = np.einsum("kij,jsc->kisc", _polynomials(rows, *EXACT), grid).reshape(3, -1, 2)
    on_row = np.einsum("ij,rjc->ric", _polynomials(columns, *SMOOTH)[0], grid).reshape(-1, 2)
    on_column = np.einsum("ij,jsc->isc", _polynomials(rows, *SMOOTH)[0], grid).reshape(-1, 2)
    square = np.maximum(np.minimum(np.hypot(*along.T), np.hypot(*down.T)), 1e-9)
    stray = np.maximum(np.hypot(*(corners - on_row).T), np.hypot(*(corners - on_column).T)) / square
    return GridShape(along, down, _curvature(along, turn_along), _curvature(down, turn_down), stray)


def nearest_neighbour(corners: Float[ndarray, "m 2"], columns: int, rows: int) -> Float[ndarray, " m"]:
    """The distance from each corner to the nearest of the corners next to it in its row and column,
    pixels.
    """
    grid = corners.reshape(rows, columns, 2)
    nearest = np.full((rows, columns), np.inf)
    for axis in (0, 1):
        gaps = np.sqrt((np.diff(grid, axis=axis) ** 2).sum(-1))
        ends = np.full_like(np.take(gaps, [0], axis=axis), np.inf)
        nearest = np.minimum(nearest, np.concatenate([gaps, ends], axis=axis))
        nearest = np.minimum(nearest, np.concatenate([ends, gaps], axis=axis))
    return nearest.ravel()


def one_line_more(grid: Float[ndarray, "rows columns 2"]) -> Float[ndarray, "more columns 2"]:
    """The grid with one row more after its last, by the parabola through the last three of each column."""
    return np.concatenate([grid, 3.0 * grid[-1:] - 3.0 * grid[-2:-1] + grid[-3:-2]])


def cross(first: Float[ndarray, "*batch 2"], second: Float[ndarray, "*batch 2"]) -> Float[ndarray, "*batch"]:
    """The area between two vectors of the plane: positive where the second lies clockwise of the first on the
    screen (y down).
    """
    return first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]


def _curvature(slope: ndarray, turn: ndarray) -> ndarray:
    return cross(slope, turn) / np.maximum((slope * slope).sum(-1), 1e-9) ** 1.5


@cache
def _polynomials(count: int, nearest: int, degree: int) -> Float[ndarray, "3 count count"]:
    """Matrices from `count` points of a line to value, first and second derivative, at each, of a polynomial
    fitted to the nearest.
    """
    width = min(nearest, count)
    matrices = np.zeros((3, count, count))
    for i in range(count):
        first = min(max(i - (width - 1) // 2, 0), count - width)
        nearby = np.arange(first, first + width)
        powers = np.vander(nearby - i, min(degree, width - 1) + 1, increasing=True)
        matrices[:, i, nearby] = np.linalg.pinv(powers)[:3] * np.array([[1.0], [1.0], [2.0]])
    return matrices
