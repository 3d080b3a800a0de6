"""Where corners of a board of markers foresee others: which are off, and where those next to them must be.

A board's image is a homography and a smooth rest: a lens and a wavy board make a polynomial of low order. Of
which order is told by the corners: each is foreseen by all others (with h its own weight in the fit, by the
residual over 1 - h), and the order is taken with which they usually are foreseen best. Then

    a corner is off by        the distance from where it is foreseen
    others miss by            usual / sqrt(1 - h), more at the board's own corners, which weigh most
    orders beyond may add     as much as the last order moves what is foreseen there

and what is farther off than all that together was mistaken. The worst is taken out until none is left.

Corners that are not known yet are foreseen by the nearest ones that are, by a polynomial.
"""

from __future__ import annotations

import cv2
import numpy as np

from orthoscope.geometry.arrays import Bool, Float, Int, median, ndarray

__all__ = ["are_off", "next_corners"]

# Corners are off beyond so many times what is usual at their place.
TIMES_USUAL = 6.0
# And beyond at least this, pixels.
LEAST_PX = 0.6
# The highest order of the polynomial, and so many corners to each of its terms.
MOST_ORDER, CORNERS_PER_TERM = 5, 2
# A corner's own weight in a fit counts as at most this.
MOST_WEIGHT = 0.98
# At most this share of the corners is taken out.
MOST_OUT_SHARE = 0.3
# Where a further order adds less than this to a direction that lower ones have, it is no further one.
LEAST_INDEPENDENT = 1e-6

# So many of the nearest corners foresee one that is not known.
FORESEEING_CORNERS = 16
# Terms of each order are held to nothing by so much, where corners do not say what they are: they are about
# so many times as large as corners are off.
STRAIGHTNESS = (1e-9, 1e-9, 3e-4, 1e-2)


def next_corners(
    places: Float[ndarray, "m 2"], ids: Int[ndarray, " k"], pixels: Float[ndarray, "k 2"], reach: float
) -> tuple[Int[ndarray, " n"], Float[ndarray, "n 2"]]:
    """Corners that are not known but near to some that are, and where these foresee them.

    Args:
        places: where the board has all of its corners, in steps.
        ids: of the corners that are known.
        pixels: where they are.
        reach: how far from a known one those are that are foreseen, in steps.
    """
    missing = np.setdiff1d(np.arange(len(places)), ids)
    apart = np.linalg.norm(places[missing, None] - places[ids], axis=-1)
    close = apart.min(1, initial=np.inf) <= reach
    missing, apart = missing[close], apart[close]
    if not len(missing) or len(ids) < 3:
        return missing[:0], np.zeros((0, 2))
    nearest = np.argsort(apart, axis=1, kind="stable")[:, :FORESEEING_CORNERS]
    x, y = np.moveaxis(places[ids[nearest]] - places[missing][:, None], -1, 0) / reach
    powers = [(order - i, i) for order in range(len(STRAIGHTNESS)) for i in range(order + 1)]
    terms = np.stack([x**i * y**j for i, j in powers], axis=-1)
    held = np.diag([STRAIGHTNESS[i + j] for i, j in powers])
    turned = np.swapaxes(terms, 1, 2)
    return missing, np.linalg.solve(turned @ terms + held, turned @ pixels[nearest])[:, 0]


def are_off(pixels: Float[ndarray, "m 2"], places: Float[ndarray, "m 2"]) -> Bool[ndarray, " m"]:
    """Which corners are off.

    Args:
        pixels: the corners.
        places: where the board has them.
    """
    off = np.zeros(len(pixels), dtype=bool)
    while off.sum() <= MOST_OUT_SHARE * len(off):
        excess = _excess(pixels[~off], places[~off])
        if excess is None or excess.max() <= 1.0:
            break
        off[np.flatnonzero(~off)[excess.argmax()]] = True
    return off


def _excess(pixels: Float[ndarray, "m 2"], places: Float[ndarray, "m 2"]) -> Float[ndarray, " m"] | None:
    """How far each corner is off, over what is allowed there; None where too few corners tell."""
    orders = [order for order in range(1, MOST_ORDER + 1) if CORNERS_PER_TERM * _count(order) <= len(pixels)]
    if not orders or not (size := np.ptp(places, axis=0)).all():
        return None
    homography = cv2.findHomography(places, pixels, 0)[0]
    if homography is None:
        return None
    rest = pixels - cv2.perspectiveTransform(places[None].astype(float), homography)[0]
    x, y = (2.0 * (places - places.min(0)) / size - 1.0).T
    powers = [x ** (order - i) * y**i for order in range(orders[-1] + 1) for i in range(order + 1)]
    basis, triangle = np.linalg.qr(np.stack(powers, axis=1))
    basis = basis * (np.abs(np.diag(triangle)) > LEAST_INDEPENDENT * np.sqrt(len(pixels)))
    weights, off = [], []
    for order in orders:
        some = basis[:, : _count(order)]
        weights.append(np.minimum((some * some).sum(1), MOST_WEIGHT))
        off.append((rest - some @ (some.T @ rest)) / (1.0 - weights[-1])[:, None])
    usual = [median(np.hypot(*one.T)) for one in off]
    best = int(np.argmin(usual))
    beyond = np.hypot(*(off[best] - off[max(best - 1, 0)]).T)
    missed = np.maximum(TIMES_USUAL * usual[best] / np.sqrt(1.0 - weights[best]), LEAST_PX)
    return np.hypot(*off[best].T) / (missed + beyond)


def _count(order: int) -> int:
    """Terms of a polynomial in x and y."""
    return (order + 1) * (order + 2) // 2
