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

# Two chords may leave this much; places that they leave more of go on to Newton.
CHORD_REST = 1e-13
# Where the last chord is no longer than this Newton goes on where it ended, elsewhere from the start.
CHORD_CLOSENESS = 1e-6
# A Newton step shorter than this leaves an error below 1e-16, since the error squares.
LAST_NEWTON_STEP = 1e-9
# Free Newton is given this many steps.
NEWTON_STEPS = 12
# Newton's flow is given this many steps.
FLOW_STEPS = 200


class Bent(NamedTuple):
    """Places of a plane before a displacement bent it, and the slopes of the displacement there.

    Attributes:
        x: of the places.
        y: of the places.
        s_xx: d s_x / d x.
        s_xy: d s_x / d y.
        s_yx: d s_y / d x.
        s_yy: d s_y / d y.
    """

    x: ndarray
    y: ndarray
    s_xx: ndarray
    s_xy: ndarray
    s_yx: ndarray
    s_yy: ndarray


class Warp(NamedTuple):
    """Distorted places with their derivatives.

    Attributes:
        x: x_d of the places.
        y: y_d of the places.
        j_xx: d x_d / d x.
        j_xy: d x_d / d y.
        j_yx: d y_d / d x.
        j_yy: d y_d / d y.
        by: d(x_d, y_d) by each coefficient that was asked for.
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
PlaneMap = Callable[[ndarray, ndarray], Place]
Linearise = Callable[[ndarray, ndarray], Warp]
Sees = Callable[[ndarray, ndarray], ndarray]


def determinant(at: Warp) -> ndarray:
    """det J: the area that a small area becomes; not positive where the map has folded."""
    return at.j_xx * at.j_yy - at.j_xy * at.j_yx


def invert(
    linearise: Linearise, sees: Sees, start: Place, goal: Place, *, formula: PlaneMap | None = None
) -> Place:
    """The places that the map takes to a goal.

    Args:
        linearise: the map; also asked in single precision, where it need not answer in it.
        sees: which places lie in its domain.
        start: places near the ones to be found, in either precision.
        goal: what the map is to take them to.
        formula: the map without derivatives, where that is cheaper.
    Returns:
        Places; NaN where there is none in the domain, and where the start is NaN.
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


def _plain(linearise: Linearise) -> PlaneMap:
    """The map without its derivatives."""
    return lambda x, y: linearise(x, y)[:2]


def _lightly(
    formula: PlaneMap, linearise: Linearise, start: Place, goal: Place
) -> tuple[ndarray, ndarray, ndarray, ndarray]:
    """Where a step in single precision and two chords lead.

    Returns:
        x and y, whether that is near enough, and whether it is a nearer start.
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
    # These are lengths squared, so squares of squares; an inverse of 0 is an overflow.
    there = (second * second <= CHORD_REST * CHORD_REST * first) & (inverse > 0)
    x -= step_x
    y -= step_y
    return x, y, there, second <= CHORD_CLOSENESS * CHORD_CLOSENESS


def _chord(
    image: Place, goal: Place, along: tuple[ndarray, ndarray, ndarray, ndarray]
) -> tuple[ndarray, ndarray, ndarray]:
    """A step by a Jacobian from nearby, to be taken away from the place, and its length squared.

    Args:
        image: of the place.
        goal: what the map is to take it to.
        along: j_yy, j_xy, j_yx and j_xx, each over the determinant.
    """
    j_yy, j_xy, j_yx, j_xx = along
    e_x, e_y = _single((image[0] - goal[0], image[1] - goal[1]))
    step_x, step_y = j_yy * e_x - j_xy * e_y, j_xx * e_y - j_yx * e_x
    return step_x, step_y, step_x * step_x + step_y * step_y


def _single(place: Place) -> Place:
    """Places in single precision."""
    return place[0].astype(np.float32, copy=False), place[1].astype(np.float32, copy=False)


def _briskly(linearise: Linearise, start: Place, goal: Place) -> tuple[ndarray, ndarray, ndarray]:
    """Where a few Newton steps lead, and whether the last of them was short."""
    x, y, moving = _advance(linearise, start, goal)
    active = np.flatnonzero(moving)
    for _ in range(NEWTON_STEPS):
        if not len(active):
            break
        x[active], y[active], still = _advance(
            linearise, (x[active], y[active]), (goal[0][active], goal[1][active])
        )
        moving[active] = still
        active = active[still]
    return x, y, ~moving


def _advance(linearise: Linearise, place: Place, goal: Place) -> tuple[ndarray, ndarray, ndarray]:
    """The next place, and whether another is needed; a step that would leap is shortened."""
    x, y = place
    step_x, step_y, size = _step(linearise(x, y), goal)
    far = x * x + y * y
    leaping = size > 0.25 * (0.01 + far)
    if leaping.any():
        shorten = np.where(leaping, np.sqrt(0.25 * (0.01 + far) / size), 1.0)
        step_x, step_y = shorten * step_x, shorten * step_y
    return x - step_x, y - step_y, ~(size <= LAST_NEWTON_STEP * LAST_NEWTON_STEP * (1.0 + far))


def _step(at: Warp, goal: Place) -> tuple[ndarray, ndarray, ndarray]:
    """Newton's step, to be taken away from the place, and its length squared."""
    e_x, e_y = at.x - goal[0], at.y - goal[1]
    inverse = 1.0 / determinant(at)
    step_x = (at.j_yy * e_x - at.j_xy * e_y) * inverse
    step_y = (at.j_xx * e_y - at.j_yx * e_x) * inverse
    return step_x, step_y, step_x * step_x + step_y * step_y


def _patiently(linearise: Linearise, sees: Sees, goal: Place) -> tuple[ndarray, ndarray, ndarray]:
    """Where cut steps from the centre lead, and whether that is as near as numbers go in image or place."""
    x, y, cut = (np.zeros_like(goal[0]) for _ in range(3))
    cut += 1.0
    active = np.arange(len(x))
    for _ in range(FLOW_STEPS):
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
        | (_step(at, goal)[2] <= LAST_NEWTON_STEP * LAST_NEWTON_STEP * (1.0 + x * x + y * y)),
    )


def _error(at: Warp, goal: Place) -> ndarray:
    """The squared distance from the goal."""
    return (at.x - goal[0]) ** 2 + (at.y - goal[1]) ** 2
