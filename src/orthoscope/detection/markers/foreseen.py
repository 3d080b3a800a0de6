"""Where corners of a board of markers foresee others: which are off, and where those next to them must be.

A board's image is a homography seen by a lens that bends as its corners say best (one number, Fitzgibbon's
division model), and a smooth rest: the lens's own shape and a wavy board make a polynomial. With one of each
order up to the fifth a corner is foreseen by all others (with h its own weight in the fit, by the residual
over 1 - h). Then

    a corner is off by        the distance from where it is foreseen
    others miss by            usual / sqrt(1 - h), more at the board's own corners, which weigh most
    orders beyond may add     as much as the next ones move what is foreseen there, or this one did

and what is for any order farther off than all that together was mistaken: low orders are coarse and certain,
high ones fine, and lenient at the board's corners. The worst is taken out until none is left.

Corners that are not known yet are foreseen by the nearest ones that are, by a polynomial.
"""

from __future__ import annotations

import cv2
import numpy as np

from orthoscope.geometry.arrays import Bool, Float, Int, median, ndarray

__all__ = ["are_off", "next_corners"]

# Corners are off beyond so many times what is usual at their place.
TIMES_USUAL = 5.5
# How far a doubtful corner is off counts so many times.
DOUBTFUL_TIMES = 1.4
# And beyond at least this, pixels.
LEAST_PX = 0.6
# An order is compared with the one before and so many beyond it: of a lens every other one is small.
ORDERS_BEYOND = 2
# The highest order of the polynomial, and so many corners to each of its terms.
MOST_ORDER, CORNERS_PER_TERM = 5, 2
# A corner's own weight in a fit counts as at most this.
MOST_WEIGHT = 0.98
# How a lens may bend, by the share by which half the picture's diagonal is shorter than straight: from a
# cushion to a fisheye.
BENDS = (-0.1, 0.0, 0.1, 0.2, 0.3, 0.45, 0.6, 0.75, 0.9)
# What is straightened farther than this is at the horizon.
LEAST_STRAIGHTENED = 0.05
# The others do not foresee a corner by which a board's perspective hangs by more than this share: a doubtful
# one goes.
MOST_ALONE = 0.85
# Fewer corners say nothing of each other.
FEWEST_CORNERS = 8
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


def are_off(
    pixels: Float[ndarray, "m 2"],
    places: Float[ndarray, "m 2"],
    shape: tuple[int, ...],
    *,
    least: float = LEAST_PX,
    doubtful: Bool[ndarray, " m"] | None = None,
) -> Bool[ndarray, " m"]:
    """Which corners are off.

    Args:
        pixels: the corners.
        places: where the board has them.
        shape: of the picture.
        least: what is no farther off is not off, pixels.
        doubtful: which are off sooner: something may lie beside them.
    """
    off = np.zeros(len(pixels), dtype=bool)
    if len(pixels) < FEWEST_CORNERS or not np.ptp(places, axis=0).all():
        return off
    if doubtful is not None:
        off = doubtful & (_own_share(places) > MOST_ALONE)
        if (~off).sum() < FEWEST_CORNERS:
            return off
    centre, radius = 0.5 * np.array(shape[1::-1]), 0.5 * float(np.hypot(shape[0], shape[1]))
    bent = min(BENDS, key=lambda bend: _bent_apart((pixels - centre) / radius, places, bend))
    while off.sum() <= MOST_OUT_SHARE * len(off):
        excess = np.zeros(int((~off).sum()))
        for method in (0, cv2.LMEDS):  # several that are mistaken together draw the first to themselves
            flat = _bent((pixels[~off] - centre) / radius, places[~off], bent, method) * radius + centre
            if np.isfinite(flat).all():
                excess = np.maximum(excess, _excess(pixels[~off] - flat, places[~off], least))
        if doubtful is not None:
            excess = np.where(doubtful[~off], DOUBTFUL_TIMES * excess, excess)
        if excess.max() <= 1.0:
            break
        off[np.flatnonzero(~off)[excess.argmax()]] = True
    return off


def _own_share(places: Float[ndarray, "m 2"]) -> Float[ndarray, " m"]:
    """By how much each corner tells by itself where it is, of a plane that is seen from near: 1 beside a row
    and a column of others.
    """
    x, y = _spread_evenly(places)
    basis = _orthonormal([np.ones_like(x), x, y, x * y])
    return np.asarray((basis * basis).sum(1))


def _orthonormal(terms: list[Float[ndarray, " m"]]) -> Float[ndarray, "m t"]:
    """A basis of these terms, one after the other; 0 where a term adds nothing to those before it."""
    basis, triangle = np.linalg.qr(np.stack(terms, axis=1))
    return np.asarray(basis * (np.abs(np.diag(triangle)) > LEAST_INDEPENDENT * np.sqrt(len(basis))))


def _spread_evenly(places: Float[ndarray, "m 2"]) -> Float[ndarray, "2 m"]:
    """Places from -1 to 1 both ways."""
    return np.asarray((2.0 * (places - places.min(0)) / np.maximum(np.ptp(places, axis=0), 1e-9) - 1.0).T)


def _bent_apart(pixels: Float[ndarray, "m 2"], places: Float[ndarray, "m 2"], bend: float) -> float:
    """How far corners usually are from a board seen by a lens that bends so."""
    return median(np.hypot(*(_bent(pixels, places, bend) - pixels).T))


def _bent(
    pixels: Float[ndarray, "m 2"], places: Float[ndarray, "m 2"], bend: float, method: int = 0
) -> Float[ndarray, "m 2"]:
    """Where a lens that bends so has the corners of a flat board: r_straight = r / (1 - bend r^2)."""
    straight = pixels / np.maximum(1.0 - bend * (pixels**2).sum(1), LEAST_STRAIGHTENED)[:, None]
    homography, _ = cv2.findHomography(places, straight, method)
    if homography is None:
        return np.full_like(pixels, np.inf)
    there = cv2.perspectiveTransform(places[None].astype(float), homography)[0]
    away = np.hypot(*there.T)
    return there * (2.0 / (1.0 + np.sqrt(1.0 + 4.0 * bend * away**2)))[:, None]


def _excess(rest: Float[ndarray, "m 2"], places: Float[ndarray, "m 2"], least: float) -> Float[ndarray, " m"]:
    """How far each corner is off, over what is allowed there, by what a flat board leaves."""
    orders = [order for order in range(1, MOST_ORDER + 1) if CORNERS_PER_TERM * _count(order) <= len(rest)]
    x, y = _spread_evenly(places)
    basis = _orthonormal(
        [x ** (order - i) * y**i for order in range(orders[-1] + 1) for i in range(order + 1)]
    )
    off, weights = [], []
    for order in orders:
        some = basis[:, : _count(order)]
        weights.append(np.minimum((some * some).sum(1), MOST_WEIGHT))
        off.append((rest - some @ (some.T @ rest)) / (1.0 - weights[-1])[:, None])
    excess = np.zeros(len(rest))
    for number, (here, weight) in enumerate(zip(off, weights, strict=True)):
        residual = np.hypot(*here.T)
        missed = np.maximum(TIMES_USUAL * median(residual) / np.sqrt(1.0 - weight), least)
        others = np.stack(off[max(number - 1, 0) : number + ORDERS_BEYOND + 1])
        beyond = np.hypot(*(others - here).transpose(2, 0, 1)).max(0)
        excess = np.maximum(excess, residual / (missed + beyond))
    return excess


def _count(order: int) -> int:
    """Terms of a polynomial in x and y."""
    return (order + 1) * (order + 2) // 2
