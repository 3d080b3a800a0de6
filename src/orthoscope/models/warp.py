"""A smooth map of the plane with its derivatives, and its inverse by Newton's method.

Floor 1.  (x, y) goes to (x_d, y_d); J is the map's Jacobian, its determinant positive all over the domain.  `invert` goes twice over
what it has to find: briskly from a start that is near, then, for what was lost, patiently from the centre.  The patient way follows
Newton's flow
    dx/dt = -J^-1 (f(x) - x_d),
along which f(x) runs straight from f(0) = 0 to (x_d, y_d), with steps that are cut until they stay in the domain and come nearer; next
to a fold, where Newton only halves its error, it still arrives.  P. Deuflhard, Newton Methods for Nonlinear Problems, 2004, chapter 3.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from orthoscope.geometry.arrays import ndarray

__all__ = ["Warp", "determinant", "invert"]

NEAR = 1e-9  # a Newton step shorter than this leaves an error below 1e-16, since the error squares
STEPS, PATIENCE = 12, 200


class Warp(NamedTuple):
    """A distorted place with its derivatives: j_xy is d x_d / d y; by[i] is d(x_d, y_d) by the i-th coefficient asked for."""

    x: ndarray
    y: ndarray
    j_xx: ndarray
    j_xy: ndarray
    j_yx: ndarray
    j_yy: ndarray
    by: list[tuple[ndarray, ndarray]]


Place = tuple[ndarray, ndarray]
Linearise = Callable[[ndarray, ndarray], Warp]
Sees = Callable[[ndarray, ndarray], ndarray]


def determinant(at: Warp) -> ndarray:
    """det J: the area that a small area becomes; not positive where the map has folded."""
    return at.j_xx * at.j_yy - at.j_xy * at.j_yx


def invert(linearise: Linearise, sees: Sees, start: Place, goal: Place) -> Place:
    """The places that the map takes to `goal`; NaN where there is none in the domain, and where `start` is NaN.

    linearise: the map.  sees: which places lie in its domain.  start: places near the ones to be found.
    """
    with np.errstate(all="ignore"):
        x, y, there = _briskly(linearise, start, goal)
        lost = np.flatnonzero(~(there & sees(x, y)))
        x[lost] = np.nan
        again = lost[np.isfinite(start[0][lost])]
        if len(again):
            a, b, there = _patiently(linearise, sees, (goal[0][again], goal[1][again]))
            x[again], y[again] = np.where(there & sees(a, b), a, np.nan), b
    return x, y


def _briskly(linearise: Linearise, start: Place, goal: Place) -> tuple[ndarray, ndarray, ndarray]:
    """Where a few Newton steps lead, and whether the last of them was short."""
    x, y, moving = _advance(linearise, start, goal)
    x, y, moving = _advance(linearise, (x, y), goal)
    active = np.flatnonzero(moving)
    for _ in range(STEPS):
        if not len(active):
            break
        x[active], y[active], still = _advance(linearise, (x[active], y[active]), (goal[0][active], goal[1][active]))
        moving[active] = still
        active = active[still]
    return x, y, ~moving


def _advance(linearise: Linearise, place: Place, goal: Place) -> tuple[ndarray, ndarray, ndarray]:
    """The next place, by one step (shortened where it would leap, as beside a fold), and whether another is needed."""
    x, y = place
    step_x, step_y, size = _step(linearise(x, y), goal)
    far = x * x + y * y
    leaping = size > 0.25 * (0.01 + far)
    if leaping.any():
        shorten = np.where(leaping, np.sqrt(0.25 * (0.01 + far) / size), 1.0)
        step_x, step_y = shorten * step_x, shorten * step_y
    return x - step_x, y - step_y, ~(size <= NEAR * NEAR * (1.0 + far))


def _step(at: Warp, goal: Place) -> tuple[ndarray, ndarray, ndarray]:
    """Newton's step, to be taken away from the place, and its length squared."""
    e_x, e_y = at.x - goal[0], at.y - goal[1]
    inverse = 1.0 / determinant(at)
    step_x = (at.j_yy * e_x - at.j_xy * e_y) * inverse
    step_y = (at.j_xx * e_y - at.j_yx * e_x) * inverse
    return step_x, step_y, step_x * step_x + step_y * step_y


def _patiently(linearise: Linearise, sees: Sees, goal: Place) -> tuple[ndarray, ndarray, ndarray]:
    """Where cut steps from the centre lead, and whether that is as near as numbers go, in the image or in the place."""
    x, y, cut = (np.zeros_like(goal[0]) for _ in range(3))
    cut += 1.0
    active = np.arange(len(x))
    for _ in range(PATIENCE):
        a, b, aim = x[active], y[active], (goal[0][active], goal[1][active])
        at = linearise(a, b)
        step_x, step_y, size = _step(at, aim)
        next_a, next_b = a - cut[active] * step_x, b - cut[active] * step_y
        good = sees(next_a, next_b) & (_error(linearise(next_a, next_b), aim) < _error(at, aim))
        x[active[good]], y[active[good]] = next_a[good], next_b[good]
        cut[active] = np.where(good, np.minimum(1.0, 2.0 * cut[active]), 0.25 * cut[active])
        active = active[(cut[active] > 1e-12) & (size > 1e-30 * (1.0 + a * a + b * b))]
        if not len(active):
            break
    at = linearise(x, y)
    far = goal[0] ** 2 + goal[1] ** 2
    return x, y, (_error(at, goal) <= 1e-28 * (1.0 + far)) | (_step(at, goal)[2] <= NEAR * NEAR * (1.0 + x * x + y * y))


def _error(at: Warp, goal: Place) -> ndarray:
    return (at.x - goal[0]) ** 2 + (at.y - goal[1]) ** 2
