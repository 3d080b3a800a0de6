"""What the rest of a view says about each of its corners: robust polynomials over the target.

All views are done at once. A corner's value (its pixel, or its residual) is near a polynomial of its place
(x, y) in the target, whatever the lens; wrong corners are not. Places are right and only values may be wrong,
so no corner has a lever, and reweighted least squares finds the polynomial of the others: first of order 1,
with weights 1/|e| (least absolute errors; E. Schlossmacher, JASA 68, 1973), then of orders 2 and 3, with
weights 1 / (1 + |e|^2/s^2)^2, s being HALF_BELIEVED_RATIO times the view's median |e| (S. Geman and D.
McClure, 1987; a median stands at the centre of P. Rousseeuw's robust regression too, JASA 79, 1984). The low
order first: it bears two wrong corners in five, and its weights start the next.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orthoscope.geometry.arrays import Bool, Float, Int, ndarray

__all__ = ["DOUBTED_WEIGHT", "Trend", "local_misses", "medians", "trends"]

# Each of the ten monomials has this order.
MONOMIAL_ORDERS = np.array([order for order in range(4) for _ in range(order + 1)])
# From this many corners on a view has order 1, 2, 3: about four for each coefficient.
CORNERS_FOR_ORDERS = (4, 16, 40)
# Each order is reweighted this often.
REWEIGHTING_ROUNDS = 8
# A corner that misses by this many times the median is half believed or less.
HALF_BELIEVED_RATIO = 2.0
# A corner has this many neighbours: about two rings of a grid where they are whole.
NEIGHBOUR_COUNT = 12
# A corner that is doubted weighs this much, where another weighs 1.
DOUBTED_WEIGHT = 1e-3
# The ridge is this share of the normal matrix's trace: corners on few columns do not tell all monomials.
RIDGE_SHARE = 1e-9


class Trend(NamedTuple):
    """What the polynomials say.

    Attributes:
        values: what the other corners say of each, (m,n,2).
        misses: |its value minus that|, (m,n); 0 where there is no corner.
        typical: their median in each view, (m,).
    """

    values: Float[ndarray, "m n 2"]
    misses: Float[ndarray, "m n"]
    typical: Float[ndarray, " m"]


def trends(
    places: Float[ndarray, "m n 2"],
    values: Float[ndarray, "m n 2"],
    weights: Float[ndarray, "m n"],
    *,
    order: int,
) -> Trend:
    """The robust polynomial of each view's values over its places.

    Args:
        places: of the corners in the target's plane, (m,n,2) metres.
        values: their pixels, residuals or the like, (m,n,2).
        weights: how much each corner has to say, (m,n); 0 where there is none.
        order: of the polynomial at most, 1 to 3; it is less where corners are few.
    """
    orders = np.minimum(order, np.searchsorted(CORNERS_FOR_ORDERS, (weights > 0).sum(1), side="right"))
    powers = _powers(_to_square(places, weights))
    present = (weights > 0).astype(float)
    trust, fitted, misses, typical = weights, values, np.zeros_like(weights), np.zeros(len(weights))
    for upto in range(1, order + 1):
        columns = (
            powers[..., upto >= MONOMIAL_ORDERS]
            * (MONOMIAL_ORDERS[upto >= MONOMIAL_ORDERS] <= orders[:, None])[:, None]
        )
        for _ in range(REWEIGHTING_ROUNDS):
            fitted = columns @ _least_squares(columns, trust, values)
            misses = present * np.hypot(*np.moveaxis(fitted - values, -1, 0))
            typical = medians(misses, present)
            ratio = misses / np.maximum(typical, 1e-9)[:, None]
            trust = weights * (
                1.0 / np.maximum(ratio, 1e-3)
                if upto == 1
                else 1.0 / (1.0 + (ratio / HALF_BELIEVED_RATIO) ** 2) ** 2
            )
    return Trend(fitted, misses, typical)


def local_misses(
    points: Float[ndarray, "p 3"],
    ids: Int[ndarray, "m n"],
    values: Float[ndarray, "m n 2"],
    doubted: Bool[ndarray, "m n"],
) -> Float[ndarray, "m n"]:
    """How far the value of each doubted corner is from the plane through those of its neighbours in the view.

    It is at least as far as these typically are themselves: no plane is followed more closely than that.
    Doubted neighbours have a say where there are few others.

    Args:
        points: of the target, (p,3) metres.
        ids: of the corners, (m,n); -1 where there is none.
        values: their pixels or the like, (m,n,2).
        doubted: which corners are asked about, (m,n).
    Returns:
        (m,n); 0 for corners that are not doubted.
    """
    rows, columns = np.nonzero(doubted)
    asked = np.zeros(len(points), dtype=bool)
    asked[ids[doubted]] = True
    wanted, which = np.flatnonzero(asked), (np.cumsum(asked) - 1)[ids[doubted]]
    apart = ((points[wanted, None, :2] - points[None, :, :2]) ** 2).sum(-1)
    near = np.argsort(apart, axis=1, kind="stable")[which, : NEIGHBOUR_COUNT + 1]  # itself first
    column_of = np.full((len(ids), len(points)), -1)
    seen = np.nonzero(ids >= 0)
    column_of[seen[0], ids[seen]] = seen[1]
    at = column_of[rows[:, None], near]
    say = (at >= 0) * np.where(doubted[rows[:, None], at], DOUBTED_WEIGHT, 1.0)
    trend = trends(points[near, :2], values[rows[:, None], at], say, order=1)
    misses = np.zeros(ids.shape)
    misses[rows, columns] = np.maximum(trend.misses[:, 0], trend.typical)
    return misses


def medians(values: Float[ndarray, "m n"], present: Float[ndarray, "m n"]) -> Float[ndarray, " m"]:
    """The median of each row's values, the upper of two; 0 for a row without any.

    Args:
        values: any numbers, (m,n).
        present: above 0 for the values that count, (m,n).
    """
    ranked = np.sort(np.where(present > 0, values, np.inf), axis=1)
    middle = (present.sum(1) // 2).astype(np.int64)
    found = ranked[np.arange(len(ranked)), np.minimum(middle, ranked.shape[1] - 1)]
    return np.where(np.isfinite(found), found, 0.0)


def _to_square(places: Float[ndarray, "m n 2"], present: Float[ndarray, "m n"]) -> Float[ndarray, "m n 2"]:
    """The places of each view within -1 to 1, 0 where there is no corner."""
    seen = present[..., None] > 0
    some = places[:, :1]  # rows have their corners first, so this is one where there is any
    low, high = np.where(seen, places, some).min(1)[:, None], np.where(seen, places, some).max(1)[:, None]
    return np.where(seen, (2.0 * places - low - high) / np.maximum(high - low, 1e-300), 0.0)


def _powers(places: Float[ndarray, "m n 2"]) -> Float[ndarray, "m n 10"]:
    """x^(o-j) y^j of every order o, in the order of MONOMIAL_ORDERS."""
    x, y = np.moveaxis(places, -1, 0)
    return np.stack([x ** (order - j) * y**j for order in range(4) for j in range(order + 1)], axis=-1)


def _least_squares(
    columns: Float[ndarray, "m n p"], weights: Float[ndarray, "m n"], values: Float[ndarray, "m n 2"]
) -> ndarray:
    """Coefficients (m,p,2) of weighted least squares, view by view."""
    weighted = (columns * weights[..., None]).transpose(0, 2, 1)
    normal = weighted @ columns
    ridge = RIDGE_SHARE * np.trace(normal, axis1=1, axis2=2)[:, None, None] + 1e-300
    return np.linalg.solve(normal + ridge * np.eye(normal.shape[1]), weighted @ values)
