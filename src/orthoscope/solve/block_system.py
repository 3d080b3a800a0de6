"""Normal equations of one shared block and one block for each view: the step that they tell, where it leads,
and how well the shared unknowns are known.

With s the shared step, v_j the step of view j, and sums over all measurements (weighted by the loss):

    [ A    B_1 ... B_m ] [ s  ]     [ a   ]        A = S^T S,  B_j = S^T V_j,  C_j = V_j^T V_j,
    [ B_1' C_1         ] [ v_1]  = -[ c_1 ]        a = S^T e,  c_j = V_j^T e
    [ ...        ...   ] [ ...]     [ ... ]

The views are eliminated: (A - sum B_j C_j^-1 B_j') s = -(a - sum B_j C_j^-1 c_j), then v_j = -C_j^-1 (c_j +
B_j' s). Damping adds lambda times the diagonal (D. Marquardt, 1963) or times the identity (K. Levenberg,
1944).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from orthoscope.geometry.arrays import Float, ndarray

__all__ = [
    "NormalEquations",
    "after_step",
    "blocks_times",
    "damped_step",
    "eliminated",
    "inverse_roots",
    "shared_covariance",
    "side_by_side",
]

# An eigenvalue of the scaled shared system that is no larger is rounding: nothing was measured there.
LARGEST_OPEN_EIGENVALUE = 1e-14
# Views are eliminated so many numbers at a time (16 MB).
NUMBERS_AT_ONCE = 1 << 21
# Blocks of more unknowns are not inverted, and solved so many rows at a time.
WIDEST_INVERTED = 64
# An unknown that has at least this share (squared) in such a direction is open too.
OPEN_SHARE = 1e-8


class NormalEquations(NamedTuple):
    """The sums at one place, as in the module's docstring.

    There may be no views (m = 0), no shared unknowns (k = 0) and view blocks of any width p.

    Attributes:
        cost: the sum of rho over all measurements, in the residual's unit squared.
        A: shared with shared unknowns, (k,k).
        a: shared unknowns with the residuals, (k,).
        B: shared with each view's unknowns, (m,k,p).
        C: each view's unknowns with themselves, (m,p,p).
        c: each view's unknowns with the residuals, (m,p).
    """

    cost: float
    A: Float[ndarray, "k k"]
    a: Float[ndarray, " k"]
    B: Float[ndarray, "m k p"]
    C: Float[ndarray, "m p p"]
    c: Float[ndarray, "m p"]


def damped_step(sums: NormalEquations, damping: float, damp: str) -> tuple[ndarray, ndarray, float]:
    """Shared step, view steps and what the quadratic model promises to take off the cost; NaN for no step."""
    of_shared, of_views = damping * _weights(sums.A, damp), damping * _weights(sums.C, damp)
    C = sums.C + of_views[:, :, None] * np.eye(sums.C.shape[2])
    try:
        system, solved = (_with_triangles if C.shape[2] > WIDEST_INVERTED else _with_inverses)(sums, C)
        system[np.diag_indices_from(system)] += of_shared
        B = side_by_side(sums.B)
        shared = -np.linalg.solve(system, sums.a - B @ solved(sums.c).T.ravel())
    except np.linalg.LinAlgError:  # singular as far as numbers go
        return np.zeros_like(sums.a), np.zeros_like(sums.c), float("nan")
    views = -solved(sums.c + (shared @ B).reshape(sums.c.T.shape).T)
    damped = of_shared @ shared**2 + (of_views * views**2).sum()
    return shared, views, float(-(sums.a @ shared) - (sums.c * views).sum() + damped)


def after_step(
    sums: NormalEquations, shared: Float[ndarray, " k"], views: Float[ndarray, "m p"]
) -> NormalEquations:
    """The sums where a step leads, as far as residuals are linear.

    Args:
        sums: those before it.
        shared: the shared step, (k,).
        views: each view's step, (m,p).
    """
    B = side_by_side(sums.B)
    a = sums.a + sums.A @ shared + B @ views.T.ravel()
    c = sums.c + (shared @ B).reshape(views.T.shape).T + (sums.C @ views[:, :, None])[:, :, 0]
    cost = sums.cost + float((sums.a + a) @ shared + ((sums.c + c) * views).sum())
    return sums._replace(cost=cost, a=a, c=c)


def shared_covariance(sums: NormalEquations, measurements: int) -> Float[ndarray, "k k"]:
    """Covariance of the shared unknowns for noise as large as the residuals found.

    The variance of the noise is cost / (measurements - unknowns).

    Args:
        sums: those at the solution.
        measurements: how many numbers were measured (two for each corner).
    Returns:
        (k,k); rows and columns of unknowns that the data leave open are infinite.
    """
    unknowns = sums.a.size + sums.c.size
    variance = sums.cost / max(measurements - unknowns, 1)
    # Conditioning is judged between unknowns of like size.
    scale = np.sqrt(_weights(sums.A, "diagonal"))
    values, vectors = np.linalg.eigh(eliminated(sums, _open_roots(sums.C)) / np.outer(scale, scale))
    covariance = (
        variance
        * (vectors / np.maximum(values, LARGEST_OPEN_EIGENVALUE))
        @ vectors.T
        / np.outer(scale, scale)
    )
    is_open = (vectors[:, values <= LARGEST_OPEN_EIGENVALUE] ** 2).sum(1) > OPEN_SHARE
    covariance[is_open] = covariance[:, is_open] = np.inf
    return covariance


def _with_inverses(
    sums: NormalEquations, C: Float[ndarray, "m p p"]
) -> tuple[ndarray, Callable[[ndarray], ndarray]]:
    """The shared system, and what takes (m,p) to C^-1 of it, by the inverse of each block.

    Raises:
        LinAlgError: a block is not positive, as far as numbers go.
    """
    roots = inverse_roots(C)
    inverse = roots @ roots.transpose(0, 2, 1)
    return eliminated(sums, roots), lambda right: (inverse @ right[:, :, None])[:, :, 0]


def _with_triangles(
    sums: NormalEquations, C: Float[ndarray, "m p p"]
) -> tuple[ndarray, Callable[[ndarray], ndarray]]:
    """The same for wide blocks, of which an inverse takes many times the work that a few solutions take.

    Raises:
        LinAlgError: a block is not positive, as far as numbers go.
    """
    L = np.linalg.cholesky(C)
    system = sums.A - (sums.B @ _by_triangles(L, sums.B.transpose(0, 2, 1))).sum(0)
    return system, lambda right: _by_triangles(L, right[:, :, None])[:, :, 0]


def _by_triangles(L: Float[ndarray, "m p p"], right: Float[ndarray, "m p r"]) -> Float[ndarray, "m p r"]:
    """C^-1 right of each block C = L L', forwards and backwards, some rows at a time."""
    solved, starts = right.copy(), range(0, L.shape[1], WIDEST_INVERTED)
    for start in starts:
        rows = slice(start, start + WIDEST_INVERTED)
        solved[:, rows] -= L[:, rows, :start] @ solved[:, :start]
        solved[:, rows] = np.linalg.solve(L[:, rows, rows], solved[:, rows])
    for start in reversed(starts):
        rows, after = slice(start, start + WIDEST_INVERTED), slice(start + WIDEST_INVERTED, None)
        solved[:, rows] -= L[:, after, rows].transpose(0, 2, 1) @ solved[:, after]
        solved[:, rows] = np.linalg.solve(L[:, rows, rows].transpose(0, 2, 1), solved[:, rows])
    return solved


def eliminated(sums: NormalEquations, roots: Float[ndarray, "m p p"]) -> Float[ndarray, "k k"]:
    """The shared system after the views are eliminated: a matrix times its own transpose, half the work of
    a product.

    Args:
        sums: of which A and B are used.
        roots: G of each view, C^-1 = G G'.
    """
    m, k, p = sums.B.shape
    left = sums.A.copy()
    at_once = max(1, NUMBERS_AT_ONCE // max(k * p, 1))
    for start in range(0, m, at_once):
        some = slice(start, start + at_once)
        W = blocks_times(sums.B[some], roots[some]).reshape(k, p * len(roots[some]))
        left -= W @ W.T
    return left


def side_by_side(B: Float[ndarray, "m k p"]) -> Float[ndarray, "k c"]:
    """All blocks beside each other, the first column of each first; no copy where they are stored so."""
    m, k, p = B.shape
    return B.transpose(1, 2, 0).reshape(k, p * m)


def blocks_times(B: Float[ndarray, "m k p"], G: Float[ndarray, "m p p"]) -> Float[ndarray, "k p m"]:
    """B G of every block, laid out as `side_by_side` wants it: all blocks at once, entry by entry."""
    factors = np.ascontiguousarray(G.transpose(1, 2, 0))
    return np.einsum("kim,ijm->kjm", B.transpose(1, 2, 0), factors)


def inverse_roots(C: Float[ndarray, "m p p"]) -> Float[ndarray, "m p p"]:
    """G of each block, C^-1 = G G'.

    Raises:
        LinAlgError: a block is not positive, as far as numbers go.
    """
    return np.linalg.inv(np.linalg.cholesky(C)).transpose(0, 2, 1)


def _open_roots(C: Float[ndarray, "m p p"]) -> Float[ndarray, "m p p"]:
    """G of each block, C^-1 = G G'; where nothing was measured, of what rounding would measure there."""
    scale = np.sqrt(_weights(C, "diagonal"))
    values, vectors = np.linalg.eigh(C / (scale[:, :, None] * scale[:, None, :]))
    return vectors / scale[:, :, None] / np.sqrt(np.maximum(values, LARGEST_OPEN_EIGENVALUE))[:, None]


def _weights(block: ndarray, damp: str) -> ndarray:
    """What damping is multiplied by on the diagonal of a block, or of each of a stack of blocks."""
    diagonal = np.diagonal(block, axis1=-2, axis2=-1)
    return np.maximum(diagonal, 1e-12) if damp == "diagonal" else np.ones_like(diagonal)
