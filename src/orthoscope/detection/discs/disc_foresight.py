"""Where the discs beside those that were found ought to be: by a parabola through the nearest found ones."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from orthoscope.detection.discs.disc_links import DIRECTION_STEPS
from orthoscope.geometry.arrays import Bool, Float, Int, ndarray
from orthoscope.geometry.ellipses import Ellipses

__all__ = ["FORESEEING_DISCS", "beside", "foreseen", "foretelling", "is_among"]

# So many discs nearby foresee one.
FORESEEING_DISCS = 12
# A disc is seen when it is in the picture with its radii multiplied by this.
SEEN_MARGIN = 1.25


def beside(places: Int[ndarray, "n 2"]) -> Int[ndarray, "k 2"]:
    """The places of a lattice that are next to these and none of these."""
    known, around = ({tuple(place) for place in part.tolist()} for part in (places, _around(places)))
    return np.array(sorted(around - known), dtype=int).reshape(-1, 2)


def _around(places: Int[ndarray, "n 2"]) -> Int[ndarray, "m 2"]:
    return (places[:, None] + DIRECTION_STEPS).reshape(-1, 2)


def is_among(places: Int[ndarray, "n 2"], others: Int[ndarray, "k 2"]) -> Bool[ndarray, " n"]:
    """Which places are one of the others."""
    among = {tuple(place) for place in others.tolist()}
    return np.array([tuple(place) in among for place in places.tolist()], dtype=bool)


def foreseen(
    discs: Ellipses, places: Int[ndarray, "n 2"], wanted: Int[ndarray, "m 2"], shape: tuple[int, ...]
) -> tuple[Int[ndarray, "k 2"], Ellipses]:
    """Those of some places whose discs should be in the picture, and where.

    Args:
        discs: that were found.
        places: of these in the lattice.
        wanted: places of others.
        shape: of the picture.
    """
    apart = np.abs(wanted[:, None] - places).sum(-1)
    nearest = np.argsort(apart, axis=1, kind="stable")[:, :FORESEEING_DISCS]
    where = [
        foretelling(places[near] - place) @ discs.centres[near]
        for near, place in zip(nearest, wanted, strict=True)
    ]
    like = discs.axes[nearest[:, 0]] if len(wanted) else np.zeros((0, 2, 2))
    found = Ellipses(np.array(where).reshape(-1, 2), like)
    reach = SEEN_MARGIN * np.linalg.norm(found.axes, axis=2)
    inside = ((found.centres - reach > 1) & (found.centres + reach < np.array(shape[1::-1]) - 2)).all(1)
    return wanted[inside], found.of(inside)


def foretelling(steps: Int[ndarray, "k 2"]) -> Float[ndarray, " k"]:
    """By what weights discs so many steps away foretell here: by a parabola, few discs by a plane."""
    return _weights(tuple(steps.ravel().tolist()))


@lru_cache(maxsize=4096)
def _weights(steps: tuple[int, ...]) -> Float[ndarray, " k"]:
    """As above; the discs of a lattice have the same neighbours again and again."""
    x, y = np.array(steps, dtype=float).reshape(-1, 2).T
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)
    enough = len(x) >= FORESEEING_DISCS and min(len(set(steps[::2])), len(set(steps[1::2]))) >= 3
    return np.linalg.pinv(terms[:, : 6 if enough else 3])[0]
