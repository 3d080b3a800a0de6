"""Corners that hang together: each next to another of its row or column, and what stands apart from most.

Where something covers the middle of a board, what lies beyond is foreseen from afar, and may be taken for the
corner beside it: a true corner with a wrong number. Corners that are linked to most, from one to the next,
are numbered by counting. Many together are not mistaken for those beside them, since lines would have a step
in them; one that is apart stays only where those nearest to it foresee it, by a homography, well within a
step, and is not far from them.
"""

from __future__ import annotations

import cv2
import numpy as np

from orthoscope.geometry.arrays import Bool, Float, Int, ndarray

__all__ = ["are_linked"]

# So many corners that are linked to each other stay, though they are apart from most.
MANY_CORNERS = 6
# So many of the linked corners, the nearest ones, foresee one that is apart.
FORESEEING_CORNERS = 8
# One that is apart is at most so many steps from the nearest linked one.
FARTHEST_STEPS = 2
# It is off where it is foreseen by less than this share of a step.
MOST_OFF_SHARE = 0.25


def are_linked(
    pixels: Float[ndarray, "m 2"], cells: Int[ndarray, "m 2"], places: Float[ndarray, "m 2"]
) -> Bool[ndarray, " m"]:
    """Which corners belong to most of them.

    Args:
        pixels: the corners.
        cells: the column and row of each in the lattice, counted.
        places: where the board has them.
    """
    if not len(pixels):
        return np.zeros(0, dtype=bool)
    low = cells.min(0)
    column, row = (cells - low).T
    seen = np.zeros(tuple(np.ptp(cells, axis=0) + 1), np.uint8)
    seen[column, row] = 1
    mine = np.asarray(cv2.connectedComponents(seen, connectivity=4)[1])[column, row].astype(int)
    most = mine == np.bincount(mine).argmax()
    kept = most.copy()
    many = np.bincount(mine)[mine] >= MANY_CORNERS
    kept |= many
    for apart in np.flatnonzero(~kept).tolist():
        kept[apart] = _is_foreseen(apart, np.flatnonzero(most), pixels, cells, places)
    return kept


def _is_foreseen(
    apart: int, others: Int[ndarray, " k"], pixels: ndarray, cells: ndarray, places: ndarray
) -> bool:
    """Whether a corner lies where those of the others that are nearest to it foresee it."""
    away = np.abs(cells[others] - cells[apart]).max(1)
    if away.min() > FARTHEST_STEPS:
        return False
    nearest = others[np.argsort(away, kind="stable")[:FORESEEING_CORNERS]]
    if np.linalg.matrix_rank(places[nearest] - places[nearest].mean(0), tol=1e-6) < 2 or len(nearest) < 5:
        return False
    homography, _ = cv2.findHomography(places[nearest], pixels[nearest], 0)
    if homography is None:
        return False
    there = cv2.perspectiveTransform(np.stack([places[apart], places[nearest[0]]])[None], homography)[0]
    steps = max(int(np.abs(cells[nearest[0]] - cells[apart]).sum()), 1)
    step = np.hypot(*(there[1] - there[0])) / steps
    return bool(np.hypot(*(there[0] - pixels[apart])) < MOST_OFF_SHARE * step)
