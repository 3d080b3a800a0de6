"""What changes evenly over a picture, told by all discs together: light, and the shape of outlines."""

from __future__ import annotations

import numpy as np

from orthoscope.geometry.arrays import Float, median, ndarray

__all__ = ["FEWEST_EVEN", "even_shapes", "even_values", "in_a_row"]

# Such a change is a polynomial of this order, of so many discs at least;
# fewer do not tell.
EVEN_ORDERS = (3, 36), (2, 20), (1, 12), (0, 6)
FEWEST_EVEN = EVEN_ORDERS[-1][1]


def in_a_row(matrices: Float[ndarray, "n 2 2"]) -> Float[ndarray, "n 3"]:
    """The three numbers of each of some symmetric matrices."""
    return matrices[:, [0, 0, 1], [0, 1, 1]]


def even_values(places: Float[ndarray, "n 2"], values: Float[ndarray, "n k"]) -> Float[ndarray, "n k"]:
    """Values that change evenly over the picture, through most of these; of few discs these."""
    count = len(places)
    if count < FEWEST_EVEN:
        return values
    x, y = ((places - places.mean(0)) / np.ptp(places, axis=0).max()).T
    order = next(order for order, fewest in EVEN_ORDERS if count >= fewest)
    terms = np.stack([x**i * y**j for i in range(order + 1) for j in range(order + 1 - i)], axis=1)
    good, even = np.ones(count, dtype=bool), values
    for _ in range(2):
        even = terms @ np.linalg.lstsq(terms[good], values[good], rcond=None)[0]
        off = np.linalg.norm(values - even, axis=1)
        good = off <= 3.0 * median(off)
    return even


def even_shapes(centres: Float[ndarray, "n 2"], axes: Float[ndarray, "n 2 2"]) -> Float[ndarray, "n 2 2"]:
    """The outline of each disc as all foresee it: logarithms change evenly where a board is far and near."""
    values, turns = np.linalg.eigh(axes)
    logarithms = np.einsum("nij,nj,nkj->nik", turns, np.log(values), turns)
    even = even_values(centres, in_a_row(logarithms))
    values, turns = np.linalg.eigh(even[:, [0, 1, 1, 2]].reshape(-1, 2, 2))
    return np.einsum("nij,nj,nkj->nik", turns, np.exp(values), turns)
