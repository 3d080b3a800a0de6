"""Scores made white: what least squares on columns explains, and the rank of the columns, from one triangle.

G is the gram matrix of columns that are scaled to length 1, FAINT_SHARE I added: a direction that is as faint
as that counts as none. With G = L L^T and W = L^-1, the columns explain |W z|^2 of a residual whose products
with them are z, and their rank is the trace of (G - FAINT_SHARE I) G^-1. The first columns' block of W is
their own, whatever follows them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orthoscope.geometry.arrays import Float, Int, ndarray

__all__ = ["FAINT_SHARE", "Whitening"]

# What elimination leaves of a column is rounding when its squared share is no more.
FAINT_SHARE = 1e-8
# A triangle with no more columns is inverted as any matrix.
SMALL_SIZE = 64


class Whitening(NamedTuple):
    """Of columns: their lengths (c,), their gram matrix G (c,c) once they are scaled to length 1, and W
    (c,c).
    """

    lengths: Float[ndarray, " c"]
    gram: Float[ndarray, "c c"]
    white: Float[ndarray, "c c"]

    @classmethod
    def of(cls, gram: Float[ndarray, "c c"]) -> Whitening:
        """Of columns with this gram matrix."""
        squares = np.diag(gram)
        lengths = np.sqrt(np.where(squares > 0.0, squares, 1.0))
        scaled = gram / lengths[:, None]
        scaled /= lengths
        np.fill_diagonal(scaled, scaled.diagonal() + FAINT_SHARE)
        return cls(lengths, scaled, _white(scaled))

    def white_of(self, some: Int[ndarray, " s"]) -> Float[ndarray, "s s"]:
        """W of some of the columns alone."""
        if some[-1] == len(some) - 1:
            return self.white[: len(some), : len(some)]
        return _white(self.gram[np.ix_(some, some)])


def _white(gram: Float[ndarray, "c c"]) -> Float[ndarray, "c c"]:
    triangle = np.linalg.cholesky(gram)
    _invert(triangle)
    return triangle


def _invert(lower: Float[ndarray, "c c"]) -> None:
    """Makes a lower triangle its inverse, by halves."""
    if len(lower) <= SMALL_SIZE:
        lower[:] = np.linalg.inv(lower)
        return
    half = len(lower) // 2
    first, below, last = lower[:half, :half], lower[half:, :half], lower[half:, half:]
    _invert(first)
    _invert(last)
    below[:] = last @ (below @ -first)
