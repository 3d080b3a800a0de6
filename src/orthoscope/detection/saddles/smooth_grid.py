"""Corners that are off where all others foresee them: a board's image is a homography and a smooth rest.

A corner's own row and column say little where it is the last of both, and nothing where its neighbours went
astray with it. So a homography is laid through all corners, and a polynomial of low order through what it
leaves, which a lens and a wavy board make; each corner is compared with what the others foresee (the residual
over one minus its own weight in the fit). The worst is taken out until none is off, and what is then foreseen
is where those that were taken out ought to be.
"""

from __future__ import annotations

import cv2
import numpy as np

from orthoscope.geometry.arrays import Bool, Float, median, ndarray

__all__ = ["off_smooth_grid", "smooth_fit", "smooth_terms"]

# Corners are off by more than so many times the usual residual.
TIMES_USUAL = 8.0
# A corner that is off is off by at least so many pixels.
LEAST_PX = 0.6
# A corner that is off is off by at least this share of a step, where that is more pixels.
LEAST_STEP_SHARE = 0.01
# In a poor picture, whose noise makes the residuals, corners are off beyond so many times the usual one.
TIMES_NOISE = 3.2
# In a poor picture corners are off beyond so many pixels, whatever is usual.
MOST_PX = 0.6
# In a poor picture corners are off beyond this share of a step, where that is more pixels, whatever is usual.
MOST_STEP_SHARE = 0.03
# In a good picture corners that are not doubtful are off beyond this share of a step only: how a lens or a
# board bends the last of them the others cannot foresee.
SURE_STEP_SHARE = 0.15
# The residual of a doubtful corner counts so many times.
DOUBTFUL_TIMES = 2.0
# At most this share of the corners is taken out.
MOST_OUT_SHARE = 0.3
# A polynomial's order, and the corners that it needs at least.
ORDERS = ((5, 45), (4, 32), (3, 22), (2, 12))
# The same in a poor picture, where a higher order follows noise.
ORDERS_OF_POOR = ((3, 22), (2, 12), (1, 8))


def off_smooth_grid(
    pixels: Float[ndarray, "m 2"],
    places: Float[ndarray, "m 2"],
    step: float,
    *,
    doubtful: Bool[ndarray, " m"],
    poor: bool,
    most_order: int = ORDERS[0][0],
) -> tuple[Bool[ndarray, " m"], Float[ndarray, "m 2"], float]:
    """Which corners are off, where the others foresee every one, and how far from there is off, pixels.

    Args:
        pixels: the corners.
        places: column and row of each in the lattice.
        step: from a corner to the next, pixels.
        doubtful: which are off sooner, by half of that.
        poor: whether the picture's noise, not lens or board, makes the residuals.
        most_order: of the polynomial; of corners that are mistaken four together a higher one follows them.
    """
    none = np.zeros(len(pixels), dtype=bool), pixels.copy(), np.inf
    terms = smooth_terms(places, ORDERS_OF_POOR if poor else ORDERS, most_order=most_order)
    if terms is None:
        return none
    off, foreseen, limit = none[0].copy(), pixels, np.inf
    while off.sum() <= MOST_OUT_SHARE * len(off):
        fitted, weight = smooth_fit(pixels, places, terms, ~off)
        if fitted is None:
            return none
        foreseen = np.where(off[:, None], fitted, pixels + (fitted - pixels) / (1.0 - weight)[:, None])
        residual = np.hypot(*(foreseen - pixels).T)
        usual = median(residual[~off])
        limit = max((TIMES_NOISE if poor else TIMES_USUAL) * usual, LEAST_PX, LEAST_STEP_SHARE * step)
        limit = min(limit, max(MOST_PX, MOST_STEP_SHARE * step)) if poor else limit
        surely = limit if poor else max(limit, SURE_STEP_SHARE * step)
        excess = np.where(off, 0.0, residual / np.where(doubtful, limit / DOUBTFUL_TIMES, surely))
        if excess.max() <= 1.0:
            break
        off[excess.argmax()] = True
    return off, foreseen, limit


def smooth_terms(
    places: Float[ndarray, "m 2"],
    orders: tuple[tuple[int, int], ...] = ORDERS,
    *,
    most_order: int = ORDERS[0][0],
) -> Float[ndarray, "m t"] | None:
    """The terms of a polynomial of as high an order as so many corners at these places bear; None where they
    bear none.

    Args:
        places: column and row of each corner in the lattice.
        orders: from the highest, with the corners that each needs.
        most_order: the highest that is wanted.
    """
    if not len(places):
        return None
    reach = min(np.ptp(places, axis=0).min() - 1, most_order)
    order = next((order for order, needed in orders if len(places) >= needed and reach >= order), None)
    if order is None:
        return None
    x, y = (2.0 * (places - places.min(0)) / np.ptp(places, axis=0) - 1.0).T
    return np.stack([x**i * y**j for i in range(order + 1) for j in range(order + 1 - i)], axis=1)


def smooth_fit(
    pixels: ndarray, places: ndarray, terms: ndarray, used: ndarray
) -> tuple[Float[ndarray, "m 2"] | None, Float[ndarray, " m"]]:
    """Where homography and polynomial through the used corners have all of them, and each one's weight."""
    homography, _ = cv2.findHomography(places[used], pixels[used], 0)
    if homography is None:
        return None, np.zeros(len(pixels))
    flat = cv2.perspectiveTransform(places[None].astype(float), homography)[0]
    basis = np.linalg.qr(terms[used])[0]
    rest = (pixels - flat)[used]
    fitted = flat.copy()
    fitted[used] += basis @ (basis.T @ rest)
    if not used.all():
        fitted[~used] += terms[~used] @ np.linalg.lstsq(terms[used], rest, rcond=None)[0]
    weight = np.zeros(len(pixels))
    weight[used] = np.minimum((basis**2).sum(1), 0.9)
    return fitted, weight
