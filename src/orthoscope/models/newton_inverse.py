"""A smooth map of the plane with its derivatives, and its inverse by Newton's method.

(x, y) goes to (x_d, y_d); J is the map's Jacobian, its determinant positive all over the domain. `invert` has
three ways, each for what the one before has not settled: lightly, briskly and patiently.

Lightly: a Newton step in single precision, which costs half, brings a near start x0 to x1; from there chords,
steps with the Jacobian J(x1), in which only the error f(x) - x_d needs double precision. A chord leaves of
the distance to the goal a share that is about the same for all of them, so two chords, a and b long, tell
what is left: a share b/a of b. Briskly: Newton steps from the start. Patiently: Newton's flow from the
centre,
    dx/dt = -J^-1 (f(x) - x_d),
along which f(x) runs straight from f(0) = 0 to (x_d, y_d), with steps that are cut until they stay in the
domain and come nearer; next to a fold, where Newton only halves its error, it still arrives. P. Deuflhard,
Newton Methods for Nonlinear Problems, 2004, chapter 3.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from orthoscope.geometry.arrays import ndarray

__all__ = ["Bent", "Warp", "determinant", "invert"]

LEFT = 1e-13  # what two chords may leave, and places that they leave more of go on to Newton
CLOSE = 1e-6  # after chords that have come down to this Newton goes on where they ended
NEAR = 1e-9  # a Newton step shorter than this leaves an error below 1e-16, since the error squares
STEPS, PATIENCE = 12, 200


class Bent(NamedTuple):
    """Places of a plane before a displacement bent it, and the slopes of the displacement there: s_xy is d
    s_x / d y.
    """

    x: ndarray
    y: ndarray
    s_xx: ndarray
    s_xy: ndarray
    s_yx: ndarray
    s_yy: ndarray


class Warp(NamedTuple):
    """A distorted place with its derivatives: j_xy is d x_d / d y; by[i] is d(x_d, y_d) by the i-th
    coefficient asked for.

    bent: of a lens that displaces the plane of another; None of a formula.
    """

    x: ndarray
    y: ndarray
    j_xx: ndarray
    j_xy: ndarray
    j_yx: ndarray
    j_yy: ndarray
    by: list[tuple[ndarray, ndarray]]
    bent: Bent | None = None


Place = tuple[ndarray, ndarray]
Formula = Callable[[ndarray, ndarray], Place]
Linearise = Callable[[ndarray, ndarray], Warp]
Sees = Callable[[ndarray, ndarray], ndarray]


def determinant(at: Warp) -> ndarray:
    """det J: the area that a small area becomes; not positive where the map has folded."""
    return at.j_xx * at.j_yy - at.j_xy * at.j_yx


def invert(
    linearise: Linearise, sees: Sees, start: Place, goal: Place, *, formula: Formula | None = None
) -> Place:
    """The places that the map takes to `goal`; NaN where there is none in the domain, and where `start` is
    NaN.

    linearise: the map; also asked in single precision, where it need not answer in it. sees: which places lie
    in its domain. start: places near the ones to be found, in either precision. formula: the map without
    derivatives, where that is cheaper.
    """
    with np.errstate(all="ignore"):
        x, y, there, close = _lightly(formula or _plain(linearise), linearise, start, goal)
        slow = np.flatnonzero(~there & np.isfinite(start[0]))
        if len(slow):
            near = np.where(close[slow], (x[slow], y[slow]), (start[0][slow], start[1][slow]))
            x[slow], y[slow], there[slow] = _briskly(
                linearise, (near[0], near[1]), (goal[0][slow], goal[1][slow])
            )
        lost = np.flatnonzero(~(there & sees(x, y)))
        x[lost] = np.nan
        again = lost[np.isfinite(start[0][lost])]
        if len(again):
            a, b, there = _patiently(linearise, sees, (goal[0][again], goal[1][again]))
            x[again], y[again] = np.where(there & sees(a, b), a, np.nan), b
    return x, y


def _plain(linearise: Linearise) -> Formula:
    return lambda x, y: linearise(x, y)[:2]


def _lightly(
    formula: Formula, linearise: Linearise, start: Place, goal: Place
) -> tuple[ndarray, ndarray, ndarray, ndarray]:
    """Where a step in single precision and two chords lead, whether that is near enough, and whether it is a
    nearer start.
    """
    x, y = _single(start)
    step_x, step_y, _ = _step(linearise(x, y), _single(goal))
    x, y = x - step_x, y - step_y
    at = linearise(x, y)
    inverse = 1.0 / determinant(at)
    along = at.j_yy * inverse, at.j_xy * inverse, at.j_yx * inverse, at.j_xx * inverse
    x, y = x.astype(float), y.astype(float)
    step_x, step_y, first = _chord(formula(x, y), goal, along)
    x -= step_x
    y -= step_y
    step_x, step_y, second = _chord(formula(x, y), goal, along)
    there = (second * second <= LEFT * LEFT * first) & (
        inverse > 0
    )  # lengths squared, so squares of squares; 0 is an overflow
    x -= step_x
    y -= step_y
    return x, y, there, second <= CLOSE * CLOSE


def _chord(
    image: Place, goal: Place, along: tuple[ndarray, ndarray, ndarray, ndarray]
) -> tuple[ndarray, ndarray, ndarray]:
    """A Newton step with a Jacobian from nearby, to be taken away from the place, and its length squared."""
    j_yy, j_xy, j_yx, j_xx = along
    e_x, e_y = _single((image[0] - goal[0], image[1] - goal[1]))
    step_x, step_y = j_yy * e_x - j_xy * e_y, j_xx * e_y - j_yx * e_x
    return step_x, step_y, step_x * step_x + step_y * step_y


def _single(place: Place) -> Place:
    return place[0].astype(np.float32, copy=False), place[1].astype(np.float32, copy=False)


def _briskly(linearise: Linearise, start: Place, goal: Place) -> tuple[ndarray, ndarray, ndarray]:
    """Where a few Newton steps lead, and whether the last of them was short."""
    x, y, moving = _advance(linearise, start, goal)
    active = np.flatnonzero(moving)
    for _ in range(STEPS):
        if not len(active):
            break
        x[active], y[active], still = _advance(
            linearise, (x[active], y[active]), (goal[0][active], goal[1][active])
        )
        moving[active] = still
        active = active[still]
    return x, y, ~moving


def _advance(linearise: Linearise, place: Place, goal: Place) -> tuple[ndarray, ndarray, ndarray]:
    """The next place, by one step (shortened where it would leap, as beside a fold), and whether another is
    needed.
    """
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
    """Where cut steps from the centre lead, and whether that is as near as numbers go, in the image or in the
    place.
    """
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
    return (
        x,
        y,
        (_error(at, goal) <= 1e-28 * (1.0 + far))
        | (_step(at, goal)[2] <= NEAR * NEAR * (1.0 + x * x + y * y)),
    )


def _error(at: Warp, goal: Place) -> ndarray:
    return (at.x - goal[0]) ** 2 + (at.y - goal[1]) ** 2
