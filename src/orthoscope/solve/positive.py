"""The inverse of a symmetric positive matrix, by Cholesky's factor.

A = L L',  A^-1 = L^-T L^-1.  numpy has no routine for the inverse of a triangle; halves give it with products
alone, which BLAS does three times as fast as the general inverse of these sizes:

    [ L1  0  ]^-1   [      L1^-1            0    ]        [ L1  0  ]' [ L1  0  ]   [ L1'L1 + M'M   M'L2  ]
    [ M   L2 ]    = [ -L2^-1 M L1^-1      L2^-1  ]        [ M   L2 ]  [ M   L2 ] = [     L2'M      L2'L2 ]
"""

from __future__ import annotations

import numpy as np

from orthoscope.geometry.arrays import Float, ndarray

__all__ = ["positive_inverse"]

# This is added to a scaled system's diagonal before it is inverted.
ROUNDING_SHARE = 1e-13
# A triangle of so many rows is left to the general routines.
SMALL_SIDE = 48


def positive_inverse(matrix: Float[ndarray, "n n"]) -> Float[ndarray, "n n"]:
    """Of a symmetric positive system, whatever its units; symmetric.

    Raises:
        LinAlgError: the matrix is singular.
    """
    scale = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = matrix * scale
    scaled *= scale[:, None]
    scaled[np.diag_indices_from(scaled)] += ROUNDING_SHARE
    try:
        lower = np.linalg.cholesky(scaled)
    except np.linalg.LinAlgError:  # not positive, as far as numbers go
        inverse = np.linalg.inv(scaled)
        return 0.5 * (inverse + inverse.T) * scale * scale[:, None]
    _invert_triangle(lower)
    lower *= scale
    _square_triangle(lower, into=scaled)
    return scaled


def _invert_triangle(lower: Float[ndarray, "n n"]) -> None:
    """In its place."""
    n = len(lower)
    if n <= SMALL_SIDE:
        lower[:] = np.linalg.inv(lower)
        return
    half = n // 2
    first, below, second = lower[:half, :half], lower[half:, :half], lower[half:, half:]
    _invert_triangle(first)
    _invert_triangle(second)
    below[:] = -(second @ below) @ first


def _square_triangle(lower: Float[ndarray, "n n"], *, into: Float[ndarray, "n n"]) -> None:
    """L'L."""
    n = len(lower)
    if n <= SMALL_SIDE:
        np.matmul(lower.T, lower, out=into)
        return
    half = n // 2
    first, below, second = lower[:half, :half], lower[half:, :half], lower[half:, half:]
    _square_triangle(first, into=into[:half, :half])
    into[:half, :half] += below.T @ below
    _square_triangle(second, into=into[half:, half:])
    np.matmul(second.T, below, out=into[half:, :half])
    into[:half, half:] = into[half:, :half].T
