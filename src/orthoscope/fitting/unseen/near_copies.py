"""Photographs that are the same photograph again: a burst, a tripod, frames of a film.

Copies agree with each other whatever is true, so no copy may foretell another: those that are near-copies are
left out together (leave_one_out.py) and count as one photograph.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from orthoscope.geometry.arrays import Int, evenly, median, ndarray
from orthoscope.targets.detections import Detections

__all__ = ["near_copies", "summed_over"]

# Views are the same photograph again where most of their corners are apart by less, pixels in an image of
# this width; in a larger one by more.
COPIED_PX = 1.0
USUAL_WIDTH = 1000.0
# With fewer corners in common two views cannot be compared.
FEWEST_COMMON = 4
# So many corners tell first which views may be copies at all.
FIRST_CORNERS = 16


@lru_cache(maxsize=4)
def near_copies(detections: Detections) -> Int[ndarray, " m"]:
    """Which photograph each view is: the number, from 0, of the first view that it copies, counted without
    copies.

    Many ask for it, of the same detections.
    """
    near = COPIED_PX * max(1.0, max(detections.image_size) / USUAL_WIDTH)
    views, corners = len(detections.views), len(detections.target.points)
    tables = np.full((views, corners, 2), np.nan)
    for table, view in zip(tables, detections.views, strict=True):
        table[view.ids] = view.pixels
    some = evenly(corners, FIRST_CORNERS)
    seen = np.isfinite(tables[:, some, 0])
    far = (
        -10.0 * near * np.arange(1.0, views + 1.0)[:, None, None]
    )  # where a corner was not seen: near to none
    x, y = (
        np.floor(np.where(seen[..., None], tables[:, some], far) / near).astype(np.int32).transpose(2, 0, 1)
    )
    number = np.zeros(views, dtype=np.int64)
    kept = np.zeros(views, dtype=np.int64)  # the first so many: views that copy none before them
    at_x, at_y, count = np.empty_like(x), np.empty_like(y), 0  # of those that are kept
    for i in range(views):
        # A corner that moved by less than a cell lies in its own cell or in one of those around it.
        close = (np.abs(at_x[:count] - x[i]) <= 1) & (np.abs(at_y[:count] - y[i]) <= 1)
        perhaps = np.flatnonzero(close.any(1)) if seen[i].any() else range(count)
        same = [n for n in perhaps if _is_copy(tables[kept[n]], tables[i], near)]
        number[i] = same[0] if same else count
        if not same:
            kept[count], at_x[count], at_y[count] = i, x[i], y[i]
            count += 1
    number.setflags(write=False)
    return number


def _is_copy(one: ndarray, other: ndarray, near: float) -> bool:
    apart = np.hypot(*(one - other).T)
    common = np.isfinite(apart)
    return bool(common.sum() >= FEWEST_COMMON and median(apart[common]) < near)


def summed_over(groups: Int[ndarray, " m"], values: ndarray) -> ndarray:
    """For each view the sum over the views that are the same photograph.

    Args:
        groups: as `near_copies` gives them.
        values: (m, ...).
    """
    count = int(groups.max(initial=-1)) + 1
    if count == len(groups):
        return values
    sums = np.zeros((count, *values.shape[1:]))
    np.add.at(sums, groups, values)
    return sums[groups]
