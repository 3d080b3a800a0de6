"""Sums over corners of the products of splines: with each other, with the columns of a linearised problem and
with the corners' own slopes.

A spline of the lattice is the product of one across and one down, each of which overlaps with few others.  So
the products of two splines are summed as the products of a pair across and a pair down, of which there are a
quarter as many; those with other columns are summed from the values of all splines, some views at a time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orthoscope.geometry.arrays import Float, Int, ndarray
from orthoscope.models.lenses.spline import SPLINES_ACROSS_CELL

__all__ = ["SplineSums", "spline_sums"]

# So many values are made at a time, to keep them in a core's cache.
VALUES_AT_ONCE = 1 << 16


class SplineSums(NamedTuple):
    """Sums over corners of the values of g splines, y-major.

    Attributes:
        square: (g,g) with each other.
        of_u, of_v: (v,g,c) with the columns of a stack, its rows for u and those for v, of each view.
        by_place: (2,g,3,p) with the slopes of u and of v by the places of corners, over views; none where no
            slopes were given.
    """

    square: Float[ndarray, "g g"]
    of_u: Float[ndarray, "v g c"]
    of_v: Float[ndarray, "v g c"]
    by_place: Float[ndarray, "h g 3 p"]


def spline_sums(
    across: Float[ndarray, "v p nx"],
    down: Float[ndarray, "v p ny"],
    stacked: Float[ndarray, "v c rows"],
    slopes: Float[ndarray, "v 3 2 p"] | None = None,
) -> SplineSums:
    """The sums.

    Args:
        across, down: values of the splines of each direction, weights in one of them.
        stacked: columns, all u first and then all v.
        slopes: by the place of each corner.
    """
    (views, corners, nx), ny, columns = across.shape, down.shape[2], stacked.shape[1]
    g, halves = nx * ny, stacked.reshape(views, columns, 2, corners)
    of, by = np.empty((2, views, g, columns)), np.zeros((0 if slopes is None else 2, g, 3, corners))
    (x_i, x_j), (y_i, y_j) = _overlapping(nx), _overlapping(ny)
    pairs = np.zeros((len(y_i), len(x_i)))
    at_once = max(1, VALUES_AT_ONCE // max(corners * g, 1))
    for start in range(0, views, at_once):
        some = slice(start, start + at_once)
        a, d = (np.ascontiguousarray(part[some].transpose(0, 2, 1)) for part in (across, down))
        pairs += ((d[:, y_i] * d[:, y_j]) @ (a[:, x_i] * a[:, x_j]).transpose(0, 2, 1)).sum(0)
        values = (d[:, :, None] * a[:, None]).reshape(len(a), g, corners)
        for half in (0, 1):
            of[half, some] = values @ halves[some, :, half].transpose(0, 2, 1)
            if slopes is not None:
                by[half] += np.einsum("vgp,vap->gap", values, slopes[some, :, half])
    square = np.zeros((ny, ny, nx, nx))
    for i, j in ((y_i, y_j), (y_j, y_i)):
        square[i[:, None], j[:, None], x_i, x_j] = square[i[:, None], j[:, None], x_j, x_i] = pairs
    return SplineSums(square.transpose(0, 2, 1, 3).reshape(g, g), of[0], of[1], by)


def _overlapping(splines: int) -> tuple[Int[ndarray, " o"], Int[ndarray, " o"]]:
    """Pairs of a direction's splines that are somewhere not zero together."""
    i, j = np.triu_indices(splines)
    near = j - i < SPLINES_ACROSS_CELL
    return i[near], j[near]
